"""The thesis's custom profiles: their files, and what they give to a flight."""

import dataclasses
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.vehicle import named
from jblast.vehicle.loads.impulse_table import (
    COLUMNS as LIMITS,
    custom_profile,
    read_custom_profile,
)
from tests.vehicle.flights import at_hover

COLUMNS = tuple(LIMITS)
# delay, distance, polar and azimuthal angle: seen towards (-1, -1, -1) and along x
ASIDE = float(np.degrees(np.arccos(-1 / np.sqrt(3))))
ROWS = [
    [0.015, 8.66, ASIDE, -135.0, 0.09, 0.10, 0.21, -0.001, -21.0, 10.0],
    [0.030, 17.32, ASIDE, -135.0, 0.03, 0.03, 0.06, -0.0003, -6.0, 3.0],
]


def written(path: Path, rows, columns=COLUMNS) -> Path:
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def cases(tmp_path):
    return read_custom_profile(written(tmp_path / "cases.csv", ROWS))


def test_columns_come_in_any_order_and_others_are_not_read(tmp_path):
    order = [3, 0, 9, 1, 2, 4, 5, 6, 7, 8]
    columns = ["Case Number", *(COLUMNS[n].lower().replace(" ", "") for n in order)]
    rows = [[case, *(row[n] for n in order)] for case, row in enumerate(ROWS)]
    found = read_custom_profile(written(tmp_path / "a.csv", rows, columns))
    expected = read_custom_profile(written(tmp_path / "b.csv", ROWS))
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_allclose(np.degrees(found[:, 2:4]), [[ASIDE, -135.0]] * 2)


HEADER = ",".join(COLUMNS)
REFUSED = [
    ("", "expected the columns .* got an empty file"),
    (HEADER, "expected one case per row, got only a header"),
    (",".join(COLUMNS[:8]), r"line 1: expected the columns Mm \(N.*, Mn \(N\*m\*s\)"),
    (
        HEADER.replace("(s)", "(ms)", 1),
        r"line 1: expected the columns Time Delay \(s\)",
    ),
    (HEADER + "\n1,2,3", "line 2: expected 10 fields"),
    (HEADER + "\n\n1,2,3,4,5,nan,7,8,9,10", r"line 3, column FS .*inf, got 'nan'"),
    (HEADER + "\n1,2,3,4,5,,7,8,9,10", "line 2, column FS .* to inf, got nothing"),
    (
        HEADER + "\n0.1,0,3,4,5,6,7,8,9,10",
        "column Distance .* from 0.001 to inf, got '0'",
    ),
    (
        HEADER + "\n0.1,1,190,4,5,6,7,8,9,10",
        "line 2, column View Polar .* from 0 to 180",
    ),
    (
        HEADER + 2 * "\n0.1,1,90,4,5,6,7,8,9,10",
        "line 3: expected a new distance or direction, got that of an earlier line",
    ),
]


@pytest.mark.parametrize(("text", "message"), REFUSED)
def test_files_that_cannot_be_used_are_refused(tmp_path, text, message):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_custom_profile(path)


CRAZYFLIE = named("crazyflie")
UPRIGHT = jnp.array([0.0, 0.0, 0.0, 1.0])


def away(distance) -> np.ndarray:
    """A place that sees a charge at the origin towards (-1, -1, -1)."""
    return np.full(3, distance / np.sqrt(3))


@pytest.mark.parametrize("row", [0, 1])
def test_at_a_case_the_pulse_is_that_case(cases, row):
    profile = custom_profile(cases)
    place = jnp.asarray(away(ROWS[row][1]))
    push, turn, delay = profile.impulse_at(place, UPRIGHT)
    np.testing.assert_allclose(push, ROWS[row][4:7], rtol=1e-9)
    np.testing.assert_allclose(turn, ROWS[row][7:], rtol=1e-9)
    np.testing.assert_allclose(delay, ROWS[row][0], rtol=1e-9)
    assert profile.in_range(place, UPRIGHT)


def test_past_the_cases_the_impulse_falls_with_the_square_and_is_marked(cases):
    profile = custom_profile(cases)
    place = jnp.asarray(away(2 * 17.32))
    push, _, delay = profile.impulse_at(place, UPRIGHT)
    np.testing.assert_allclose(push, np.array(ROWS[1][4:7]) / 4, rtol=1e-9)
    np.testing.assert_allclose(delay, 0.06, rtol=1e-9)
    assert not profile.in_range(place, UPRIGHT)
    assert not profile.in_range(jnp.array([10.0, 0.0, 0.0]), UPRIGHT)


def test_directions_are_the_body_s_and_impulses_turn_with_it(cases):
    """A quarter turn to the left: what lay at -135 degrees lies at 135."""
    profile = custom_profile(cases)
    half = np.sqrt(0.5)
    turned = jnp.array([0.0, 0.0, half, half])
    place = away(8.66) * np.array([-1.0, 1.0, 1.0])
    assert profile.in_range(jnp.asarray(place), turned)
    state = dataclasses.replace(at_hover(CRAZYFLIE, place), quaternion=turned)
    push, _ = profile.impulse(jnp.asarray(0.0), jnp.asarray(1.0), state, CRAZYFLIE)
    x, y, z = ROWS[0][4:7]
    np.testing.assert_allclose(push, [-y, x, z], rtol=1e-9)


def test_moments_of_a_far_point_are_taken_about_the_vehicle(cases):
    """The lever of 100 m leaves what a vehicle feels: millinewton metre seconds."""
    arm = (100.0, 0.0, 0.0)
    profile = custom_profile(cases, moment_point_m=arm)
    place = jnp.asarray(away(8.66))
    _, turn, _ = profile.impulse_at(place, UPRIGHT)
    expected = np.array(ROWS[0][7:]) - np.cross(arm, ROWS[0][4:7])
    np.testing.assert_allclose(turn, expected, atol=1e-9)


def test_moments_about_a_far_point_are_refused_unless_it_is_named(cases):
    """The sample's lever is 21/0.25 m; a Crazyflie's rotors are 4.3 cm away."""
    with pytest.raises(InputError) as caught:
        custom_profile(cases, vehicle=CRAZYFLIE)
    turn, push = (np.linalg.norm(ROWS[0][a:b]) for a, b in ((7, 10), (4, 7)))
    said = str(caught.value)
    assert (
        "case 1 of 2: expected a lever (moment over impulse) of at most 0.13 m" in said
    )
    assert "about another point moment_point_m" in said
    assert said.endswith(f"got one of {turn / push:.3g} m")
    for point in ((100.0, 0.0, 0.0), (0.0, 0.0, 0.0)):
        custom_profile(cases, vehicle=CRAZYFLIE, moment_point_m=point)
    own = cases.copy()
    own[:, 7:] = np.cross([0.0, 0.0, 0.05], own[:, 4:7])
    custom_profile(own, vehicle=CRAZYFLIE)
    own[:, 4:7] = 0.0  # a moment without an impulse has no lever
    with pytest.raises(InputError, match="got one of inf m"):
        custom_profile(own, vehicle=CRAZYFLIE)
