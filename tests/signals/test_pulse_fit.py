"""Goodness of fit of arrivals: blast pulses, and other impulsive sounds."""

import numpy as np
import pytest

from jblast.signals import (
    Channel,
    bank_of_pulses,
    noise_spectrum,
    search,
    white_noise,
)
from jblast.signals.pulse_fit import MAX_MISFIT, PulseTest

RATE, SECONDS = 8000.0, 6.0
TIME = np.arange(round(0.4 * RATE)) / RATE


@pytest.fixture(scope="module")
def bank():
    return bank_of_pulses(RATE)


def friedlander(duration_s, decay=1.0):
    """A pulse that is none of the bank's."""
    x = TIME / duration_s
    return (1 - x) * np.exp(-decay * x)


def ringing(frequency_hz, quality):
    decay = np.exp(-np.pi * frequency_hz * TIME / quality)
    return decay * np.sin(2 * np.pi * frequency_hz * TIME)


def burst(seed=5):
    """A longer noise burst."""
    rng = np.random.default_rng(seed)
    return rng.standard_normal(TIME.size) * np.exp(-TIME / 0.1)


def drum():
    return ringing(90, 12) + 0.4 * ringing(143, 15)


def click():
    return ringing(2200, 4)


def with_reflection(sound, delay_s=0.004, share=0.8):
    late = round(delay_s * RATE)
    return sound + share * np.r_[np.zeros(late), sound[:-late]]


BLASTS = {
    "3 ms": friedlander(0.003),
    "12 ms": friedlander(0.012),
    "other decay": friedlander(0.02, 2.0),
    "reflection": with_reflection(friedlander(0.006)),
    "clipped": np.minimum(friedlander(0.01), 0.6),
}
OTHERS = {"drum": drum(), "click": click(), "burst": burst()}


def channel(sound, at_s=3.0, level=40.0, seed=0):
    """White noise of variance 1 with a sound of a given peak."""
    samples = np.random.default_rng(seed).standard_normal(round(SECONDS * RATE))
    start = round(at_s * RATE)
    samples[start : start + sound.size] += level * sound / np.abs(sound).max()
    return Channel("gate", "gate.wav", 1, samples, RATE)


@pytest.mark.parametrize("name", BLASTS)
def test_pulses_of_other_forms_are_accepted(bank, name):
    found = search(channel(BLASTS[name]), bank)
    (arrival,) = found.detections
    assert arrival.time_s == pytest.approx(3.0, abs=0.01)
    fit = arrival.fit
    assert fit is not None
    assert fit.misfit < MAX_MISFIT
    assert fit.log_likelihood_ratio > np.log(100)


@pytest.mark.parametrize("name", OTHERS)
def test_other_impulsive_sounds_are_rejected(bank, name):
    found = search(channel(OTHERS[name]), bank)
    assert found.detections == ()
    assert found.others  # reported, not dropped
    assert not any(one.fit is None or one.fit.blast_form for one in found.others)
    untested = search(channel(OTHERS[name]), bank, forms=False)
    assert len(untested.detections) == len(found.others)


def test_chi_squared_of_a_true_pulse_has_its_degrees_of_freedom(bank):
    """In noise of known spectrum: mean and variance are those of chi-squared."""
    nth, size = 6, 20.0
    pulse = bank[nth] / np.abs(bank[nth]).max()
    test = PulseTest(bank, RATE, white_noise(1.0, RATE))
    z = []
    for seed in range(30):
        samples = np.random.default_rng(seed).standard_normal(round(1.5 * RATE))
        samples[8000 : 8000 + pulse.size] += size * pulse
        # no pick: none is louder
        fit, _ = test(samples, 8000 / RATE, nth, threshold=np.inf)
        # in units of the standard deviation, of chi-squared and of the noise level
        excess = fit.misfit * size**2 * (pulse @ pulse)
        level_sd = np.sqrt(2 / (0.5 * RATE)) * fit.fit_dof
        z.append(excess / np.hypot(np.sqrt(2 * fit.fit_dof), level_sd))
        assert fit.fit_p > 0.999  # far less misfit than is accepted
    assert abs(np.mean(z)) < 0.7  # 4 standard errors
    assert np.std(z) == pytest.approx(1.0, abs=0.45)


def test_a_louder_interval_raises_the_threshold(bank):
    """A burst of steady noise 6 dB up is no blast, nor is what is in its statistic."""
    rng = np.random.default_rng(3)
    samples = rng.standard_normal(round(20 * RATE))
    samples[round(8 * RATE) : round(10 * RATE)] *= 4.0
    found = search(Channel("gate", "gate.wav", 1, samples, RATE), bank)
    assert len(found.others) > 0
    assert found.detections == ()


def test_a_blast_in_quiet_after_loud_sound_is_accepted(bank):
    """Half of the recording is ten times as loud: the level is that before it."""
    one = channel(friedlander(0.008), at_s=5.0, level=8.0)
    one.samples[: round(3 * RATE)] *= 3.0
    found = search(one, bank)
    assert [round(arrival.time_s, 2) for arrival in found.detections] == [5.0]
    fit = found.detections[0].fit
    assert fit is not None
    assert fit.noise_level < 0.7


def test_an_arrival_at_either_end_of_a_recording_is_tested(bank):
    noise = noise_spectrum(channel(np.zeros(1) + 1e-9).samples, RATE)
    for at in (0.01, SECONDS - 0.01):
        sound = friedlander(0.003)[: round((SECONDS - at) * RATE)]
        fit, _ = PulseTest(bank, RATE, noise)(channel(sound, at).samples, at, 3)
        assert fit.blast_form
        assert fit.fit_dof > 0
