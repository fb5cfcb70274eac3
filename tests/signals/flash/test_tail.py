"""Tails: what is drawn from one gives it back."""

from pathlib import Path

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.signals.flash.search import MEASURED, Tail, fitted_tail, flash_threshold


def test_an_exponential_tail_is_found():
    rng = np.random.default_rng(1)
    values = rng.exponential(0.7, 40_000)
    tail = fitted_tail(values, 0.3)
    # 2,000 of the tail: 2 % of the scale; a shape of noise is up to 3 sigma, 0.07
    assert tail.scale / (1 - tail.shape) == pytest.approx(0.7, rel=0.07)
    assert tail.shape < 0.07
    # one in 10,000, seen directly
    hours = 40_000 * 0.3 / 3600
    assert tail.threshold(4 / hours) == pytest.approx(np.sort(values)[-4], rel=0.15)


def test_a_heavy_tail_is_not_taken_for_an_exponential_one():
    rng = np.random.default_rng(2)
    values = (rng.random(40_000) ** -0.4 - 1) / 0.4
    tail = fitted_tail(values, 0.3)
    assert tail.shape == pytest.approx(0.4, abs=0.12)  # 3 standard errors


@pytest.mark.parametrize("shape", [0.0, 0.2])
def test_a_threshold_and_its_false_alarms_are_inverse(shape):
    tail = Tail(0.5, 0.6, shape, 600.0, 1000, 1.0)
    for rate in (0.01, 1.0, 500.0):
        assert tail.false_alarms(tail.threshold(rate)) == pytest.approx(rate)
    assert tail.threshold(1e4) == 0.5  # more than the tail knows of


def test_no_threshold_for_less_than_was_seen_lies_below_the_greatest():
    tail = Tail(0.5, 0.6, 0.0, 600.0, 1000, 0.1, greatest=9.0)
    assert tail.threshold(1.0) == pytest.approx(9.0 + 0.6 * np.log(10.0))
    assert tail.threshold(100.0) == pytest.approx(0.5 + 0.6 * np.log(6.0))
    assert tail.false_alarms(9.6) == pytest.approx(10.0 / np.e)


def test_the_tail_in_use_is_the_one_that_was_measured():
    kept = Path("calibration/results/visual_detector.txt").read_text()
    row = next(line for line in kept.splitlines() if line.startswith("growth (CUSUM)"))
    told = [float(word) for word in row.split()[2:]]
    one = (MEASURED.level, MEASURED.scale, MEASURED.shape, MEASURED.per_hour)
    assert told == pytest.approx([*one, MEASURED.greatest], rel=1e-3)


def test_fewer_false_alarms_want_a_higher_threshold():
    assert flash_threshold(0.1) > flash_threshold(1.0) > flash_threshold(10.0)
    assert MEASURED.false_alarms(flash_threshold(1.0)) == pytest.approx(1.0)
    with pytest.raises(InputError, match="false_alarms_per_hour"):
        flash_threshold(0.0)


def test_values_that_are_all_alike_have_a_tail():
    tail = fitted_tail(np.zeros(100), 0.3)
    assert np.isfinite(tail.threshold(1.0))
