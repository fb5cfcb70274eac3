"""The table of quantities is whole, and agrees with laws, readers and reports."""

import pytest

import jblast.waves as _waves  # noqa: F401  laws enter the registry
from jblast.quantities import (
    DERIVED_QUANTITIES,
    QUANTITIES,
    UNITS,
    components,
    made_with,
)
from jblast.registry import LAWS
from jblast.report.numbers import split_name
from jblast.scene.charge import EXPLOSIVES, tnt_factor
from jblast.sensors.calculator import COMBINATIONS

ALL = [*QUANTITIES.values(), *DERIVED_QUANTITIES.values()]

every_quantity = pytest.mark.parametrize("one", ALL, ids=lambda one: one.name)


def test_every_quantity_that_a_law_gives_is_in_the_table_and_the_other_way_round():
    given = {quantity for quantity, _ in LAWS} | set(COMBINATIONS)
    assert given == {one.name for one in ALL}


@every_quantity
def test_a_name_ends_in_its_unit(one):
    _, suffix, _ = split_name(one.name)
    assert one.unit == (UNITS[suffix] or "1")


@every_quantity
def test_quantities_of_a_kind_have_one_unit(one):
    same = {other.unit for other in ALL if other.kind == one.kind}
    assert same == ({"m", "px"} if one.kind == "fireball radius" else {one.unit})


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
