r"""The matched filter of a recording or a stream, and its threshold.

Of all linear filters over the samples up to the end of a template $h$, in
$x = a\,h + n$ with $\langle n n^T\rangle = R$, the one with the greatest ratio of
signal to noise is

$$g = \frac{R^{-1} h}{\sqrt{h^T R^{-1} h}}, \qquad
  \frac{2E}{N_0} = a^2\,h^T R^{-1} h$$

(Kay, Fundamentals of Statistical Signal Processing II, eq. 4.16). By the lemma of
Neyman and Pearson no other test detects more blasts of known form at a known time. A
causal filter $w$ that whitens the noise (`noise.whitening_taps`) factors
$R^{-1} = W^T W$: the test is the correlation of the whitened samples with the whitened
template, which is cut at its end as samples after it are not used, and divided by its
length. In coloured noise the samples before the template predict the noise under it,
and have taps although no blast is in them. For white noise the filter is the template.

Parab's thesis, algorithm 6, is the special case of white noise. As printed it is a
circular convolution, in which a blast at the end of the recording appears at its
beginning, and it has no threshold. Here the output is in standard deviations of the
noise, and therefore independent of the microphone's gain.

A false alarm is an upcrossing of the threshold $u$ by the output for noise alone. For
Gaussian noise whose neighbouring outputs have the correlation $\cos\varphi_1$ its rate
is exactly

$$\nu(u) = \frac{f_s}{2\pi} \int_0^{\varphi_1}
  \exp\!\left(-\frac{u^2}{1 + \cos\varphi}\right) d\varphi$$

(the bivariate normal distribution as an integral over its correlation, Drezner and
Wesolowsky 1990). For highly correlated outputs it is Rice's $\nu_0 e^{-u^2/2}$ (1945,
Bell System Technical Journal 24, eq. 3.3-11), with $\nu_0 = f_s \varphi_1/2\pi$
upcrossings of zero. If the noise fills the sampled band it is half as large at $u = 6$,
because crossings between two samples are not seen. The rate holds for steady noise
only.

Between samples the output is interpolated, $y(t) = \sum_k y_k\,\mathrm{sinc}(t-k)$,
with a window of sixteen samples on either side. Its maximum is the arrival, with the
Cramér-Rao bound

$$\sigma_t = \frac{1}{\beta \sqrt{2E/N_0}}$$

as standard deviation, where $\beta$ is the rms bandwidth of the template in this noise
(Kay, volume I, eq. 3.14). It holds for blasts of the template's form.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from jblast.errors import InputError, argument
from jblast.signals.noise import (
    NoiseSpectrum,
    bin_variances,
    checked_positive,
    checked_samples,
    checked_template,
    correlated,
    fast_length,
    whitening_taps,
)

MEMORY_LINES = 0.5
"""Length of the whitening filter over the period of the finest step in frequency: half
a window of the spectrum, 43 ms. Twice as much gains 0.02 dB in hum on single lines, and
under 0.001 dB in pink noise, wind and traffic; half as much loses 0.4 dB in hum."""
HOUR_S = 3600.0
"""Seconds per hour."""
FALSE_ALARMS_PER_HOUR = 1.0
"""Default rate of false alarms of each channel, a convention."""
THRESHOLD_ACCURACY = 1e-9
"""Accuracy of a threshold [standard deviations]: at 6 it changes the rate of false
alarms by 6e-9 of itself."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)
"""Gauss-Legendre nodes for the mean over the phase in Rice's formula, whose integrand
is smooth."""
HALF_WIDTH = 16
"""Samples on either side from which a value between samples is interpolated. From 20 dB
on, errors of arrivals are the Cramer-Rao bound within 2 %
(`calibration/results/detector_limits.txt`)."""
PARTS_OF_SAMPLE = 32
"""Parts of a sample among which the maximum is searched before a parabola through three
of them: its error is then below a thousandth of a sample."""
# band-limited interpolation, tabulated once: arrivals are needed to parts of a sample
_OFFSETS = np.arange(-PARTS_OF_SAMPLE, PARTS_OF_SAMPLE + 1) / PARTS_OF_SAMPLE
_AWAY = _OFFSETS[:, None] - np.arange(-HALF_WIDTH, HALF_WIDTH + 1)
_WINDOWED = np.sinc(_AWAY) * np.cos(0.5 * np.pi * _AWAY / (HALF_WIDTH + 1)).clip(0) ** 3
_INTERPOLATION = _WINDOWED / _WINDOWED.sum(axis=1, keepdims=True)
"""Matrix from samples to parts of a sample. A window less smooth than the cube of a
cosine has ripples that move the flat maximum of a slow pulse by a tenth of a sample."""


class MatchedKernel(NamedTuple):
    r"""A filter whose output is the statistic, in standard deviations of the noise.

    The output at sample k is the sum of `taps[j]` times sample `k - before + j`.

    Attributes:
        taps: Taps scaled to an output of variance 1 for noise alone.
        before: Number of taps before the template's first sample.
        offset: Mean of the noise, subtracted from the samples.
        rate_hz: Sampling rate [Hz].
        response: Output for the template as given, $\sqrt{2E/N_0}$.
        phase_step_rad: Angle whose cosine is the correlation of two neighbouring
            outputs for noise: 2 pi times the upcrossings of zero per sample.
        timing_rad_s: $\beta$: the standard deviation of an arrival with statistic $s$
            is $1/(\beta s)$.
    """

    taps: Float[np.ndarray, " tap"]
    before: int
    offset: float
    rate_hz: float
    response: float
    phase_step_rad: float
    timing_rad_s: float

    @property
    def reach(self) -> int:
        """Number of samples after the arrival that the statistic needs."""
        return self.taps.size - 1 - self.before


