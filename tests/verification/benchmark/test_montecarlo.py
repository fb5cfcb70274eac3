import numpy as np
import pytest

from jblast.verification.benchmark import fits
from jblast.verification.benchmark.chart import BENCHMARKS, panels
from jblast.verification.benchmark.fits import (
    mean_pressure,
    probability_above,
)


def test_the_known_answers_are_those_of_many_draws():
    drawn = fits.pressures(fits.random_scores(200_000, 3, 7))
    error = drawn.std() / np.sqrt(drawn.size)
    assert mean_pressure() == pytest.approx(drawn.mean(), abs=4 * error)
    share = np.mean(drawn > fits.COMMON_PA)
    error = np.sqrt(share / drawn.size)
    assert probability_above(fits.COMMON_PA) == pytest.approx(share, abs=4 * error)


def test_every_way_is_measured():
    points = fits.montecarlo_points((1024,), 4)
    assert BENCHMARKS["montecarlo"].measure is fits.montecarlo_points
    assert len(panels(points)) == 2
