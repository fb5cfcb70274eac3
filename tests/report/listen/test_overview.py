import numpy as np
import pytest
import scipy.signal

from jblast.report.listen import Envelope, Spectrogram

SAMPLES = np.random.default_rng(3).normal(size=50_000)


def pieces(samples: np.ndarray, size: int):
    """Samples, cut, each with the number of its first."""
    for at in range(0, samples.size, size):
        yield samples[at : at + size], at


@pytest.mark.parametrize("size", [1, 7, 999, 50_000])
def test_an_envelope_is_the_least_and_most_of_every_column(size):
    samples = SAMPLES[: 50 * size]
    start, stop = samples.size // 7, samples.size - samples.size // 5
    envelope = Envelope(start, stop, 1000.0, columns=31)
    for piece, at in pieces(samples, size):
        envelope.push(piece, at)
    parts = np.split(samples[: envelope.stop], envelope.edges[:-1])[1:]
    np.testing.assert_array_equal(envelope.low, [part.min() for part in parts])
    np.testing.assert_array_equal(envelope.high, [part.max() for part in parts])
    assert start / 1000.0 <= envelope.time_s[0] < envelope.time_s[-1] < stop / 1000.0


@pytest.mark.parametrize("size", [13, 4096, 50_000])
def test_a_spectrogram_is_that_of_scipy(size):
    """A different implementation: one column a frame."""
    rate_hz, samples = 8000.0, SAMPLES[:20_000]
    spectrogram = Spectrogram(samples.size, rate_hz)
    for piece, _ in pieces(samples, size):
        spectrogram.push(piece)
    frequency, time, density = scipy.signal.spectrogram(
        samples,
        rate_hz,
        window=scipy.signal.get_window("hann", spectrogram.size),
        noverlap=spectrogram.size - spectrogram.step,
        detrend=False,  # pyright: ignore[reportArgumentType]  as documented
    )
    assert spectrogram.frames == len(time) <= 400
    np.testing.assert_allclose(spectrogram.density().T, density[1:], rtol=1e-9)
    np.testing.assert_allclose(spectrogram.frequency_hz, frequency[1:])
    middles = (spectrogram.time_s[1:] + spectrogram.time_s[:-1]) / 2
    np.testing.assert_allclose(middles, time)


def test_columns_that_hold_many_spectra_keep_the_power():
    rate_hz, sd = 8000.0, 3.0
    spectrogram = Spectrogram(SAMPLES.size * 10, rate_hz)
    for _ in range(10):
        spectrogram.push(sd * SAMPLES)
    density = spectrogram.density()
    assert density.shape[0] == 400
    power = density.mean(axis=0).sum() * rate_hz / spectrogram.size
    # white noise: mean of 7811 spectra, without the row of frequency 0
    assert power == pytest.approx(sd**2 * (1 - 1 / spectrogram.size), rel=0.02)


@pytest.mark.parametrize("samples", [1, 15, 16, 17, 200])
def test_a_record_of_a_few_samples_has_a_spectrogram_or_none(samples):
    spectrogram = Spectrogram(samples, 48_000.0)
    spectrogram.push(SAMPLES[:samples])
    assert np.isfinite(spectrogram.density()).any() == (samples >= 16)
