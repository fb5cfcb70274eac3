"""Directions by hand, and where there is none."""

import math

import jax
import numpy as np
import pytest

from jblast.waves import bearing, elevation
from jblast.waves.laws.line_of_sight import line_of_sight_valid


@pytest.mark.parametrize(
    ("east", "north", "degrees"),
    [(0, 1, 0), (1, 1, 45), (2, 0, 90), (0, -1, 180), (-3, 0, 270), (-1, 1, 315)],
)
def test_a_bearing_goes_clockwise_from_north(east, north, degrees):
    angle = math.degrees(bearing(float(east), float(north)))
    assert angle == pytest.approx(degrees, abs=1e-12)


def test_an_elevation_is_from_the_horizon():
    assert math.degrees(elevation(3.0, 4.0, 5.0)) == pytest.approx(45.0)
    assert math.degrees(elevation(3.0, -4.0, -5.0)) == pytest.approx(-45.0)
    assert math.degrees(elevation(0.0, 0.0, 2.0)) == pytest.approx(90.0)


@pytest.mark.parametrize("toward", [(0.0, 0.0, 0.0), (0.0, 0.0, 10.0)])
def test_overhead_all_is_finite_and_marked(toward):
    assert not line_of_sight_valid(*toward[:2])
    for function, given in ((bearing, toward[:2]), (elevation, toward)):
        value, slope = jax.value_and_grad(function, range(len(given)))(*given)
        assert np.isfinite([value, *slope]).all()
