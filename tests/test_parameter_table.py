"""The table of scene numbers is whole, and agrees with itself and with the scene."""

import pytest

from jblast.parameters import (
    CLOCK,
    CLOCK_OFFSET,
    DERIVED_NUMBERS,
    PARAMETERS,
    described,
)
from jblast.quantities import UNITS
from jblast.report.numbers import parameter_words, split_name
from jblast.scene import Scene, parameter_named, value_of
from jblast.scene.keys import KEYS
from jblast.scene.uncertain import names_in

ALL = (*PARAMETERS.values(), CLOCK)
every_parameter = pytest.mark.parametrize("one", ALL, ids=lambda one: one.name)


def test_every_row_is_a_key_of_a_scene_file():
    rows = [row for table in KEYS.values() for key in table for row in key.rows]
    assert {row.name for row in rows} == {row.name for row in ALL}


def test_every_number_of_a_scene_is_in_the_table_and_the_other_way_round():
    scene = Scene()
    assert names_in(scene) == tuple(PARAMETERS)
    for name, one in PARAMETERS.items():
        value = value_of(scene, name)
        assert value is None or value == one.default


@every_parameter
def test_a_fit_starts_within_the_bounds(one):
    assert one.bounds.allows(one.default)


@every_parameter
def test_what_is_fitted_in_ln_is_positive_and_the_rest_may_be_zero(one):
    assert one.positive == (max(one.bounds.above, one.bounds.at_least) >= 0)
    assert one.spread.amount > (1 if one.positive else 0)


@pytest.mark.parametrize(
    "one", [*ALL, *DERIVED_NUMBERS.values()], ids=lambda one: one.name
)
def test_a_name_ends_in_its_unit(one):
    _, suffix, _ = split_name(one.name)
    assert one.unit == (UNITS[suffix] or "1")


def test_numbers_are_found_by_the_names_they_have_beside_others():
    assert described("charge_mass_kg.east") is PARAMETERS["charge_mass_kg"]
    assert (
        described(f"{CLOCK_OFFSET}.b") is parameter_named(f"{CLOCK_OFFSET}.b") is CLOCK
    )
    assert described("charge_energy_j") is DERIVED_NUMBERS["charge_energy_j"]
    assert described("charge_mass") is None
    assert parameter_words("clock_offset_s.b") == "clock offset of b"
    with pytest.raises(KeyError):
        parameter_named("charge_mass")
