r"""The spectrum of stationary noise, and filters that whiten it.

Noise is assumed Gaussian and stationary. Its one-sided density $S(f)$, with
$\int_0^{f_s/2} S\,df = \sigma^2$, and its mean then describe it completely. A filter
$1/\sqrt S$ whitens it. The matched filter (`matched_filter`) whitens both the noise and
the template.

The density is estimated from an interval without a blast, or from the recording itself,
in Hann windows that overlap by half. Each frequency is averaged over the windows:

- By the *mean* (Welch 1967). Intermittent sounds (birds, gusts, voices) count with all
  their power and are not detected as blasts. A loud blast counts, too: of a blast with
  duration $T$ and bandwidth $B$ the statistic is limited to about $10 \log_{10} TB$ dB.
- By the *median*, which blasts in fewer than half of the windows hardly change. It
  underestimates intermittent noise: three bursts of birdsong in a minute do not change
  it. It is meant for sound that is steady except for blasts.

The median of $n$ exponential variables is lower than their mean by

$$\alpha_n = \sum_{k=1}^{n} \frac{(-1)^{k+1}}{k} \to \ln 2, \qquad n\ \text{odd}$$

(Allen et al. 2012, FINDCHIRP, Phys. Rev. D 85, 122006, appendix B), and is corrected
for it. Windows of constant samples are digital silence of the recorder. They are left
out, and counted.
"""

from collections import deque
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from jblast.errors import InputError, argument, shown

SEGMENT_S = 0.1
"""Length of a window, rounded down to a power of two [s]: about 12 Hz between lines,
fine enough for the slope of wind and traffic noise, with ten windows in half a
second."""
LEAST_SEGMENTS = 7
"""Smallest number of windows: the error of a median or mean over them is about 40 %
(2 dB), and fewer would not exclude a blast in one or two of them."""
DENSITY_FLOOR = 1e-10
"""Smallest density, over the mean: no recorder resolves a signal 100 dB below it."""

FAST_FACTORS = (1, 3, 5, 9, 15, 25, 27, 45, 75, 81, 125, 135)
"""Odd factors of fast lengths. Without prime factors above 5 all passes of a transform
are fast."""
MEMORY_S = 32.0
"""Length of noise at which there is a better estimate, and the older half of the mean
counts half [s]: the standard deviation of an output is then known to 3 %, and the wind
may change in minutes. Noise that becomes louder meanwhile is known from the threshold
in the noise just before an arrival, and after `RELEARN_S`."""
REFINED = 3.0
"""Ratio of the known length of noise to that of the last estimate from which on there
is a better one, until `MEMORY_S` is reached."""
MEDIAN_SHARE = 0.48
"""Variance of the mean of exponential variables over that of their scaled median: the
share of the time that a median is worth."""
RELEARN_S = 5.0
"""Time without any quiet window after which noise is learnt again [s]: longer than the
reverberation of a blast."""


class NoiseSpectrum(NamedTuple):
    """Stationary noise.

    Attributes:
        frequency_hz: Frequencies in even steps from 0 to half the sampling rate or
            more.
        density: One-sided power density [unit of the samples, squared, per Hz],
            positive.
        offset: Mean of the samples.
    """

    frequency_hz: Float[np.ndarray, " bin"]
    density: Float[np.ndarray, " bin"]
    offset: float = 0.0


def white_noise(sigma: float, rate_hz: float) -> NoiseSpectrum:
    """Return the spectrum of independent samples.

    Args:
        sigma: Their standard deviation [unit of the samples], positive.
        rate_hz: Sampling rate [Hz].
    """
    sigma = checked_positive("sigma", sigma, "the samples' unit")
    half = checked_positive("rate_hz", rate_hz, "Hz") / 2
    return NoiseSpectrum(np.array([0.0, half]), np.full(2, sigma**2 / half))


