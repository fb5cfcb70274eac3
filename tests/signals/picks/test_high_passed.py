"""Records that went through a high-pass nobody stated, by SciPy's Butterworth."""

from itertools import product

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from jblast.signals.picks import pick
from jblast.signals.picks.record_picks import notes_of, quality_of

pytestmark = pytest.mark.slow  # a program to compile

SAMPLES, FINE, ARRIVAL, SNR = 4096, 16, 600.3, 100.0
DURATION, DECAY, RISE = 80.0, 1.2, 2.0
CORNERS = (0.1, 0.3, 0.7, 1.5)
"""Over the inverse of the duration."""
FORMS = ("none", "cubic", "continued")
CASES = list(product(FORMS, (1, 2), CORNERS))
FARTHEST = 3.0


def pressure(form: str):
    """Return a Friedlander pulse at instants, sixteen a sample."""
    time = (np.arange(SAMPLES * FINE) + 0.5) / FINE - 0.5 - ARRIVAL
    s = time / DURATION
    pulse = np.minimum(time / RISE, 1.0) * (1 - s) * np.exp(-DECAY * np.maximum(s, 0))
    r = np.clip((s - 1.0) / 2.4, 0.0, 1.0)
    if form != "continued":
        depth = 0.2 if form == "cubic" else 0.0
        pulse = np.where(s > 1, -depth * 6.75 * r * (1 - r) ** 2, pulse)
    return np.where(time >= 0, pulse, 0.0)


def recorded(pulse, rng):
    """Return its means over samples, with noise."""
    means = pulse.reshape(SAMPLES, FINE).mean(axis=1)
    return means + rng.standard_normal(SAMPLES) / SNR


@pytest.fixture(scope="module")
def found():
    """Return picks of high-passed records, then of the same without a high-pass."""
    rng = np.random.default_rng(15)
    rows = []
    for form, order, corner in CASES:
        band = 2.0 * corner / DURATION / FINE
        through = butter(order, band, "highpass", output="sos")
        rows.append(recorded(np.asarray(sosfilt(through, pressure(form))), rng))
    rows += [recorded(pressure(form), rng) for form in FORMS]
    return pick(np.arange(SAMPLES, dtype=float), np.array(rows))


def one(found, k: int):
    """Return the pick of one record."""
    import jax

    return jax.tree.map(lambda x: np.asarray(x)[k], found)


@pytest.mark.parametrize("k", range(len(CASES)))
def test_a_high_pass_that_nobody_stated_leaves_no_wrong_duration(found, k):
    mine = one(found, k)
    z = np.log(mine.positive_duration_s / DURATION) / mine.spread[2]
    left_out = "high_passed" in notes_of(mine) or quality_of(mine) == "poor"
    assert left_out or abs(z) < FARTHEST, (CASES[k], z, notes_of(mine))


@pytest.mark.parametrize("k", range(len(FORMS)))
def test_the_same_records_without_one_stay_good(found, k):
    mine = one(found, len(CASES) + k)
    assert quality_of(mine) == "good"
    z = np.log(mine.positive_duration_s / DURATION) / mine.spread[2]
    assert abs(z) < FARTHEST
