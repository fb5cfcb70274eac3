import numpy as np
import pytest

from calibration.cases import RATE, coloured, pulse, rumble
from jblast.errors import InputError
from jblast.signals import NoiseSpectrum, matched_kernel, noise_spectrum, white_noise
from jblast.signals.noise import median_bias, whitening_taps


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
