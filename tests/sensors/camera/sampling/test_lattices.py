import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies

from jblast.errors import InputError
from jblast.sensors.camera.bake.recipe import (
    GOLDEN_ANGLE,
    MAX_DIRECTIONS,
    azimuth_elevation,
    fibonacci_lattice,
    latitude_grid,
    offset_lattice,
    spiral_lattice,
)

LATTICES = (fibonacci_lattice, offset_lattice, spiral_lattice, latitude_grid)
each_lattice = pytest.mark.parametrize("lattice", LATTICES)


@each_lattice
@settings(deadline=None, max_examples=12)
@given(number=strategies.integers(1, 60))
def test_a_lattice_has_so_many_unit_vectors_none_below_the_horizon(lattice, number):
    direction = lattice(number)
    assert direction.shape == (number, 3)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1.0, atol=1e-12)
    assert (direction[:, 2] >= 0.0).all()


@each_lattice
@settings(deadline=None, max_examples=12)
@given(number=strategies.integers(2, 60))
def test_no_two_directions_are_the_same(lattice, number):
    direction = lattice(number)
    apart = np.linalg.norm(direction[:, None] - direction, axis=-1)
    assert apart[~np.eye(number, dtype=bool)].min() > 1e-3


def test_heights_of_the_plain_lattice_divide_the_hemisphere_into_equal_areas():
    """The area above a height is 2 pi (1 - z)."""
    height = fibonacci_lattice(50)[:, 2]
    np.testing.assert_allclose(height, 1.0 - (np.arange(50) + 0.5) / 50, atol=1e-12)


def test_the_plain_lattice_is_vogels_golden_spiral_seen_at_equal_areas():
    direction = fibonacci_lattice(30)
    index = np.arange(30)
    radius = np.sqrt(1.0 - direction[:, 2])
    np.testing.assert_allclose(radius, np.sqrt((index + 0.5) / 30), atol=1e-12)
    around = np.arctan2(direction[:, 0], direction[:, 1])
    turned = (around - index * GOLDEN_ANGLE) / (2 * math.pi)
    np.testing.assert_allclose(turned, np.rint(turned), atol=1e-9)


def test_the_golden_angle_divides_a_turn_in_the_golden_section():
    whole, rest = 2 * math.pi, 2 * math.pi - GOLDEN_ANGLE
    assert whole / rest == pytest.approx(rest / GOLDEN_ANGLE, rel=1e-12)


def test_the_plain_lattice_is_the_upper_half_of_that_of_the_sphere():
    """Gonzalez: of 2n points the heights are 1 - (2i + 1) / 2n, the azimuths golden."""
    of_sphere = 1.0 - (2 * np.arange(40) + 1) / 40
    np.testing.assert_allclose(
        fibonacci_lattice(20)[:, 2], of_sphere[:20], rtol=0, atol=1e-12
    )


def test_an_offset_of_zero_begins_at_the_pole_and_more_leads_away():
    np.testing.assert_allclose(fibonacci_lattice(9, 0.0)[0], [0, 0, 1], atol=1e-12)
    highest = [fibonacci_lattice(9, offset)[0, 2] for offset in (0.0, 0.5, 1.0, 2.0)]
    assert highest == sorted(highest, reverse=True)


def test_turns_of_the_spiral_stand_as_far_apart_as_points_along_it():
    """Near the horizon: a turn is 2 pi / sqrt(2 n pi) down; a step as far along."""
    number = 2000
    azimuth, elevation = azimuth_elevation(spiral_lattice(number))
    turn = 2 * math.pi / math.sqrt(2 * math.pi * number)
    step = math.radians((azimuth[-1] - azimuth[-2]) % 360.0)
    step = math.hypot(step, math.radians(elevation[-1] - elevation[-2]))
    assert step == pytest.approx(turn, rel=0.01)  # the sphere's curve over one turn


def test_rings_of_the_grid_have_as_many_azimuths_or_one_less():
    _, elevation = azimuth_elevation(latitude_grid(37))
    rings, members = np.unique(np.round(elevation, 9), return_counts=True)
    np.testing.assert_allclose(rings, [15.0, 45.0, 75.0], atol=1e-6)
    assert set(members) == {12, 13}


def test_azimuth_is_clockwise_from_north():
    direction = np.array([[0.0, 1, 0], [1, 0, 0], [0, -1, 0], [-1, 0, 0], [0, 0, 1]])
    azimuth, elevation = azimuth_elevation(direction)
    np.testing.assert_allclose(azimuth[:4], [0, 90, 180, 270])
    np.testing.assert_allclose(elevation, [0, 0, 0, 0, 90])


@each_lattice
@pytest.mark.parametrize("number", [0, -3, MAX_DIRECTIONS + 1])
def test_a_number_that_cannot_be_is_refused(lattice, number):
    with pytest.raises(InputError, match="number: expected 1 to"):
        lattice(number)


@pytest.mark.parametrize("offset", [-0.1, math.nan, math.inf])
def test_an_offset_that_cannot_be_is_refused(offset):
    with pytest.raises(InputError, match="offset: expected 0 or more"):
        fibonacci_lattice(8, offset)
