"""What a world's file says of any one of its blasts: the priors of a fit."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Free, Uniform
from jblast.scene.reader.scene import world_from_document
from jblast.world import scene_of_one_blast
from tests.world.worlds import document


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
