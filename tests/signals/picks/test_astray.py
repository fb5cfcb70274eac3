"""Where a search may end astray, and errors must say so: faint fronts, sharp ones."""

import numpy as np
import pytest
from scipy.signal import lfilter

from jblast.signals.picks import pick
from tests.signals.picks.simulated import RATE, SAMPLES, TIME, Truth, samples_of

FAINT = Truth(rise=3e-5, duration=2.5e-3)
MEMORY = 0.75
"""Of the noise: an autoregression of first order."""


def under_slow_noise(truth, snr, seeds):
    """Return records, one a seed."""
    found = []
    for seed in seeds:
        white = np.random.default_rng(seed).standard_normal(SAMPLES + 400)
        slow = lfilter([np.sqrt(1.0 - MEMORY**2)], [1.0, -MEMORY], white)
        found.append(samples_of(truth) + truth.peak / snr * np.asarray(slow)[400:])
    return np.array(found)


@pytest.mark.slow  # a second program of picks
def test_a_faint_front_is_not_taken_for_a_step_of_noise_before_it():
    # seeds whose noise steps up 10 to 20 samples before the front: searched for from
    # there alone, the arrival was 11 to 22 samples early, by 2 to 7 of its errors
    found = pick(TIME, under_slow_noise(FAINT, 6.0, (7, 30, 87, 112)))
    off = np.asarray(found.air_arrival_s) - FAINT.arrival
    assert np.all(np.abs(off) * RATE < 8.0)
    assert np.all(np.abs(off) < 3.0 * np.asarray(found.spread)[:, 0])


@pytest.mark.slow  # as above
def test_a_front_of_two_samples_is_not_taken_for_a_sharp_one_that_rings():
    # places in a sample at which a search from a rise of half a sample ended there, 0.4
    # to 0.7 samples early by 14 to 55 errors, with a ring that is none
    rng = np.random.default_rng(3)
    truths, records = [], []
    for rise, place in ((2.3, 0.625), (2.3, 0.75), (2.3, 0.875), (3.1, 0.375)):
        truth = Truth(
            rise=rise / RATE,
            arrival=(300.0 + place) / RATE,
            duration=2.2e-3,
            suction_duration=4.4e-3,
            suction=9e3,
            decay=0.5,
        )
        noise = truth.peak / 184.0 * rng.standard_normal(SAMPLES)
        truths.append(truth)
        records.append(samples_of(truth) + noise)
    found = pick(TIME, np.array(records))
    off = np.asarray(found.air_arrival_s) - np.array([t.arrival for t in truths])
    assert not np.any(found.resonating)
    assert np.all(np.abs(off) * RATE < 0.2)
    assert np.all(np.abs(off) < 4.0 * np.asarray(found.spread)[:, 0])