def noise_spectrum(
    recording: ArrayLike,
    rate_hz: float,
    *,
    average: Literal["mean", "median"] = "mean",
) -> NoiseSpectrum:
    """Measure the spectrum of the noise in a recording.

    Args:
        recording: Samples of one channel.
        rate_hz: Sampling rate [Hz].
        average: Average over the windows.

    Raises:
        InputError: The recording is too short, silent, or not finite.
    """
    samples = checked_samples("recording", recording, least=8 * (LEAST_SEGMENTS + 1))
    rate_hz = checked_positive("rate_hz", rate_hz, "Hz")
    size = window_size(rate_hz, samples.size)
    windows, alive = _windows(samples, size)
    if alive.sum() < LEAST_SEGMENTS:
        raise InputError(
            f"{argument('recording')}: expected sound, got digital silence in "
            f"{windows.shape[0] - int(alive.sum())} of {windows.shape[0]} windows "
            f"of {size / rate_hz:.3g} s"
        )
    offset = float(np.median(windows[alive].mean(axis=1)))
    # window by window, as one transform of all would need several times the memory
    power = np.stack(
        [periodograms(window - offset, rate_hz) for window in windows[alive]]
    )
    density = median_density(power) if average == "median" else np.mean(power, axis=0)
    return NoiseSpectrum(np.fft.rfftfreq(size, 1 / rate_hz), density, offset)


