"""Points of designs: whatever part is asked for is a part of the same whole."""

from typing import Any

import numpy as np
from scipy.stats import norm, qmc

from jblast.study.draws import points_of

DRAWS, DIMENSIONS = 64, 3
POINTS: Any = points_of("sobol", DIMENSIONS, 5)


def test_parts_are_those_of_the_whole():
    whole = POINTS(0, DRAWS)
    assert whole.shape == (DRAWS, DIMENSIONS)
    parts = [POINTS(begin, 16) for begin in range(0, DRAWS, 16)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)


def test_random_draws_are_left_to_keys():
    assert points_of("random", DIMENSIONS, 5) is None


def test_each_number_is_spread_evenly_over_what_its_prior_allows():
    # in each quarter of each number a quarter of the draws: none is left to chance
    for column in norm.cdf(POINTS(0, DRAWS)).T:
        assert np.histogram(column, 4, (0, 1))[0].tolist() == [DRAWS // 4] * 4


def test_sobol_points_are_scipys():
    engine = qmc.Sobol(DIMENSIONS, scramble=True, bits=32, rng=5)
    np.testing.assert_allclose(norm.cdf(POINTS(0, DRAWS)), engine.random(DRAWS))
