"""Regions of draws: only where an ellipse misleads, and what they hold then."""

import numpy as np
import pytest
from matplotlib.path import Path

from jblast.inference.fitting.place import credible_regions

COUNT = 8000


def normal(rng):
    return rng.multivariate_normal([400.0, -3.0], [[9.0, 4.0], [4.0, 3.0]], COUNT)


def picked_again(rng):
    """As weighted draws are: a thousand places, many of them several times."""
    return normal(rng)[rng.integers(0, 1000, COUNT)]


def bent(rng):
    turn, radius = rng.normal(0.0, 0.9, COUNT), rng.normal(100.0, 3.0, COUNT)
    return np.stack([radius * np.sin(turn), radius * np.cos(turn)], axis=-1)


def ring(rng):
    turn, radius = rng.uniform(0.0, 2 * np.pi, COUNT), rng.normal(100.0, 3.0, COUNT)
    return np.stack([radius * np.sin(turn), radius * np.cos(turn)], axis=-1)


def two_places(rng):
    heap = rng.random(COUNT) < 0.4
    return rng.normal(0.0, 2.0, (COUNT, 2)) + 50.0 * heap[:, None]


def heavy_tails(rng):
    """Student's t of two variates, 4 degrees of freedom: ellipses, but not normal."""
    scale = np.sqrt(rng.chisquare(4, (COUNT, 1)) / 4)
    return rng.standard_normal((COUNT, 2)) * [3.0, 1.0] / scale


@pytest.mark.parametrize("draw", [normal, picked_again, heavy_tails])
def test_draws_that_fill_their_ellipse_need_no_more(draw):
    for seed in range(5):
        assert credible_regions(*draw(np.random.default_rng(seed)).T) == ()


@pytest.mark.parametrize("share", [0.5, 0.9])
@pytest.mark.parametrize(
    ("draw", "parts", "holes"), [(bent, 1, 0), (ring, 1, 1), (two_places, 2, 0)]
)
def test_a_region_holds_its_share(draw, share, parts, holes):
    draws = draw(np.random.default_rng(1))
    (found,) = credible_regions(draws[:, 0], draws[:, 1], [share])
    held = np.zeros(COUNT, bool)
    for outer, inner in found.parts:
        held |= Path(outer).contains_points(draws)
        for hole in inner:
            held &= ~Path(hole).contains_points(draws)
    # the outline runs straight between grid points, thinner than the curve is wide
    assert held.mean() == pytest.approx(share, abs=0.04)
    if share == 0.9:
        large = [part for part in found.parts if abs(area(part[0])) > 5.0]
        assert (len(large), len(large[0][1])) == (parts, holes)


def area(ring):
    x, y = (ring - ring[0]).T
    return 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))


def test_outlines_run_anticlockwise_and_holes_clockwise():
    small, large = credible_regions(*ring(np.random.default_rng(2)).T)
    for outer, holes in (*small.parts, *large.parts):
        assert area(outer) > 0.0
        assert all(area(hole) < 0.0 for hole in holes)


def test_a_place_known_along_one_direction_has_no_region():
    east = np.random.default_rng(3).uniform(0.0, 1.0, 500)
    assert credible_regions(east, np.zeros(500)) == ()
