"""Points of designs: whatever part is asked for is a part of the same whole."""

import numpy as np
import pytest
from scipy.stats import norm, qmc

from jblast.errors import InputError
from jblast.study.sampling.draws import points_of

DRAWS, DIMENSIONS = 64, 3


def points_by(design):
    points = points_of(design, DIMENSIONS, DRAWS, 5, "study.toml")
    assert points is not None
    return points


@pytest.mark.parametrize("design", ["sobol", "latin", "grid"])
def test_parts_are_those_of_the_whole(design):
    points = points_by(design)
    whole = points(0, DRAWS)
    assert whole.shape == (DRAWS, DIMENSIONS)
    parts = [points(begin, 16) for begin in range(0, DRAWS, 16)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)


def test_random_draws_are_left_to_keys():
    assert points_of("random", DIMENSIONS, DRAWS, 5, "study.toml") is None


@pytest.mark.parametrize("design", ["sobol", "latin", "grid"])
def test_each_number_is_spread_evenly_over_what_its_prior_allows(design):
    unit = norm.cdf(points_by(design)(0, DRAWS))
    # in each quarter of each number a quarter of the draws: none is left to chance
    for column in unit.T:
        assert np.histogram(column, 4, (0, 1))[0].tolist() == [DRAWS // 4] * 4


def test_sobol_points_are_scipys():
    points = points_by("sobol")
    engine = qmc.Sobol(DIMENSIONS, scramble=True, bits=32, rng=5)
    np.testing.assert_allclose(norm.cdf(points(0, DRAWS)), engine.random(DRAWS))


def test_a_grid_of_no_whole_number_of_parts_is_refused_with_the_nearest():
    with pytest.raises(InputError, match=r"samples: expected .* as 27 or 64 or 125"):
        points_of("grid", DIMENSIONS, 65, 5, "study.toml")