def _windows(
    samples: np.ndarray, size: int
) -> tuple[Float[np.ndarray, "window sample"], np.ndarray]:
    """Return windows that overlap by half, and which of them have sound."""
    windows = np.lib.stride_tricks.sliding_window_view(samples, size)[:: size // 2]
    # digital silence, as of a recorder that was off, would lower the density
    return windows, np.ptp(windows, axis=1) > 0


def periodograms(
    windows: Float[np.ndarray, "*window sample"], rate_hz: float
) -> Float[np.ndarray, "*window bin"]:
    """Return the one-sided power density of each window, tapered [1/Hz].

    Args:
        windows: Samples without their mean.
        rate_hz: Sampling rate [Hz].
    """
    size = windows.shape[-1]
    taper = np.hanning(size + 1)[:size]
    density = np.abs(np.fft.rfft(windows * taper)) ** 2
    density *= 2 / (rate_hz * np.sum(taper**2))
    # the lines at zero and at half the rate are real: their squares have one degree of
    # freedom, not two, and the removed mean leaks out of the first
    density[..., 0], density[..., -1] = density[..., 1], density[..., -2]
    return density


def median_density(
    power: Float[np.ndarray, "window bin"],
) -> Float[np.ndarray, " bin"]:
    """Return the median of densities of noise, scaled to their mean."""
    # the formula of the bias holds for odd numbers, where one value is the median
    odd = power[: power.shape[0] - 1 + power.shape[0] % 2]
    return np.median(odd, axis=0) / median_bias(odd.shape[0])


class NoiseFollower:
    """Estimate of the spectrum of a stream's noise, in bounded memory.

    It is the mean over the windows that contain no arrivals, with a memory of
    `MEMORY_S`. If no such window has come for `RELEARN_S`, the noise itself has become
    louder: the estimate is then the median over these seconds, and the mean begins
    again.

    Args:
        rate_hz: Sampling rate [Hz].
        offset: Mean of the samples.
    """

    def __init__(self, rate_hz: float, offset: float):
        self._rate_hz, self._size = rate_hz, window_size(rate_hz)
        self._window_s = self._size // 2 / rate_hz
        self._offset = offset
        self._last = np.zeros(0)
        self._many = max(round(RELEARN_S / self._window_s), 1)
        self._recent: deque[np.ndarray] = deque(maxlen=self._many)
        self._sum, self._windows, self._unquiet = np.zeros(self._size // 2 + 1), 0.0, 0

    def add(self, block: Float[np.ndarray, " sample"], *, quiet: bool) -> None:
        """Add the next block.

        Args:
            block: Samples.
            quiet: True for a block without arrivals.
        """
        samples = np.concatenate([self._last, block])
        self._last = samples[-(self._size // 2) :].copy()
        windows, alive = _windows(samples, self._size)
        if not alive.any():
            return
        rows = periodograms(windows[alive] - self._offset, self._rate_hz)
        self._recent.extend(rows)
        if not quiet:
            self._unquiet += len(rows)
            return
        self._unquiet = 0
        self._sum += rows.sum(axis=0)
        self._windows += len(rows)
        # the offset has the memory of the mean
        step = (float(windows[alive].mean()) - self._offset) * len(rows)
        self._offset += step / self._windows

    def better(self, known_s: float) -> tuple[NoiseSpectrum, float] | None:
        """Return an estimate that is better than the last one, or None.

        Args:
            known_s: Length of noise of the last estimate [s].

        Returns:
            The spectrum, and the length of noise that it is worth [s].
        """
        quiet_s = self._windows * self._window_s
        kept = 1.0
        if self._unquiet >= self._many:
            density, worth_s = median_density(np.stack(self._recent)), RELEARN_S
            worth_s, kept, self._unquiet = MEDIAN_SHARE * worth_s, 0.0, 0
        elif quiet_s >= min(REFINED * known_s, MEMORY_S):
            density, worth_s = self._sum / self._windows, quiet_s
            kept = 0.5 if quiet_s >= MEMORY_S else 1.0
        else:
            return None
        self._sum, self._windows = kept * self._sum, kept * self._windows
        frequency = np.fft.rfftfreq(self._size, 1 / self._rate_hz)
        return NoiseSpectrum(frequency, density, self._offset), worth_s


def window_size(rate_hz: float, samples: int | None = None) -> int:
    """Return the number of samples of a window of the spectrum.

    Args:
        rate_hz: Sampling rate [Hz].
        samples: Number of samples, in which `LEAST_SEGMENTS` windows must fit; None for
            a stream.
    """
    longest = SEGMENT_S * rate_hz
    if samples is not None:
        longest = min(longest, 2 * samples / (LEAST_SEGMENTS + 1))
    return 2 ** int(np.log2(max(longest, 8)))


def median_bias(count: int) -> float:
    """Return the mean of the median of exponential variables of mean 1.

    Args:
        count: Number of variables, odd.
    """
    k = np.arange(1, count + 1)
    return float(np.sum((-1.0) ** (k + 1) / k))


def bin_variances(
    noise: NoiseSpectrum, size: int, rate_hz: float
) -> Float[np.ndarray, " bin"]:
    """Return the variance of each bin of a unitary Fourier transform of the noise.

    These are the eigenvalues of its circulant covariance. They are linear between the
    frequencies of the spectrum, and at least `DENSITY_FLOOR` times their mean, so that
    a band without any noise has no infinite weight.

    Args:
        noise: Spectrum of the noise.
        size: Samples of the transform.
        rate_hz: Sampling rate [Hz].

    Raises:
        InputError: A density is negative or not finite, all are 0, or the spectrum
            ends below half the sampling rate.
    """
    frequency, density = (np.asarray(part, float) for part in noise[:2])
    if not (np.isfinite(density).all() and (density >= 0).all() and density.any()):
        bad = ~(np.isfinite(density) & (density >= 0))
        got = f"{density[bad][0]:g} at line {np.argmax(bad)}" if bad.any() else "only 0"
        raise InputError(
            f"{argument('noise_spectrum')}: expected finite densities from 0 up, not "
            f"all 0, got {got}"
        )
    if frequency[-1] < rate_hz / 2 * (1 - 1e-9):
        raise InputError(
            f"{argument('noise_spectrum')}: expected densities up to half of the "
            f"rate, {rate_hz / 2:g} Hz, got densities up to {frequency[-1]:g} Hz"
        )
    at = np.fft.rfftfreq(size, 1 / rate_hz)
    fine = np.interp(at, frequency, density) * (rate_hz / 2)
    return np.maximum(fine, DENSITY_FLOOR * fine.mean())


def whitening_taps(noise: NoiseSpectrum, rate_hz: float) -> Float[np.ndarray, " tap"]:
    r"""Return a causal filter after which the noise is white, with variance 1.

    It is the minimum-phase filter of gain $1/\sqrt S$, computed by the cepstrum of the
    gain (Oppenheim and Schafer, Discrete-Time Signal Processing, section 13.5). The
    output does not depend on later samples, so the quiet before an arrival stays quiet.

    Args:
        noise: Spectrum of the noise.
        rate_hz: Sampling rate [Hz].
    """
    # eight times finer than the spectrum: the cepstrum of a coarse one is aliased
    lines = int(np.ceil(8 * rate_hz / float(noise.frequency_hz[1])))
    size = 2 ** int(np.ceil(np.log2(max(lines, 64))))
    cepstrum = np.fft.irfft(-0.5 * np.log(bin_variances(noise, size, rate_hz)), size)
    # folding the cepstrum onto positive times makes the filter causal and of minimum
    # phase, with the same gain
    cepstrum[1 : size // 2] *= 2
    cepstrum[size // 2 + 1 :] = 0.0
    taps = np.fft.irfft(np.exp(np.fft.rfft(cepstrum)), size)
    # a quarter of the circle is twice the window of the spectrum, longer than the
    # response lasts; the rest is aliasing
    return taps[: size // 4]


def correlated(
    samples: Float[np.ndarray, " sample"], taps: Float[np.ndarray, " tap"]
) -> Float[np.ndarray, " output"]:
    """Return the sums of taps times samples at all shifts within the samples."""
    size = fast_length(samples.size)
    product = np.fft.rfft(samples, size) * np.conj(np.fft.rfft(taps, size))
    return np.fft.irfft(product, size)[: samples.size - taps.size + 1]


def fast_length(least: int) -> int:
    """Return a length of at least `least` whose Fourier transform is fast.

    It is a power of two times one of `FAST_FACTORS`, mostly at most a tenth longer.
    """
    return min(n << max(-(-least // n) - 1, 0).bit_length() for n in FAST_FACTORS)


def checked_samples(
    name: str, samples: ArrayLike, least: int = 1
) -> Float[np.ndarray, " sample"]:
    """Return samples as an array of numbers in double precision.

    Args:
        name: Name of the argument, for messages.
        samples: Samples of one channel, in any unit.
        least: Smallest number of samples.

    Raises:
        InputError: They are not one row of numbers, too few, or not finite.
    """
    try:
        row = np.asarray(samples).astype(float, copy=False)
    except (TypeError, ValueError):
        raise InputError(
            f"{argument(name)}: expected numbers, got {shown(samples)}"
        ) from None
    if row.ndim != 1:
        raise InputError(
            f"{argument(name)}: expected one channel, a row of samples, "
            f"got the shape {row.shape}"
        )
    if row.size < least:
        raise InputError(
            f"{argument(name)}: expected at least {least} samples, got {row.size}"
        )
    finite = np.isfinite(row)
    if not finite.all():
        at = int(np.argmin(finite))
        raise InputError(
            f"{argument(name)}: expected finite samples, got {row[at]} at sample {at} "
            f"({row.size - int(finite.sum())} in total)"
        )
    return row


def checked_template(template: ArrayLike) -> Float[np.ndarray, " tap"]:
    """Return the samples of a template.

    Raises:
        InputError: It has no samples, only zeros, or is not finite.
    """
    row = checked_samples("template", template)
    if not np.any(row):
        raise InputError(
            f"{argument('template')}: expected a sound, got {row.size} samples of 0"
        )
    return row


def checked_positive(name: str, value: float, unit: str) -> float:
    """Return a positive finite number.

    Args:
        name: Name of the argument, for messages.
        value: The number.
        unit: Its unit, for messages.

    Raises:
        InputError: The number is not positive or not finite.
    """
    if not (np.isfinite(value) and value > 0):
        raise InputError(
            f"{argument(name)}: expected a positive number [{unit}], got {shown(value)}"
        )
    return float(value)
