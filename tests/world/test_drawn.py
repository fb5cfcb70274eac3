"""A scene with its random blasts: their names and order, and what cannot be."""

import numpy as np
import pytest

from jblast.errors import InputError
from tests.world.worlds import VEHICLE, drawn


def test_charges_come_in_order_of_time_and_keep_the_number_they_were_drawn_by():
    world = drawn(world={"count": 6, "gap_s": 0.0})
    times = [float(charge.time_s) for charge in world.scene.charges]
    assert times == sorted(times)
    assert sorted(world.shots) == list("123456")
    assert world.shots != tuple("123456")
    longer = drawn(world={"count": 9, "gap_s": 0.0})
    these = {c.name: c for c in world.scene.charges}
    those = {c.name: c for c in longer.scene.charges}
    for name in these:
        assert these[name].time_s == those[name].time_s
        assert these[name].position_m == those[name].position_m
        assert these[name].mass_kg == those[name].mass_kg


def test_a_charge_of_the_scene_explodes_besides():
    world = drawn(world={"count": 2}, charge={"mass_kg": 3.0, "time_s": 0.5})
    assert world.shots[0] == "charge"
    assert sorted(world.shots[1:]) == ["1", "2"]


def test_a_region_about_the_vehicle_is_about_the_place_that_it_holds():
    vehicle = VEHICLE | {"control": {"target_m": [300.0, 0.0, 9.0]}}
    ring = {"region_m": {"ring": [10, 20]}, "about": "vehicle"}
    world = drawn(world=ring, vehicle=vehicle)
    for charge in world.scene.charges:
        east, north, up = (float(x) for x in charge.position_m)
        assert 10 <= np.hypot(east - 300, north) <= 20
        assert up == 0


def test_priors_of_the_scene_are_drawn_by_the_same_seed():
    air = {"temperature_k": {"normal": [288, 5]}}
    first, again, other = (drawn(seed, air=air) for seed in (1, 1, 2))
    assert first.scene.air.temperature == again.scene.air.temperature
    assert first.scene.air.temperature != other.scene.air.temperature


def test_where_chance_leaves_no_blast_there_is_none():
    world = drawn(world={"rate_hz": 1e-9})
    assert world.shots == ()
    assert world.scene.charge.never


REFUSED = {
    "a number's name": (
        {"charge": [{"name": "1", "mass_kg": 1.0}, {"name": "b", "mass_kg": 1.0}]},
        "name: expected a name that no random blast has, got '1'",
    ),
    "a second vehicle": (
        {"sensor": [{"name": "vehicle", "position_m": [0, 0, 0]}]},
        "name: expected another name than that of the scene's vehicle",
    ),
    "no place": ({"sensor": [{"name": "a"}]}, "'a' position_m: expected"),
    "a free number": ({"air": {"temperature_k": "free"}}, "free and cannot be drawn"),
    "a range": (
        {"charge": {"mass_kg": 1.0, "range_m": 5.0}, "sensor": []},
        "range_m: expected position_m",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_drawn_is_refused(name):
    tables, message = REFUSED[name]
    with pytest.raises(InputError, match=message):
        drawn(**tables)
