"""Matched filters, spectra of noise and templates of blasts."""

import numpy as np
import pytest
from scipy.linalg import toeplitz

from calibration.cases import RATE, coloured, pulse, rumble
from jblast.errors import InputError
from jblast.signals import (
    NoiseSpectrum,
    bank_of_pulses,
    blast_template,
    filtered,
    matched_kernel,
    noise_spectrum,
    white_noise,
)
from jblast.signals.noise import median_bias, whitening_taps
from jblast.signals.templates import BANK_SCALED_DISTANCE, DURATION_RATIO, DURATIONS
from jblast.waves.pulse import blast_pulse


@pytest.mark.slow
def test_the_filter_is_the_inverse_covariance_times_the_template():
    noise, shape = rumble(lines=True), pulse(0.005)
    kernel = matched_kernel(shape, RATE, noise)
    # the covariance of samples: the density integrated against cosines, on its own grid
    fine = np.linspace(0, RATE / 2, 2 * 2048 * 8 + 1)
    density = np.interp(fine, *noise[:2])
    width = np.full(fine.size, fine[1])
    width[[0, -1]] /= 2
    lags = np.arange(kernel.taps.size) / RATE
    row = np.array(
        [np.sum(width * density * np.cos(2 * np.pi * fine * t)) for t in lags]
    )
    signal = np.pad(shape, (kernel.before, 0))
    energy = signal @ np.linalg.solve(toeplitz(row), signal)
    # lines of a single bin have a memory that the whitening filter cuts: 0.02 dB
    assert kernel.response == pytest.approx(np.sqrt(energy), rel=4e-3)
    ratio = (kernel.taps @ signal) ** 2 / (kernel.taps @ toeplitz(row) @ kernel.taps)
    assert ratio == pytest.approx(kernel.response**2, rel=2e-3)


def test_noise_alone_comes_out_with_variance_one_and_a_template_with_its_energy():
    rng, noise, shape = np.random.default_rng(1), rumble(), pulse(0.02)
    kernel = matched_kernel(shape, RATE, noise)
    sound = coloured(rng, noise, 2**20)[0]
    inside = filtered(sound, kernel)[kernel.before : -kernel.reach]
    # 1e6 samples of a band of a quarter of the rate: 0.2 % of the deviation
    assert inside.std() == pytest.approx(1, abs=0.01)
    alone = np.zeros(4 * kernel.taps.size)
    alone[2000 + kernel.before :][: shape.size] = shape
    answer = filtered(alone, kernel)
    assert int(np.argmax(answer)) == 2000 + kernel.before
    assert answer.max() == pytest.approx(kernel.response, rel=1e-9)


