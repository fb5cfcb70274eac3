"""A scene with its random blasts: their names and order, and what cannot be."""

from typing import Any

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Charge, Free, Scene, Uniform
from jblast.scene.reader import world_from_document
from jblast.world import scene_of_one_blast, with_nevers
from tests.world.worlds import VEHICLE, document, drawn


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


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
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


def test_charges_are_filled_up_to_a_power_of_two_by_some_that_never_happen():
    for count, filled in ((1, 1), (2, 2), (3, 4), (5, 8)):
        charges = [Charge(time_s=1.0 * n, name=str(n)) for n in range(count)]
        scene = with_nevers(Scene(charges=tuple(charges)))
        assert len(scene.charges) == filled
        assert [charge.name for charge in scene.charges[:count]] == [
            charge.name for charge in charges
        ]
        assert all(bool(charge.never) for charge in scene.charges[count:])
        assert not any(bool(charge.never) for charge in scene.charges[:count])


def one(**tables):
    return scene_of_one_blast(*world_from_document(document(**tables), "w.toml"))


def test_a_blast_has_the_priors_that_it_was_drawn_by():
    beliefs = one(world={}).beliefs
    assert set(beliefs) == {
        "charge_mass_kg",
        "charge_east_m",
        "charge_north_m",
        "origin_time_s",
    }
    mass, east = beliefs["charge_mass_kg"], beliefs["charge_east_m"]
    assert isinstance(mass, Uniform)
    assert isinstance(east, Uniform)
    assert (mass.lo, mass.hi, east.lo, east.hi) == (5, 15, -50, 50)
    # of one among several gaps decide
    assert isinstance(beliefs["origin_time_s"], Free)
    assert isinstance(one(world={"count": 1}).beliefs["origin_time_s"], Uniform)


def test_what_is_fixed_stays_fixed():
    told = one(world={"count": 1, "mass_kg": 7, "time_s": 3})
    assert set(told.beliefs) == {"charge_east_m", "charge_north_m"}
    assert told.scene.charge.mass_kg == 7
    assert told.scene.charge.time_s == 3
    high = one(world={"region_m": {"box": [[-5, -5, 2], [5, 5, 2]]}})
    np.testing.assert_allclose(high.scene.charge.up, 2)


def test_a_ring_has_the_prior_of_the_box_around_it():
    beliefs = one(world={"region_m": {"ring": [10, 20]}}).beliefs
    assert "charge_up_m" not in beliefs
    for name in ("charge_east_m", "charge_north_m"):
        prior = beliefs[name]
        assert isinstance(prior, Uniform)
        assert (prior.lo, prior.hi) == (-20, 20)


def test_places_about_a_vehicle_are_free():
    ring = one(world={"region_m": {"ring": [10, 20]}, "about": "vehicle"}).beliefs
    assert isinstance(ring["charge_east_m"], Free)
    assert "charge_up_m" not in ring
    box = {"box": [[-5, -5, -1], [5, 5, 1]], "about": "vehicle"}
    assert isinstance(one(world={"region_m": box}).beliefs["charge_up_m"], Free)


def test_the_laws_are_those_that_the_world_is_made_by():
    laws = dict(one(law={}).scene.law)
    assert laws["air_arrival_s"] == "shock_kinematics"
    assert dict(one().scene.law)["air_arrival_s"] == "acoustic"


def test_a_charge_beside_random_ones_is_refused():
    with pytest.raises(InputError, match=r"\[charge\]: expected none in a scene with"):
        one(charge={"mass_kg": 1.0})
