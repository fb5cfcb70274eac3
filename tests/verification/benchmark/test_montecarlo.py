import numpy as np
import pytest

from jblast.verification.benchmark import fits
from jblast.verification.benchmark.chart import BENCHMARKS, panels
from jblast.verification.sampling_cases import (
    CASE,
    mean_pressure,
    probability_above,
)


def test_the_known_answers_are_those_of_many_draws():
    drawn = fits.pressures(fits.random_scores_of(200_000, 3, 7))
    error = drawn.std() / np.sqrt(drawn.size)
    assert mean_pressure() == pytest.approx(drawn.mean(), abs=4 * error)
    share = np.mean(drawn > fits.COMMON_PA)
    error = np.sqrt(share / drawn.size)
    assert probability_above(fits.COMMON_PA) == pytest.approx(share, abs=4 * error)


def test_every_way_is_measured_and_importance_wins_where_it_is_rare():
    points = fits.montecarlo_points((1024,), (4096,), 4)
    assert BENCHMARKS["montecarlo"].measure is fits.montecarlo_points
    parts = panels(points)
    assert len(parts) == 3
    rare = {p.method: p for p in parts[f"probability of {rare_probability():.2g}"]}
    # 4096 plain draws meet nothing: the estimate is zero, the error whole
    assert rare["plain 4k"].error == pytest.approx(1.0)
    assert rare["importance 1k"].error < 0.3


def rare_probability():
    return probability_above(CASE.threshold_pa)
