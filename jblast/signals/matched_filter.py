r"""The matched filter of a recording or a stream, its threshold, and its peaks.

Of all linear filters over the samples from `before` the template $h$ to `after` it,
$x = a\,h + n$ with $\langle n n^T\rangle = R$, the one with the greatest ratio of
signal to noise is

$$g = \frac{R^{-1} h}{\sqrt{h^T R^{-1} h}}, \qquad
  \frac{2E}{N_0} = a^2\,h^T R^{-1} h$$

(Kay, Fundamentals of Statistical Signal Processing II, eq. 4.16). By the lemma of
Neyman and Pearson no other test detects more blasts of known form at a known time. For
noise $R = \sigma^2 I$ it is the template itself. In coloured noise the samples before
the template predict the noise under it, and have taps although no blast is in them.
The usual division by a spectrum is the same for an endless recording only, and its
filter has no end. Here $R$ is the Toeplitz matrix of the noise, and $R^{-1} h$ comes
from conjugate gradients: products by Fourier transforms, preconditioned by the
circulant of the same spectrum (Chan and Ng, SIAM Review 38 (1996) 427). The filter is
finite, and the best of its length.

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

A maximum above the threshold is a blast if no higher one is within `dead` samples
before it or `wait` samples after it. The filter responds to a blast from `reach`
samples before the arrival to its own length after it. Between samples the output is
interpolated, $y(t) = \sum_k y_k\,\mathrm{sinc}(t-k)$, with a window of sixteen samples
on either side. Its maximum is the arrival, with the Cramér-Rao bound

$$\sigma_t = \frac{1}{\beta \sqrt{2E/N_0}}$$

as standard deviation, where $\beta$ is the rms bandwidth of the template in this noise
(Kay, volume I, eq. 3.14). It holds for blasts of the template's form.

Recordings and streams are filtered in blocks by overlap-save (Oppenheim and Schafer,
Discrete-Time Signal Processing, section 8.7.3), so both have the same output. A stream
reports a blast after `latency_s`, counted from its first sample: the length of the
template, the same time again in which a higher peak may follow, and the block that is
being filled.
"""

import math
from collections.abc import Callable
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
    noise_spectrum as measured_spectrum,
)

