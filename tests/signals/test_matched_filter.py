import numpy as np
import pytest
from scipy.linalg import toeplitz

from calibration.cases import RATE, coloured, pulse, rumble
from jblast.errors import InputError
from jblast.signals import (
    filtered,
    matched_kernel,
    noise_spectrum,
    white_noise,
)


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
