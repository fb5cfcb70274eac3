"""Friedlander pulses as textbooks have them: a sharp front, nothing behind the end."""

from itertools import product

import numpy as np
import pytest

from jblast.signals.picks import pick
from tests.signals.picks.simulated import SAMPLES

pytestmark = pytest.mark.slow  # twenty-four records; test_pick.py has one of them

PEAK, ARRIVAL = 5e3, 300.37
CASES = list(product((30.0, 130.0), (0.2, 1.0, 2.0, 4.0), (30.0, 300.0, 3000.0)))
"""Durations [samples], decays, peaks over the noise."""
NAMES = "air_arrival_s", "peak_overpressure_pa", "positive_duration_s"
FARTHEST = 3.5
"""Standard deviations: once in 2000 values, of which there are a hundred."""


@pytest.fixture(scope="module")
def found():
    """Return picks of samples taken at instants, not means over a sample."""
    rng = np.random.default_rng(4)
    since = np.arange(SAMPLES) - ARRIVAL
    made = []
    for duration, decay, snr in CASES:
        s = since / duration
        pulse = (1 - s) * np.exp(-decay * s) * (s >= 0) * (s <= 1)
        made.append(PEAK * (pulse + rng.standard_normal(SAMPLES) / snr))
    return pick(np.arange(SAMPLES, dtype=float), np.array(made))


def truth():
    """Return arrival, peak, duration and impulse of each."""
    duration, b, _ = np.array(CASES).T
    share = (b - 1.0 + np.exp(-b)) / b**2
    same = np.ones_like(b)
    return np.array([ARRIVAL * same, PEAK * same, duration, PEAK * duration * share])


def told(found):
    """Return which stand in a log."""
    lost = found.high_passed | found.curving | found.cut_short
    return np.asarray(found.found & found.converged & ~lost)


def test_most_of_them_are_told(found):
    assert told(found).mean() > 0.7


@pytest.mark.parametrize("at", range(4))
def test_what_is_told_is_within_its_errors(found, at):
    name = (*NAMES, "positive_impulse_pa_s")[at]
    value, expected = np.asarray(getattr(found, name)), truth()[at]
    off = value - expected if at == 0 else np.log(value / expected)
    z = (off / np.asarray(found.spread[:, at]))[told(found)]
    assert np.abs(z).max() < FARTHEST


def test_there_is_no_suction_where_there_is_none(found):
    depth = np.asarray(found.negative_pressure_pa)
    z = depth / np.asarray(found.sd("negative_pressure_pa"))
    some = told(found) & (np.array(CASES)[:, 2] > 100)
    # the prior has a suction, of one and a half standard deviations
    assert np.median(np.abs(z[some])) < 2.0
    assert np.abs(depth[some]).max() < 0.05 * PEAK