def filtered(samples: ArrayLike, kernel: MatchedKernel) -> Float[np.ndarray, " sample"]:
    """Return the statistic for an arrival at each sample of a recording.

    The first `kernel.before` and the last `kernel.reach` outputs lack samples, and the
    variance of their noise is not 1.

    Args:
        samples: Samples of one channel, at the filter's rate and in its unit.
        kernel: The filter.

    Raises:
        InputError: The recording is shorter than the filter, or not finite.
    """
    recording = checked_samples("recording", samples, least=kernel.taps.size)
    padded = np.pad(recording - kernel.offset, (kernel.before, kernel.reach))
    return correlated(padded, kernel.taps)


def matched_kernel(
    template: ArrayLike, rate_hz: float, noise: NoiseSpectrum
) -> MatchedKernel:
    """Return the best filter for a template in noise, of the samples up to its end.

    Args:
        template: Samples of the template, in any unit.
        rate_hz: Sampling rate [Hz].
        noise: Spectrum of the noise, in the recording's unit.

    Raises:
        InputError: The template is empty, silent or not finite, or the spectrum is
            invalid.
    """
    shape = checked_template(template)
    rate_hz = checked_positive("rate_hz", rate_hz, "Hz")
    lines = rate_hz / float(noise.frequency_hz[1])
    before = max(round(MEMORY_LINES * lines) - 1, 0)
    # without wrapping, and fine enough for the lines of the spectrum
    size = fast_length(max(shape.size + 2 * before + 2, math.ceil(4 * lines)))
    variances = bin_variances(noise, size, rate_hz)
    whitening = np.fft.rfft(whitening_taps(noise, rate_hz)[: before + 1], size)
    signal = np.fft.rfft(shape, size)
    white = np.fft.irfft(signal * whitening, size)[: shape.size]
    gain = np.fft.rfft(white, size) * np.conj(whitening)
    power, response = np.abs(gain) ** 2 * variances, np.conj(gain) * signal
    # by Parseval's theorem: variance, neighbouring covariance, and slopes of the noise;
    # height and curvature of the response to the template
    variance, neighbour = np.fft.irfft(power, size)[:2]
    squared = (2 * np.pi * np.fft.rfftfreq(size, 1 / rate_hz)) ** 2
    slope, height, curvature = (
        float(np.fft.irfft(part, size)[0])
        for part in (squared * power, response, squared * response)
    )
    sigma = math.sqrt(variance)
    taps = np.roll(np.fft.irfft(gain, size), before)[: before + shape.size]
    return MatchedKernel(
        taps=taps / sigma,
        before=before,
        offset=noise.offset,
        rate_hz=rate_hz,
        response=height / sigma,
        phase_step_rad=float(np.arccos(np.clip(neighbour / variance, -1.0, 1.0))),
        timing_rad_s=curvature / height / math.sqrt(slope / variance),
    )


def threshold_for(
    kernel: MatchedKernel, false_alarms_per_hour: float = FALSE_ALARMS_PER_HOUR
) -> float:
    """Return the threshold of a statistic, in standard deviations.

    Args:
        kernel: The filter.
        false_alarms_per_hour: Mean rate of false alarms [1/h].

    Raises:
        InputError: The rate is not positive, or as high as that of the noise itself.
    """
    rate = checked_positive("false_alarms_per_hour", false_alarms_per_hour, "1/h")
    most = false_alarms_at(kernel, 0.0)
    if rate >= most:
        raise InputError(
            f"{argument('false_alarms_per_hour')}: expected less than the zero "
            f"upcrossings of the noise, {most:.3g} per hour, got {rate:g}"
        )
    # Rice's threshold is an upper bound: crossings between samples are not seen
    low, high = 0.0, math.sqrt(2 * math.log(most / rate))
    while high - low > THRESHOLD_ACCURACY:
        middle = 0.5 * (low + high)
        if false_alarms_at(kernel, middle) > rate:
            low = middle
        else:
            high = middle
    return high


def false_alarms_at(kernel: MatchedKernel, threshold: float) -> float:
    """Return the rate at which noise alone crosses a threshold upwards [1/h].

    Args:
        kernel: The filter.
        threshold: Threshold [standard deviations], not negative.
    """
    # exp(-u^2 / (1 + cos p)) over its value at p = 0, so that high thresholds do not
    # underflow inside the mean
    phase = 0.5 * kernel.phase_step_rad * (1 + _NODES)
    fall = np.exp(-0.5 * threshold**2 * np.tan(phase / 2) ** 2)
    mean = 0.5 * float(_WEIGHTS @ fall)
    rate_hz = kernel.rate_hz * kernel.phase_step_rad / (2 * math.pi)
    return HOUR_S * rate_hz * mean * math.exp(-0.5 * threshold**2)


def in_decibels(statistic: float) -> float:
    """Return the signal-to-noise ratio 2E/N0 of a statistic in sigmas [dB]."""
    return 20 * math.log10(statistic)


def between_samples(near: Float[np.ndarray, " sample"]) -> tuple[float, float]:
    """Return the offset of a maximum from the middle sample [samples], and its height.

    Args:
        near: The samples around the highest, `HALF_WIDTH` on either side.
    """
    fine = _INTERPOLATION @ near
    top = int(np.clip(np.argmax(fine), 1, fine.size - 2))
    low, mid, high = fine[top - 1 : top + 2]
    bend = 2 * mid - low - high
    part = 0.5 * (high - low) / bend if bend > 0 else 0.0
    height = mid + 0.25 * (high - low) * part
    return float(_OFFSETS[top] + part / PARTS_OF_SAMPLE), float(height)
