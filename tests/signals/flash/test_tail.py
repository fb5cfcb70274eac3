"""Thresholds by the tail of the largest statistics without a blast."""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import genpareto

from jblast.errors import InputError
from jblast.signals.flash.search import MEASURED, Tail, flash_threshold


@pytest.mark.parametrize("shape", [0.0, 0.2])
def test_a_threshold_is_the_quantile_of_the_tail(shape):
    tail = Tail(0.5, 0.6, shape, 600.0, 1000, 1000.0)
    for rate in (0.01, 1.0, 500.0):
        excess = genpareto(shape, scale=0.6).isf(rate / 600.0)
        assert tail.threshold(rate) == pytest.approx(0.5 + excess)
    assert tail.threshold(1e4) == 0.5  # more than the tail knows of


def test_no_threshold_for_less_than_was_seen_lies_below_the_greatest():
    tail = Tail(0.5, 0.6, 0.0, 600.0, 1000, 0.1, greatest=9.0)
    assert tail.threshold(1.0) == pytest.approx(9.0 + 0.6 * np.log(10.0))
    assert tail.threshold(100.0) == pytest.approx(0.5 + 0.6 * np.log(6.0))


def test_the_tail_in_use_is_the_one_that_was_measured():
    kept = Path("calibration/results/visual_detector.txt").read_text()
    row = next(line for line in kept.splitlines() if line.startswith("growth (CUSUM)"))
    told = [float(word) for word in row.split()[2:]]
    one = (MEASURED.level, MEASURED.scale, MEASURED.shape, MEASURED.per_hour)
    assert told == pytest.approx([*one, MEASURED.greatest], rel=1e-3)


def test_fewer_false_alarms_want_a_higher_threshold():
    assert flash_threshold(0.1) > flash_threshold(1.0) > flash_threshold(10.0)
    with pytest.raises(InputError, match="false_alarms_per_hour"):
        flash_threshold(0.0)
