import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies

from jblast.errors import InputError
from jblast.sensors.camera.bake.recipe import (
    OFFSETS,
    best_offset,
    fibonacci_lattice,
    hemisphere_bound,
    latitude_grid,
    offset_lattice,
    packing_distance,
    sphere_bound,
    spiral_lattice,
)

TAU = (1 + math.sqrt(5)) / 2
AXES = np.concatenate([np.eye(3), -np.eye(3)])
TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / 3**0.5
ICOSAHEDRON = np.array(
    [
        np.roll([0.0, a, b * TAU], shift)
        for shift in range(3)
        for a in (1, -1)
        for b in (1, -1)
    ]
) / math.sqrt(1 + TAU**2)


@pytest.mark.parametrize(
    ("solid", "degrees"),
    [(AXES, 90.0), (TETRAHEDRON, 109.4712206), (ICOSAHEDRON, 63.4349488)],
)
def test_a_regular_solid_packs_as_its_edges_say_and_reaches_the_bound(solid, degrees):
    distance = packing_distance(solid)
    assert math.degrees(distance) == pytest.approx(degrees, abs=1e-6)  # digits
    assert distance == pytest.approx(sphere_bound(len(solid)), rel=1e-12)


def test_small_angles_are_told_where_their_cosine_rounds():
    near = np.array([[0.0, 0.0, 1.0], [0.0, 1e-9, 1.0]])
    assert packing_distance(near) == pytest.approx(1e-9, rel=1e-6)


@given(number=strategies.integers(2, 40), turn=strategies.floats(0.0, 6.3))
def test_turning_all_directions_keeps_the_packing(number, turn):
    direction = fibonacci_lattice(number)
    c, s = math.cos(turn), math.sin(turn)
    turned = direction @ np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
    assert packing_distance(turned) == pytest.approx(
        packing_distance(direction), rel=1e-9
    )


@pytest.mark.parametrize("number", [8, 32, 100])
def test_offset_lattices_pack_better_than_plain_ones_and_grids_worse(number):
    plain = packing_distance(fibonacci_lattice(number))
    assert packing_distance(offset_lattice(number)) > 1.01 * plain
    assert packing_distance(latitude_grid(number)) < plain
    assert packing_distance(spiral_lattice(number)) == pytest.approx(plain, rel=0.05)


@settings(deadline=None, max_examples=12)
@given(number=strategies.integers(2, 60))
def test_no_lattice_packs_better_than_the_bound_of_the_hemisphere(number):
    for lattice in (fibonacci_lattice, offset_lattice, spiral_lattice):
        assert packing_distance(lattice(number)) <= hemisphere_bound(number) + 1e-9


def test_the_best_offset_is_no_worse_than_any_that_was_tried():
    best = packing_distance(fibonacci_lattice(24, best_offset(24)))
    for offset in OFFSETS[::10]:
        assert packing_distance(fibonacci_lattice(24, float(offset))) <= best


def test_two_points_of_the_hemisphere_are_at_most_opposite():
    assert hemisphere_bound(2) == pytest.approx(math.pi, abs=1e-9)


def test_bounds_of_many_points_fall_as_one_over_the_root_of_their_number():
    assert sphere_bound(4096) == pytest.approx(2 * sphere_bound(4 * 4096), rel=1e-3)
    ratio = hemisphere_bound(1 << 16) / hemisphere_bound(1 << 18)
    assert ratio == pytest.approx(2.0, rel=5e-3)  # of what sticks out below


def test_fewer_directions_than_a_pair_have_no_distance():
    with pytest.raises(InputError, match="expected two or more, got 1"):
        packing_distance(fibonacci_lattice(1))
    assert offset_lattice(1).shape == (1, 3)
    with pytest.raises(InputError, match="three or more"):
        sphere_bound(2)
