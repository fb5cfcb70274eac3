"""[world] in a scene file: what it may say, what it says if absent, what is refused."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Box, ByCount, ByRate, ByTick, LogNormal, Ring, Uniform
from jblast.scene.reader.scene import world_from_document

VEHICLE = {"model": "iris", "position_m": [10.0, 0.0, 2.0]}


def read(**keys):
    return world_from_document({"world": keys, "vehicle": VEHICLE}, "s.toml")[1]


def test_absent_keys_take_what_the_reference_page_prints():
    world = read()
    assert world.occurrence == ByCount(5)
    assert world.about == "world"
    assert isinstance(world.region, Box)
    np.testing.assert_array_equal(world.region.low, [-50, -50, 0])
    np.testing.assert_array_equal(world.region.high, [50, 50, 0])
    assert isinstance(world.mass, Uniform)
    assert (world.mass.lo, world.mass.hi) == (5, 15)
    assert world.window == (1, 20)
    assert world.gap == 0.5


def test_a_pair_of_numbers_is_uniform_and_priors_are_what_they_say():
    world = read(mass_kg=[1, 2], gap_s={"uniform": [0.1, 0.2]}, rate_hz=2.0)
    assert isinstance(world.mass, Uniform)
    assert isinstance(world.gap, Uniform)
    assert isinstance(world.occurrence, ByRate)
    assert isinstance(read(mass_kg={"lognormal": [5, 2]}).mass, LogNormal)
    assert read(probability=0.15, tick_s=1.0).occurrence == ByTick(0.15, 1.0)


def test_what_a_region_is_about_is_said_in_it_or_beside_it():
    inside = read(region_m={"ring": [10, 20], "about": "vehicle"})
    beside = read(region_m={"ring": [10, 20]}, about="vehicle")
    assert isinstance(inside.region, Ring)
    assert inside.about == beside.about == "vehicle"


def test_without_a_charge_there_is_none_that_happens():
    uncertain, _ = world_from_document({"world": {}}, "s.toml")
    assert uncertain.scene.charge.never
    assert not uncertain.beliefs
    told, _ = world_from_document({"world": {}, "charge": {"mass_kg": 3.0}}, "s.toml")
    assert not told.scene.charge.never


FLAT = [[0, 0, 0], [0, 5, 0]]
REFUSED = {
    "no blast": ({"count": 0}, "count: expected a whole number, 1 to .*, got 0"),
    "too many": (
        {"count": 21, "time_s": [0, 19], "gap_s": 1},
        "count: expected at most 20, which fit between 0 and 19 s at gap_s 1, got 21",
    ),
    "several at once": ({"count": 2, "time_s": 3}, "count: expected at most 1"),
    "a rate below zero": ({"rate_hz": -1}, "rate_hz: .*positive, got -1"),
    "a probability above 1": (
        {"probability": 1.5, "tick_s": 1},
        "probability: expected a number above 0 and at most 1, got 1.5",
    ),
    "no tick": ({"probability": 0.1}, "tick_s: expected the time .*, got nothing"),
    "a tick alone": ({"tick_s": 1}, "tick_s: expected probability"),
    "two of three": ({"count": 1, "rate_hz": 1}, "rate_hz: expected one of count, r"),
    "a line": ({"region_m": {"box": FLAT}}, "box: expected a region with an extent.*e"),
    "corners swapped": (
        {"region_m": {"box": [[1, 1, 1], [2, 2, 0]]}},
        "first corner less than its second up",
    ),
    "a circle": ({"region_m": {"ring": [5, 5]}}, "ring: .*area, got"),
    "a box of one corner": ({"region_m": {"box": [[0, 0, 0]]}}, "box: expected"),
    "box and ring": (
        {"region_m": {"box": [[0, 0, 0], [1, 1, 0]], "ring": [1, 2]}},
        "region_m: expected either box or ring, got both",
    ),
    "a sphere": ({"region_m": {"sphere": 5}}, "region_m sphere: unknown key"),
    "a region that is a number": ({"region_m": 5}, "region_m: expected { box = "),
    "about the moon": ({"about": "moon"}, "about: expected one of world, vehicle"),
    "about twice": (
        {"about": "world", "region_m": {"about": "world"}},
        "about: expected it once",
    ),
    "no mass": ({"mass_kg": 0}, "mass_kg: .*positive, got 0"),
    "a free mass": ({"mass_kg": "free"}, "mass_kg: expected a number or a prior"),
    "a gap below zero": ({"gap_s": -1}, "gap_s: .*not negative, got -1"),
    "times that are not uniform": (
        {"time_s": {"normal": [10, 1]}},
        "gap_s: .*not supported yet",
    ),
    "a rate without an end": (
        {"rate_hz": 1, "time_s": 3},
        "time_s: .*the interval with blasts",
    ),
    "an unknown key": ({"cuont": 3}, "cuont: unknown key; did you mean count"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_used_is_refused_by_file_and_key(name):
    keys, message = REFUSED[name]
    with pytest.raises(InputError, match=message) as error:
        read(**keys)
    assert str(error.value).startswith("s.toml: [world] ")


def test_a_region_about_no_vehicle_is_refused():
    with pytest.raises(InputError, match=r"about: expected a \[vehicle\]"):
        world_from_document({"world": {"about": "vehicle"}}, "s.toml")


def test_a_scene_without_random_blasts_is_no_world():
    with pytest.raises(InputError, match=r"\[world\]: expected a table .*, got none"):
        world_from_document({}, "s.toml")