def test_a_blast_at_the_end_is_not_heard_at_the_beginning():
    shape = pulse(0.02)
    sound = np.zeros(8000)
    sound[-shape.size // 2 :] = 1e3 * shape[: shape.size // 2]
    output = filtered(sound, matched_kernel(shape, RATE, white_noise(1.0, RATE)))
    assert np.abs(output[:1000]).max() < 1e-6


def test_white_noise_leaves_the_template_as_the_filter():
    shape, sigma = pulse(0.02), 0.3
    kernel = matched_kernel(shape, RATE, white_noise(sigma, RATE))
    length = np.linalg.norm(shape)
    assert np.allclose(kernel.taps, shape / (sigma * length))
    assert kernel.response == pytest.approx(length / sigma)
    assert kernel.before == 0


def test_no_gain_and_no_offset_changes_what_is_heard():
    rng, shape = np.random.default_rng(2), pulse(0.02)
    sound = coloured(rng, rumble(), 2**18)[0]
    sound[100_000:][: shape.size] += shape

    def output(sound, shape):
        return filtered(sound, matched_kernel(shape, RATE, noise_spectrum(sound, RATE)))

    first = output(sound, shape)
    for gain, offset in ((1e-6, 0.0), (32768.0, 500.0), (1.0, -3.0)):
        again = output(gain * sound + offset, 7.0 * shape)
        # rounding of the offset, 1e-16 of it against a floor at 1e-4 of the rumble
        assert np.allclose(first, again, atol=1e-5)


NOISE = np.random.default_rng(3).standard_normal(5000)


@pytest.mark.parametrize(
    ("recording", "template", "said"),
    [
        (NOISE, np.zeros(100), "template: expected a sound, got 100 samples"),
        (NOISE, np.zeros(0), "template: expected at least 1 samples, got 0"),
        (np.ones((2, 5000)), np.ones(100), "recording: expected one channel"),
        (NOISE, np.array([1.0, np.nan]), "got nan at sample 1"),
        (np.r_[np.ones(5000), np.inf], np.ones(100), "got inf at sample 5000"),
        (np.zeros(5000), np.ones(100), "got digital silence in"),
        (np.ones(50), np.ones(10), "recording: expected at least 64 samples, got 50"),
        ("loud", np.ones(10), "recording: expected numbers, got 'loud'"),
    ],
)
def test_what_cannot_be_heard_is_said(recording, template, said):
    def measured():
        return matched_kernel(template, RATE, noise_spectrum(recording, RATE))

    with pytest.raises(InputError, match=said):
        measured()


def test_a_recording_shorter_than_the_filter_is_refused_with_both_lengths():
    kernel = matched_kernel(pulse(0.02), RATE, rumble())
    with pytest.raises(InputError, match=f"at least {kernel.taps.size} samples"):
        filtered(np.ones(kernel.taps.size - 1), kernel)


def test_digital_silence_within_a_recording_does_not_lower_its_noise():
    rng = np.random.default_rng(4)
    sound = coloured(rng, rumble(), 2**17)[0]
    silent = np.r_[sound, np.zeros(sound.size)]
    alone, both = (noise_spectrum(one, RATE).density for one in (sound, silent))
    # one window of 63 stands on both sides of the edge, and the offset differs a little
    assert np.median(both / alone) == pytest.approx(1, abs=0.03)


@pytest.mark.parametrize("average", ["mean", "median"])
def test_a_measured_spectrum_is_the_one_that_was_drawn(average):
    drawn = rumble()
    sound = coloured(np.random.default_rng(0), drawn, 2**20)[0]
    found = noise_spectrum(sound, RATE, average=average)
    ratio = found.density / np.interp(found.frequency_hz, *drawn[:2])
    # 511 windows, half overlapping: 6 % a bin; where the slope is steep windows blur it
    assert np.mean(ratio[8:]) == pytest.approx(1, abs=0.01)
    assert np.std(ratio[8:]) < 0.08


def test_blasts_in_a_third_of_the_time_hardly_move_it():
    rng, shape = np.random.default_rng(1), pulse(0.05)
    sound = coloured(rng, rumble(), 2**19)[0]
    loud = sound.copy()
    for at in range(0, loud.size - shape.size, 6 * shape.size):
        loud[at : at + shape.size] += 3000 * shape
    quiet, other = (
        noise_spectrum(one, RATE, average="median").density for one in (sound, loud)
    )
    assert np.median(other / quiet) < 3.0
    assert 3000**2 * np.mean(shape**2) > 1e3 * np.mean(sound**2)  # their mean power


def test_the_median_of_exponentials_is_corrected():
    draws = np.random.default_rng(2).exponential(size=(200_000, 7))
    # standard error 0.4 / sqrt(200,000)
    assert np.median(draws, axis=1).mean() == pytest.approx(median_bias(7), abs=4e-3)
    assert median_bias(1001) == pytest.approx(np.log(2), abs=1e-3)


def test_an_offset_is_measured_and_is_no_noise():
    sound = np.random.default_rng(3).standard_normal(2**16)
    found, plain = noise_spectrum(sound + 40.0, RATE), noise_spectrum(sound, RATE)
    assert found.offset == pytest.approx(40.0, abs=0.05)
    assert np.allclose(found.density, plain.density, rtol=1e-6)


def test_white_noise_has_its_variance_over_the_band():
    noise = white_noise(0.5, RATE)
    assert np.trapezoid(noise.density, noise.frequency_hz) == pytest.approx(0.25)


@pytest.mark.parametrize(
    ("noise", "said"),
    [
        (NoiseSpectrum(np.array([0, 1e3]), np.ones(2)), "up to half of the rate"),
        (NoiseSpectrum(np.array([0, 3e4]), np.zeros(2)), "not all 0"),
        (NoiseSpectrum(np.array([0, 3e4]), np.array([1, -1.0])), "from 0 up"),
        (NoiseSpectrum(np.array([0, 3e4]), np.array([1, np.nan])), "finite"),
    ],
)
def test_what_is_no_spectrum_is_said(noise, said):
    with pytest.raises(InputError, match=said):
        matched_kernel(pulse(0.01), RATE, noise)


def test_the_causal_filter_leaves_white_noise_of_variance_one():
    noise = rumble()
    taps = whitening_taps(noise, RATE)
    # its gain is one over the root of the density
    gain = np.abs(np.fft.rfft(taps, 2**16)[1:-1]) ** 2
    f = np.fft.rfftfreq(2**16, 1 / RATE)[1:-1]
    density = np.interp(f, noise.frequency_hz, noise.density) * RATE / 2
    np.testing.assert_allclose(gain * density, 1.0, rtol=0.02)
    sound = coloured(np.random.default_rng(8), noise, 2**17)[0]
    white = np.convolve(sound, taps)[taps.size : sound.size]
    assert white.std() == pytest.approx(1.0, abs=0.02)
    neighbours = np.corrcoef(white[1:], white[:-1])[0, 1]
    assert abs(neighbours) < 0.02


def test_a_template_by_law_has_the_impulse_and_the_duration_of_the_law():
    row, law = blast_template(5.0, 100.0, RATE), blast_pulse(100.0, 5.0)
    positive = row[: round(float(law.duration) * RATE)]
    assert (positive[5:] > 0).all()
    assert row[positive.size + 2] < 0
    shape = 1 / law.decay - (1 - np.exp(-law.decay)) / law.decay**2
    impulse = float(law.peak * law.duration * shape)  # Friedlander's, Baker eq. 6-10
    # to the sample at whose middle the pressure changes its sign
    assert positive.sum() / RATE == pytest.approx(impulse, rel=1e-3)
    assert row.sum() / RATE == pytest.approx(
        impulse - 9 / 16 * float(law.suction * law.suction_duration),
        abs=2e-3 * impulse,
    )


def test_the_front_is_in_the_first_samples():
    row = blast_template(5.0, 30.0, RATE)
    assert int(np.argmax(row)) < 5


@pytest.mark.parametrize(
    ("mass", "distance", "rate", "said"),
    [
        (0.0, 10.0, RATE, "mass_kg: expected a positive number"),
        (1.0, -1.0, RATE, "range_m: expected a positive number"),
        (1.0, 10.0, 0.0, "rate_hz: expected a positive number"),
        (1.0, 10.0, 10.0, "rate_hz: expected two samples within"),
    ],
)
def test_blasts_without_samples_are_refused(mass, distance, rate, said):
    with pytest.raises(InputError, match=said):
        blast_template(mass, distance, rate)


def likeness(one, other):
    """Greatest correlation of two pulses, of any size and delay, in white noise."""
    n = 2 * max(one.size, other.size)
    product = np.fft.rfft(one, n) * np.conj(np.fft.rfft(other, n))
    return np.fft.irfft(product, n).max() / np.sqrt((one @ one) * (other @ other))


def test_a_bank_has_a_pulse_near_any_blast():
    bank = bank_of_pulses(RATE)
    positive = [np.argmax(samples < 0) / RATE for samples in bank]
    np.testing.assert_allclose(positive, DURATIONS, atol=1 / RATE)
    # half a step longer than a pulse of 5 kg
    size = 5 ** (1 / 3) * DURATION_RATIO**0.5
    between = blast_template(size**3, BANK_SCALED_DISTANCE * size, RATE)
    ratios = np.argmax(between < 0) / RATE / np.array(DURATIONS)
    steps = np.log(ratios) / np.log(DURATION_RATIO)
    best = max(likeness(between, samples) for samples in bank)
    assert np.abs(steps).min() < 0.51
    assert 0.92 < best <= 1.0


def test_a_pulse_of_minutes_is_no_template():
    with pytest.raises(InputError, match="a blast of 60 s at most"):
        blast_template(1e20, 5e6, RATE)
