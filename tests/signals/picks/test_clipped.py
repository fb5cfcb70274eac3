"""Records before and after the fit: what is refused, clipped, padded and trusted."""

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations.records.recording import PressureRecord
from jblast.signals.picks import pick
from jblast.signals.picks.pick import filled_length
from jblast.signals.picks.preparation import clipped_samples
from jblast.signals.picks.record_picks import clipping_level, notes_of, quality_of
from tests.signals.picks.simulated import TIME, Truth, samples_of
from tests.signals.records import made

RAMP = np.linspace(0.0, 1.0, 20)


def clipped(samples, full_scale=None, fill=0):
    """Return what is clipped of one record, filled up with its last sample."""
    filled = np.pad(samples, (0, fill), mode="edge")
    found = clipped_samples(jnp.asarray(filled), jnp.asarray(samples.size), full_scale)
    return np.flatnonzero(np.asarray(found)).tolist()


def test_equal_samples_in_a_row_at_the_top_are_clipped():
    assert clipped(np.minimum(RAMP, 0.8)) == [16, 17, 18, 19]
    assert clipped(np.r_[np.minimum(RAMP, 0.8), 0.0]) == [16, 17, 18, 19]
    assert clipped(RAMP) == []


def test_what_a_record_is_filled_up_with_is_not():
    assert clipped(RAMP, fill=12) == []
    assert clipped(-RAMP, fill=12) == []
    assert clipped(RAMP, full_scale=jnp.asarray(1.0), fill=12) == [19]
    assert clipped(np.minimum(RAMP, 0.8), fill=12) == [16, 17, 18, 19]


def test_records_of_any_length_are_of_few():
    lengths = {filled_length(n) for n in range(16, 70_000, 7)}
    assert lengths == {2**k for k in range(9, 18)}


def record(samples, full_scale: float | None = 1.0):
    return PressureRecord("a", np.asarray(samples), 1000.0, full_scale=full_scale)


def test_a_flat_top_is_clipped_and_the_top_of_few_codes_is_not():
    time = np.arange(4000)
    pulse = np.where(time < 1000, 0.0, 0.9 * np.exp(-(time - 1000.0) / 800.0))
    pulse += 1e-3 * np.random.default_rng(1).standard_normal(time.size)
    # an amplifier that clips at 0.8, in 16 bits, as `clip_soft80.wav` of issue 41
    clipped = np.round(np.minimum(pulse, 0.8) * 2**15) / 2**15
    assert clipping_level(record(clipped)) == clipped.max()
    assert clipping_level(record(pulse)) == 1.0
    # 20 codes in all, each of tens of samples
    assert clipping_level(record(np.round(pulse * 20) / 20)) == 1.0
    assert np.isnan(clipping_level(record(clipped, None)))
    assert clipping_level(record(np.full(100, 0.5))) == 1.0


PEAK_PA = 1000.0
"""Of the made pick."""


@pytest.mark.parametrize(
    ("misfit", "noise_pa", "quality"),
    [
        (1.0, 2.0, "good"),
        (10.0, 2.0, "doubtful"),
        (100.0, 2.0, "poor"),  # 2 % of the peak are left
        (100.0, 0.2, "poor"),  # 0.2 %
        (4000.0, 0.01, "doubtful"),  # 63 sigma, and no more than 0.06 % of the peak
    ],
)
def test_what_is_left_counts_by_noise_and_by_peak(misfit, noise_pa, quality):
    found = made.pick(misfit=misfit, noise_pa=noise_pa, peak_overpressure_pa=PEAK_PA)
    assert quality_of(found) == quality
    assert ("misfit" in notes_of(found)) == (quality != "good")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda t, p: (t, np.where(t > 4e-3, np.nan, p)),
            r"pressure_pa: .* nan at \[4",
        ),
        (lambda t, p: (t[::-1], p), "time_s: expected rising times"),
        (lambda t, p: (t[:-1], p), "got .1024,. and .1023,"),
        (lambda t, p: (np.where(t > 4e-3, t + 1e-3, t), p), "time_s: expected even"),
        (
            lambda t, p: (np.stack([t, t]), np.stack([p, p])),
            "time_s: expected .sample.,",
        ),
        (lambda t, p: (t[:9], p[:9]), "16 samples or more, got 9"),
    ],
)
def test_what_can_be_no_record_is_refused_by_name(change, message):
    with pytest.raises(InputError, match=message):
        pick(*change(TIME, samples_of(Truth())))


@pytest.mark.parametrize("name", ["full_scale_pa", "high_pass_hz"])
def test_a_scale_or_corner_that_is_not_positive_is_refused(name):
    with pytest.raises(InputError, match=f"{name}: expected a positive"):
        pick(TIME, samples_of(Truth()), **{name: 0.0})