RELATIVE_RESIDUAL = 1e-8
"""Relative residual of a solution. Its error changes the signal-to-noise ratio by the
square, 1e-16: the filter is the optimum, where the ratio has no slope."""
MAX_ITERATIONS = 2000
"""Largest number of iterations of conjugate gradients, a convention. Noise whose
spectrum spans too many decades needs more, and raises an error."""
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
BLOCK_S = 0.1
"""Default block of a stream [s], a part of its delay. A second of sound costs 1.1 ms of
a core at 0.1 s and 9 ms at 5 ms (`calibration/results/detector_limits.txt`)."""
LEARN_S = 10.0
"""Default initial part of a stream in which the noise is measured [s], a convention:
its spectrum is an average over more than 200 windows."""
FAST_FACTORS = (1, 3, 5, 9, 15, 25, 27, 45, 75, 81, 125, 135)
"""Odd factors of fast lengths. Without prime factors above 5 all passes of a transform
are fast."""


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
        template_samples: Length of the template.
    """

    taps: Float[np.ndarray, " tap"]
    before: int
    offset: float
    rate_hz: float
    response: float
    phase_step_rad: float
    timing_rad_s: float
    template_samples: int

    @property
    def reach(self) -> int:
        """Number of samples after the arrival that the statistic needs."""
        return self.taps.size - 1 - self.before


class Filtered(NamedTuple):
    """Output of a matched filter.

    Attributes:
        statistic: Statistic for an arrival at each sample of the recording [standard
            deviations of the noise].
        kernel: The filter.
        start: First sample whose statistic depends on the recording alone.
        stop: Sample after the last one. Outside of these the variance of the noise is
            not 1, and no arrivals are searched.
    """

    statistic: Float[np.ndarray, " sample"]
    kernel: MatchedKernel
    start: int
    stop: int


def matched_filter(
    recording: ArrayLike,
    template: ArrayLike,
    rate_hz: float,
    *,
    noise_spectrum: NoiseSpectrum | None = None,
) -> Filtered:
    r"""Filter a recording for a template.

    The statistic $s$ of a blast is that of a test at a known time: $s^2$ estimates
    $2E/N_0$, which in decibels is $20 \log_{10} s$.

    Args:
        recording: Samples of one channel, in any unit.
        template: Samples of the template, of any scale, at the same rate.
        rate_hz: Sampling rate of both [Hz].
        noise_spectrum: Spectrum of the noise in the recording's unit. None to measure
            it in the recording itself; the statistic is then independent of the gain.

    Raises:
        InputError: Template or recording are empty, silent or not finite, or the
            template is longer than the recording.
    """
    shape = checked_template(template)
    samples = checked_samples("recording", recording)
    if samples.size < shape.size:
        raise InputError(
            f"{argument('recording')}: expected at least the {shape.size} samples of "
            f"the template, got {samples.size}"
        )
    if noise_spectrum is None:
        noise_spectrum = measured_spectrum(samples, rate_hz)
    kernel = matched_kernel(shape, rate_hz, noise_spectrum)
    # a short recording has no room for all taps before the template, which predict the
    # noise under it
    if kernel.taps.size > samples.size:
        room_s = (samples.size - shape.size) / rate_hz
        kernel = matched_kernel(shape, rate_hz, noise_spectrum, before_s=room_s)
    return filtered_by(samples, kernel)


def filtered_by(recording: ArrayLike, kernel: MatchedKernel) -> Filtered:
    """Filter a recording with an existing filter.

    Args:
        recording: Samples of one channel, at the filter's rate and in its unit.
        kernel: The filter.

    Raises:
        InputError: The recording is shorter than the filter, or not finite.
    """
    samples = checked_samples("recording", recording, least=kernel.taps.size)
    passed = OverlapSave(kernel.taps, kernel.before)
    first = passed.push(samples - kernel.offset)
    statistic = np.concatenate([first, passed.finish()])
    return Filtered(statistic, kernel, kernel.before, samples.size - kernel.reach)


def matched_kernel(
    template: ArrayLike,
    rate_hz: float,
    noise: NoiseSpectrum,
    *,
    before_s: float | None = None,
    after_s: float = 0.0,
) -> MatchedKernel:
    """Return the best filter for a template in noise.

    Args:
        template: Samples of the template, in any unit.
        rate_hz: Sampling rate [Hz].
        noise: Spectrum of the noise, in the recording's unit.
        before_s: Time before the template that is used to predict the noise [s]. None
            for a quarter of the period of the finest step in frequency, mostly 0.02 s;
            twice as much gains 0.01 dB.
        after_s: Time after the template that is used [s]; a stream waits for it.

    Raises:
        InputError: The template is empty, silent or not finite, or the spectrum is
            invalid.
    """
    shape = checked_template(template)
    rate_hz = checked_positive("rate_hz", rate_hz, "Hz")
    # white noise needs no equations: the filter is the template
    white = np.ptp(noise.density) <= 1e-12 * np.max(noise.density)
    memory_s = 0.0 if white else 0.25 / float(noise.frequency_hz[1])
    before = round((memory_s if before_s is None else before_s) * rate_hz)
    after = round(after_s * rate_hz)
    if before < 0 or after < 0:
        raise InputError(
            f"{argument('before_s')}, {argument('after_s')}: expected times from 0 up "
            f"[s], got {before_s} and {after_s}"
        )
    signal = np.pad(shape / np.abs(shape).max(), (before, after))
    # a Toeplitz matrix is a corner of a circulant of twice its size; and the transform
    # must be fine enough for the lines of the spectrum
    lines = int(np.ceil(4 * rate_hz / float(noise.frequency_hz[1])))
    least = 2 * signal.size if white else max(2 * signal.size, lines)
    size = fast_length(least)
    variances = bin_variances(noise, size, rate_hz)
    if white:
        taps = signal / variances[0]
    else:
        near = bin_variances(noise, signal.size, rate_hz)
        taps = solve_toeplitz(variances, near, signal, size)
    return scaled_kernel(
        taps, signal, np.abs(shape).max(), variances, size, rate_hz
    )._replace(before=before, offset=noise.offset, template_samples=shape.size)


def solve_toeplitz(
    variances: Float[np.ndarray, " bin"],
    near: Float[np.ndarray, " near_bin"],
    right: Float[np.ndarray, " tap"],
    size: int,
) -> Float[np.ndarray, " tap"]:
    """Return the solution of R x = right by conjugate gradients.

    Args:
        variances: Eigenvalues of the circulant of which R is a corner.
        near: Eigenvalues of the circulant of R's own size, the preconditioner.
        right: The right-hand side.
        size: Samples of the larger circulant, at least twice those of R.

    Raises:
        RuntimeError: The iterations do not converge.
    """
    n = right.size

    def covariance(x: np.ndarray) -> np.ndarray:
        return np.fft.irfft(np.fft.rfft(x, size) * variances, size)[:n]

    # the circulant of the same noise differs from the matrix in its corners only, and
    # its inverse costs two transforms (Chan and Ng 1996)
    def precondition(x: np.ndarray) -> np.ndarray:
        return np.fft.irfft(np.fft.rfft(x) / near, n)

    x = np.zeros(n)
    left = right.copy()
    step = z = precondition(left)
    product = left @ z
    target = RELATIVE_RESIDUAL**2 * product
    for _ in range(MAX_ITERATIONS):
        if product <= target:
            return x
        image = covariance(step)
        length = product / (step @ image)
        x = x + length * step
        left = left - length * image
        z = precondition(left)
        product, before = left @ z, product
        step = z + product / before * step
    raise RuntimeError(
        f"the filter for {n} samples has not converged in {MAX_ITERATIONS} iterations: "
        f"expected a relative residual of {RELATIVE_RESIDUAL:g}, got "
        f"{np.sqrt(product / target) * RELATIVE_RESIDUAL:.1g}"
    )


def scaled_kernel(
    taps: Float[np.ndarray, " tap"],
    signal: Float[np.ndarray, " tap"],
    scale: float,
    variances: Float[np.ndarray, " bin"],
    size: int,
    rate_hz: float,
) -> MatchedKernel:
    r"""Return a filter scaled to unit variance, with the rates of its output.

    The error of an arrival is that of the maximum of signal plus noise: the slope of
    the noise over the curvature of the signal. For the best filter it is the
    Cramér-Rao bound.

    Args:
        taps: The filter, of any scale.
        signal: The template in the filter's window, of any scale.
        scale: Factor from the signal to the template as given.
        variances: Variances of the noise's bins.
        size: Samples of their transform.
        rate_hz: Sampling rate [Hz].
    """
    # by Parseval's theorem, without a second filter for the slopes
    omega = 2 * np.pi * np.fft.rfftfreq(size, 1 / rate_hz)
    twice = np.full(omega.size, 2.0 / size)
    twice[0] /= 2
    if size % 2 == 0:
        twice[-1] /= 2
    gain, shape = np.fft.rfft(taps, size), np.fft.rfft(signal, size)
    power = twice * np.abs(gain) ** 2 * variances
    cross = twice * (np.conj(gain) * shape).real
    sigma = np.sqrt(power.sum())
    # (1 - correlation) / 2
    away = np.sum(power * np.sin(omega / (2 * rate_hz)) ** 2)
    slope = np.sqrt(np.sum(omega**2 * power)) / sigma
    curvature = np.sum(omega**2 * cross) / cross.sum()
    return MatchedKernel(
        taps=taps / sigma,
        before=0,
        offset=0.0,
        rate_hz=rate_hz,
        response=float(scale * (taps @ signal) / sigma),
        phase_step_rad=float(2 * np.arcsin(np.sqrt(away / power.sum()))),
        timing_rad_s=float(curvature / slope),
        template_samples=signal.size,
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


class Detection(NamedTuple):
    """One detected blast.

    Attributes:
        time_s: Arrival of the template's first sample, from the first sample on [s].
        sigma_s: Standard deviation of that time [s].
        snr_db: Estimate of 2E/N0 [dB].
        statistic: The same, in standard deviations of the noise.
        template_s: Length of the template [s].
        spread_s: Range of the times by all templates of a bank, each at its loudest
            [s]: none for a sound of their form, large for any other.
    """

    time_s: float
    sigma_s: float
    snr_db: float
    statistic: float
    template_s: float = 0.0
    spread_s: float = 0.0


def detections(
    filtered: Filtered,
    threshold: float,
    *,
    dead_s: float | None = None,
    wait_s: float | None = None,
) -> tuple[Detection, ...]:
    """Return the blasts in a filter's output, in order of time.

    Args:
        filtered: The output.
        threshold: Threshold [standard deviations], positive.
        dead_s: Time after a blast in which lower peaks are ignored [s]; None for the
            length of the filter.
        wait_s: Time before it likewise [s]; None for the length of the template.
    """
    picker = PeakPicker(filtered.kernel, threshold, dead_s=dead_s, wait_s=wait_s)
    inside = filtered.statistic[filtered.start : filtered.stop]
    picker.skip(filtered.start)
    return (*picker.push(inside), *picker.finish())


class PeakPicker:
    """Detector of peaks in a filter's output, block by block in constant memory.

    Attributes:
        settles: Number of outputs after a peak that are needed to accept it.
        threshold: Threshold [standard deviations].
        kernel: The filter.
    """

    def __init__(
        self,
        kernel: MatchedKernel,
        threshold: float,
        *,
        dead_s: float | None = None,
        wait_s: float | None = None,
    ):
        """Create the detector; arguments as in `detections`."""
        self.threshold = checked_positive("threshold", threshold, "standard deviations")
        rate = kernel.rate_hz
        self.kernel = kernel
        for name, time in (("dead_s", dead_s), ("wait_s", wait_s)):
            if time is not None and not 0 <= time < np.inf:
                raise InputError(
                    f"{argument(name)}: expected a time from 0 up [s], got {time}"
                )
        self._dead = kernel.taps.size if dead_s is None else round(dead_s * rate)
        self._wait = kernel.reach if wait_s is None else round(wait_s * rate)
        self.settles = max(self._wait, HALF_WIDTH)
        self._back = max(self._dead, HALF_WIDTH) + 1
        self._buffer = np.zeros(0)
        # number of the first buffered output
        self._first = 0
        # peaks before this output are accepted or rejected
        self._decided = 0

    @property
    def decided(self) -> int:
        """Number of the output before which all peaks are accepted or rejected."""
        return self._decided

    def retune(self, kernel: MatchedKernel, threshold: float) -> None:
        """Continue with the outputs of another filter of the same length."""
        self.kernel, self.threshold = kernel, threshold

    def skip(self, outputs: int) -> None:
        """Skip outputs that are not searched, before any other."""
        self._first += outputs
        self._decided = self._first

    def push(self, outputs: Float[np.ndarray, " new"]) -> tuple[Detection, ...]:
        """Add outputs; return the blasts that are accepted by now."""
        buffer = np.concatenate([self._buffer, outputs])
        until = self._first + buffer.size - self.settles
        found = self._accepted(buffer, until)
        keep = max(until - self._back - self._first, 0)
        # a copy, so that the buffer does not keep the whole block in memory
        self._buffer, self._first = buffer[keep:].copy(), self._first + keep
        return found

    def finish(self) -> tuple[Detection, ...]:
        """Return the remaining blasts at the end of the output."""
        return self._accepted(self._buffer, self._first + self._buffer.size)

    def _accepted(self, buffer: np.ndarray, until: int) -> tuple[Detection, ...]:
        """Return blasts whose peak is undecided and lies before `until`."""
        decided, self._decided = self._decided, max(until, self._decided)
        over = buffer > self.threshold
        if not over.any():
            return ()
        inner = buffer[1:-1]
        rising = (inner > buffer[:-2]) & (inner >= buffer[2:]) & over[1:-1]
        peaks = 1 + np.flatnonzero(rising)
        # reduceat needs an index behind the last peak, at a height that never counts
        heights = np.append(buffer[peaks], -np.inf)
        lo = np.searchsorted(peaks, peaks - self._dead)
        hi = np.searchsorted(peaks, peaks + self._wait, side="right")
        bounds = np.stack([lo, hi], axis=1).ravel()
        highest = np.maximum.reduceat(heights, bounds)[::2] if peaks.size else heights
        # a peak is accepted if none in its window is higher
        stands = heights[:-1] >= highest[: peaks.size]
        pending = (peaks + self._first >= decided) & (peaks + self._first < until)
        accepted = peaks[stands & pending]
        return tuple(self._detection(buffer, int(peak)) for peak in accepted)

    def _detection(self, buffer: np.ndarray, peak: int) -> Detection:
        around = np.arange(peak - HALF_WIDTH, peak + HALF_WIDTH + 1)
        known = (around >= 0) & (around < buffer.size)
        near = np.where(known, buffer[np.clip(around, 0, buffer.size - 1)], 0.0)
        shift, height = between_samples(near)
        kernel = self.kernel
        return Detection(
            time_s=float((self._first + peak + shift) / kernel.rate_hz),
            sigma_s=float(1 / (kernel.timing_rad_s * height)),
            snr_db=in_decibels(height),
            statistic=height,
            template_s=kernel.template_samples / kernel.rate_hz,
        )


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


class Stream:
    """A detector for an unlimited stream of samples; see `stream`.

    Attributes:
        rate_hz: Sampling rate [Hz].
        kernel: The filter; None while the noise is measured.
        threshold: Threshold [standard deviations]; None while the noise is measured.
        statistic: Outputs of the filter by the last push.
    """

    kernel: MatchedKernel | None = None
    threshold: float | None = None

    def __init__(
        self,
        rate_hz: float,
        block: int,
        learn: int,
        begin: Callable[[NoiseSpectrum], PeakPicker],
        noise: NoiseSpectrum | None,
    ):
        """Create the detector.

        Args:
            rate_hz: Sampling rate [Hz].
            block: Number of samples that are filtered together.
            learn: Number of samples in which the noise is measured.
            begin: Function that makes filter and threshold for a noise.
            noise: Spectrum of the noise, or None to measure it.
        """
        self.rate_hz, self._block, self._learn = rate_hz, block, learn
        self._make = begin
        self._waiting: list[np.ndarray] = []
        self._count = 0
        self.statistic: Float[np.ndarray, " output"] = np.zeros(0)
        if noise is not None:
            self._begin(noise)

    @property
    def latency_s(self) -> float | None:
        """Largest delay from the first sample of a blast to its report [s]."""
        if self.kernel is None:
            return None
        later = self.kernel.reach + self._picker.settles + self._block
        return later / self.rate_hz

    def push(self, samples: ArrayLike) -> tuple[Detection, ...]:
        """Add any number of samples; return the blasts that are accepted by now.

        Raises:
            InputError: Samples are not finite. The stream is left unchanged.
        """
        new = checked_samples("samples", samples, least=0)
        # a copy, since callers reuse their buffers
        self._waiting.append(new.copy())
        self._count += new.size
        self.statistic = np.zeros(0)
        if self._count < (self._learn if self.kernel is None else self._block):
            return ()
        if self.kernel is None:
            self._begin(measured_spectrum(np.concatenate(self._waiting), self.rate_hz))
        whole = new if len(self._waiting) == 1 else np.concatenate(self._waiting)
        cut = whole.size - whole.size % self._block
        self._waiting, self._count = [whole[cut:]], whole.size - cut
        return self._filtered(whole[:cut])

    def finish(self) -> tuple[Detection, ...]:
        """Return the remaining blasts at the end of the stream.

        Raises:
            InputError: The stream is too short to measure the noise.
        """
        rest = np.concatenate([np.zeros(0), *self._waiting])
        self._waiting, self._count = [], 0
        if self.kernel is None:
            self._begin(measured_spectrum(rest, self.rate_hz))
        return (*self._filtered(rest), *self._picker.finish())

    def _begin(self, noise: NoiseSpectrum) -> None:
        self._picker = self._make(noise)
        kernel, self.threshold = self._picker.kernel, self._picker.threshold
        self._filter = OverlapSave(kernel.taps, kernel.before, self._block)
        self._picker.skip(kernel.before)
        self.kernel = kernel

    def _filtered(self, samples: Float[np.ndarray, " new"]) -> tuple[Detection, ...]:
        assert self.kernel is not None
        known = self._filter.out
        self.statistic = self._filter.push(samples - self.kernel.offset)
        # the first outputs lack samples before the recording: their noise has less
        # than unit variance, and they are not searched
        early = max(self.kernel.before - known, 0)
        return self._picker.push(self.statistic[early:])


def stream(
    template: ArrayLike,
    rate_hz: float,
    *,
    block_s: float = BLOCK_S,
    threshold: float | None = None,
    false_alarms_per_hour: float = FALSE_ALARMS_PER_HOUR,
    noise_spectrum: NoiseSpectrum | None = None,
    learn_s: float = LEARN_S,
    dead_s: float | None = None,
    wait_s: float | None = None,
) -> Stream:
    """Return a detector to which samples are pushed in blocks.

    Args:
        template: Samples of the template, of any scale.
        rate_hz: Sampling rate of it and of the stream [Hz].
        block_s: Length of sound that is filtered together [s].
        threshold: Threshold [standard deviations]; None to set it by
            `false_alarms_per_hour`.
        false_alarms_per_hour: Mean rate of false alarms [1/h].
        noise_spectrum: Spectrum of the noise, in the stream's unit. None to measure it
            at the beginning of the stream; blasts in that part are reported later.
        learn_s: Length of that part [s].
        dead_s: As in `detections` [s].
        wait_s: As in `detections` [s].

    Raises:
        InputError: The template is silent, empty or not finite, or a time or rate is
            not positive.
    """
    shape = checked_template(template)
    rate_hz = checked_positive("rate_hz", rate_hz, "Hz")
    block = max(round(checked_positive("block_s", block_s, "s") * rate_hz), 1)
    learn = round(checked_positive("learn_s", learn_s, "s") * rate_hz)
    checked_positive("false_alarms_per_hour", false_alarms_per_hour, "1/h")
    if threshold is not None:
        checked_positive("threshold", threshold, "standard deviations")

    def begin(noise: NoiseSpectrum) -> PeakPicker:
        kernel = matched_kernel(shape, rate_hz, noise)
        height = threshold
        if height is None:
            height = threshold_for(kernel, false_alarms_per_hour)
        return PeakPicker(kernel, height, dead_s=dead_s, wait_s=wait_s)

    return Stream(rate_hz, block, learn, begin, noise_spectrum)


def fast_length(least: int) -> int:
    """Return a length of at least `least` whose Fourier transform is fast.

    It is a power of two times one of `FAST_FACTORS`, mostly at most a tenth longer.
    """
    return min(n << max(-(-least // n) - 1, 0).bit_length() for n in FAST_FACTORS)


class OverlapSave:
    """Correlation of a stream of samples with the taps of one filter or several.

    Output k is the sum of `taps[j]` times sample `k - before + j`; samples outside the
    sound count as 0. Several filters of equal length share the transforms of the
    samples, and their outputs are rows.

    Attributes:
        out: Number of outputs returned so far.
    """

    def __init__(
        self, taps: Float[np.ndarray, "*row tap"], before: int, block: int | None = None
    ):
        """Create the filter.

        Args:
            taps: The filter, or filters.
            before: Number of taps before the sample of an output.
            block: Outputs of one transform; None for a number of low cost.
        """
        # a transform yields its length minus the overlap: with four times the taps,
        # three quarters of its outputs are used
        if block is None:
            block = max(3 * taps.shape[-1], 2**15)
        self._overlap = taps.shape[-1] - 1
        self._size = fast_length(self._overlap + block)
        self._block = self._size - self._overlap
        self._buffer = np.zeros(before)
        self._reach = self._overlap - before
        self.out = 0
        self.retune(taps)

    def retune(self, taps: Float[np.ndarray, "*row tap"]) -> None:
        """Use other taps of the same shape from the next output on."""
        self._gain = np.conj(np.fft.rfft(taps, self._size)) / self._size

    def push(
        self, samples: Float[np.ndarray, " new"]
    ) -> Float[np.ndarray, "*row output"]:
        """Add samples; return the outputs that they complete, in order."""
        buffer = np.concatenate([self._buffer, samples])
        ready = max(buffer.size - self._overlap, 0)
        parts = []
        for start in range(0, ready, self._block):
            stop = min(start + self._block, ready)
            spectrum = np.fft.rfft(buffer[start : stop + self._overlap], self._size)
            # the gain contains 1 / size: one product, not two passes
            around = np.fft.irfft(spectrum * self._gain, self._size, norm="forward")
            parts.append(around[..., : stop - start])
        self._buffer = buffer[ready:].copy()
        self.out += ready
        if len(parts) == 1:
            return parts[0]
        none = np.zeros((*self._gain.shape[:-1], 0))
        return np.concatenate([none, *parts], axis=-1)

    def finish(self) -> Float[np.ndarray, "*row output"]:
        """Return the last outputs, so that there are as many as samples."""
        return self.push(np.zeros(self._reach))
