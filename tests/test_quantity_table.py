"""The table of quantities is whole, and agrees with laws, readers and reports."""

import math
import subprocess
import sys

import pytest

import jblast.waves as _waves  # noqa: F401  laws enter the registry
from jblast.quantities import (
    ADDABLE,
    ADDITIVE,
    ARRIVALS,
    BY_CAMERA,
    BY_VEHICLE,
    CIRCULAR,
    CLOCK_TIMES,
    DERIVED_QUANTITIES,
    DIRECTIONS,
    FEEL_WIND,
    FIREBALL_RADII,
    PLACELESS,
    QUANTITIES,
    TIMED,
    TIMES,
    components,
    made_with,
    quantity_named,
)
from jblast.registry import LAWS
from jblast.report.words import LADDERS, quantity_words, split_name
from jblast.scene.charge import EXPLOSIVES, tnt_factor
from jblast.scene.reader.tables import KEYS
from jblast.sensors.calculator import COMBINATIONS

ALL = [*QUANTITIES.values(), *DERIVED_QUANTITIES.values()]

every_quantity = pytest.mark.parametrize("one", ALL, ids=lambda one: one.name)


def test_every_quantity_that_a_law_gives_is_in_the_table_and_the_other_way_round():
    given = {quantity for quantity, _ in LAWS} | set(COMBINATIONS)
    assert given == {one.name for one in ALL}


def test_no_quantity_is_told_twice():
    assert QUANTITIES.keys().isdisjoint(DERIVED_QUANTITIES)
    assert len({one.words for one in ALL}) == len(ALL)
    assert len({one.meaning for one in ALL}) == len(ALL)


@every_quantity
def test_a_name_ends_in_its_unit(one):
    _, suffix, _ = split_name(one.name)
    symbol = next(unit.symbol for _, unit in LADDERS[suffix] if unit.size == 1.0)
    assert one.unit == (symbol or "1")


@every_quantity
def test_quantities_of_a_kind_have_one_unit(one):
    same = {other.unit for other in ALL if other.kind == one.kind}
    assert same == ({"m", "px"} if one.kind == "fireball radius" else {one.unit})


def test_a_scene_file_may_name_a_law_for_everything_that_can_be_recorded():
    assert set(QUANTITIES) < set(KEYS["law"])


def test_groups_hold_what_they_are_called_after():
    assert CLOCK_TIMES == ("flash_time_s", "air_arrival_s", "ground_arrival_s")
    assert ARRIVALS == ("air_arrival_s", "ground_arrival_s")
    assert (*CLOCK_TIMES, "arrival_difference_s") == TIMES
    assert FIREBALL_RADII == ("fireball_radius_m", "fireball_radius_px")
    assert ("shock_radius_m", *FIREBALL_RADII) == TIMED
    assert PLACELESS == ("shock_radius_m", "fireball_radius_m")
    assert BY_CAMERA == ("fireball_radius_px",)
    assert {
        "bearing_rad": 2 * math.pi,
        "elevation_rad": math.pi / 2,
        "jolt_bearing_rad": 2 * math.pi,
        "jolt_elevation_rad": math.pi / 2,
    } == DIRECTIONS
    assert CIRCULAR == ("bearing_rad", "jolt_bearing_rad")
    assert (*TIMES, *DIRECTIONS) == ADDITIVE
    jolts = "jolt_velocity_m_s", "jolt_bearing_rad", "jolt_elevation_rad"
    assert jolts == BY_VEHICLE
    assert set(FEEL_WIND) - set(TIMES) == {
        "positive_impulse_pa_s",
        "positive_duration_s",
        "reflected_impulse_pa_s",
    }


def test_one_more_datum_has_the_error_of_its_kind():
    assert set(ADDABLE) == {
        *CLOCK_TIMES,
        "peak_overpressure_pa",
        "positive_impulse_pa_s",
    }
    for name, sigma in ADDABLE.items():
        assert sigma == (1e-3 if name in TIMES else 0.05)


def test_one_more_datum_is_called_by_its_article():
    said = [QUANTITIES[name].with_article() for name in ADDABLE]
    assert said[:3] == ["a flash time", "an air arrival", "a ground arrival"]
    assert said[3:] == ["a peak overpressure", "a positive impulse"]


def test_a_sum_is_made_of_quantities_with_a_law():
    assert components("peak_overpressure_pa") == (("peak_overpressure_pa", 1.0),)
    assert dict(components("arrival_difference_s")) == {
        "air_arrival_s": 1.0,
        "ground_arrival_s": -1.0,
    }
    assert made_with("ground_arrival_s") == ("ground_arrival_s", "arrival_difference_s")
    of_laws = {quantity for quantity, _ in LAWS}
    for name in QUANTITIES:
        assert {part for part, _ in components(name)} <= of_laws


@every_quantity
def test_impulses_and_durations_go_by_the_impulse_of_an_explosive(one):
    c4, nuclear = EXPLOSIVES["C4"], EXPLOSIVES["nuclear"]
    by_impulse = "impulse" in one.name or "duration" in one.name
    assert tnt_factor("C4", one.name) == (c4.impulse if by_impulse else c4.pressure)
    by_energy = one.name == "shock_radius_m"
    assert tnt_factor("nuclear", one.name) == (nuclear.energy if by_energy else 0.5)


@every_quantity
def test_words_are_those_of_the_table(one):
    assert quantity_words(one.name) == one.words
    assert quantity_named(one.name) is one


def test_what_the_table_does_not_know_is_called_by_its_name():
    assert quantity_named("echo_delay_s") is None
    assert quantity_words("echo_delay_s") == "echo delay"


def test_the_table_needs_no_jax():
    code = "import sys, jblast.quantities; sys.exit('jax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
