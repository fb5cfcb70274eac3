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
only; `unsteadiness` measures how steady it is.

A maximum above the threshold is a blast if no higher one is within `dead` samples
before it or `wait` samples after it; the filter responds to a blast from `reach`
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
    noise_spectrum as measured_spectrum,
)
from jblast.signals.samples import checked_positive, checked_samples, checked_template

RESIDUAL = 1e-8
"""Of a solution, relative: a share of 1e-16 of the signal-to-noise ratio."""
MOST_ROUNDS = 2000
"""Most rounds of conjugate gradients; declared. Noise whose spectrum spans too many
decades needs more, and is refused."""
HOUR_S = 3600.0
"""Seconds of an hour."""
FALSE_ALARMS_PER_HOUR = 1.0
"""Default of each channel; declared."""
ACCURACY = 1e-9
"""Of a threshold, in standard deviations: far below what moves the rate of alarms."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)
"""Of the mean over the phase in Rice's formula; its integrand is smooth."""
HALF_WIDTH = 16
"""Samples either side that a value between samples is made of."""
FINE = 32
"""Parts of a sample in which the maximum is looked for before a parabola is laid."""
# band-limited interpolation, tabulated once: an arrival is needed to parts of a sample
_OFFSETS = np.arange(-FINE, FINE + 1) / FINE
_AWAY = _OFFSETS[:, None] - np.arange(-HALF_WIDTH, HALF_WIDTH + 1)
_WINDOWED = np.sinc(_AWAY) * np.cos(0.5 * np.pi * _AWAY / (HALF_WIDTH + 1)).clip(0) ** 3
_INTERPOLATION = _WINDOWED / _WINDOWED.sum(axis=1, keepdims=True)
"""From samples to parts of a sample. A window less smooth than the cube of a cosine has
ripples that move the flat maximum of a slow pulse by a tenth of a sample."""
BLOCK_S = 0.1
"""Default of a stream, and so its delay [s]; declared."""
LEARN_S = 10.0
"""Default for the part of a stream that its noise is measured in [s]; declared."""
ODD = (1, 3, 5, 9, 15, 25, 27, 45, 75, 81, 125, 135)
"""Factors of fast lengths: without prime factors above 5 the transform has no slow
pass."""


class MatchedKernel(NamedTuple):
    r"""A filter whose output is the statistic, in standard deviations of the noise.

    The output at sample k is the sum of `taps[j]` times sample `k - before + j`.

    Attributes:
        taps: Scaled so that noise alone comes out with variance 1.
        before: So many taps stand before the template's first sample.
        offset: Mean of the noise, taken from the samples first.
        rate_hz: Sampling rate [Hz].
        response: Output for the template as given: $\sqrt{2E/N_0}$.
        phase_step_rad: Angle whose cosine is the correlation of two neighbouring
            outputs for noise: 2 pi times the upcrossings of zero a sample.
        timing_rad_s: $\beta$: an arrival heard at s sigmas is known to $1/(\beta s)$.
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
        """Samples after the arrival that the statistic needs."""
        return self.taps.size - 1 - self.before


class Filtered(NamedTuple):
    """Output of a matched filter.

    Attributes:
        statistic: One for each sample of the recording: how strongly it speaks for the
            template's first sample landing there, in standard deviations of the noise.
        kernel: The filter.
        start: First sample whose statistic saw the recording alone.
        stop: Sample after the last such one. Outside of these the noise is not known
            to have variance 1, and nothing is searched for.
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
        template: Samples of what is looked for, of any scale, at the same rate.
        rate_hz: Sampling rate of both [Hz].
        noise_spectrum: Of the noise, in the recording's unit; none to measure it in the
            recording itself, after which no gain changes the statistic.

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
    if kernel.taps.size > samples.size:  # no room for all the noise that foretells
        room_s = (samples.size - shape.size) / rate_hz
        kernel = matched_kernel(shape, rate_hz, noise_spectrum, before_s=room_s)
    return filtered_by(samples, kernel)


def unsteadiness(filtered: Filtered, stretch_s: float = 0.1) -> float:
    """Return the deviation of a statistic in its loudest tenth over that of the rest.

    Near 1 for noise that is steady; thresholds hold for such. From 1.4 on gusts, birds
    or loud blasts are in the recording, and false alarms are at least twice as
    frequent as requested.

    Args:
        filtered: What came out of a filter.
        stretch_s: How long the stretches are that are compared [s].

    Raises:
        InputError: There are fewer than ten.
    """
    inside = filtered.statistic[filtered.start : filtered.stop]
    size = max(round(stretch_s * filtered.kernel.rate_hz), 1)
    count = inside.size // size
    if count < 10:
        raise InputError(
            f"{argument('stretch_s')}: expected ten stretches within "
            f"{inside.size / filtered.kernel.rate_hz:.3g} s, got {stretch_s:g} s"
        )
    rows = inside[: count * size].reshape(count, size)
    power = np.sort(np.mean(rows**2, axis=1))
    loud = max(count // 10, 1)
    return float(np.sqrt(power[-loud:].mean() / power[:-loud].mean()))


def filtered_by(recording: ArrayLike, kernel: MatchedKernel) -> Filtered:
    """Filter a recording with a filter made before.

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
        template: Its samples, in the recording's unit or any other.
        rate_hz: Sampling rate [Hz].
        noise: Its spectrum, in the recording's unit.
        before_s: So much of the noise before the template is made use of [s]; none for
            as long as the noise remembers: a quarter of a period of its finest step in
            frequency, mostly 0.02 s; twice as much gains 0.01 dB.
        after_s: And after it [s], which a stream waits for.

    Raises:
        InputError: The template is empty, silent or not finite, or the spectrum is not
            one.
    """
    shape = checked_template(template)
    rate_hz = checked_positive("rate_hz", rate_hz, "Hz")
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
    # long enough for the matrix, and fine enough for the lines of the spectrum
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
        variances: Eigenvalues of the circulant that R is a corner of.
        near: Of the circulant of R's own size, the preconditioner.
        right: The right-hand side.
        size: Samples of the larger circulant, at least twice those of R.

    Raises:
        RuntimeError: It does not converge.
    """
    n = right.size

    def covariance(x: np.ndarray) -> np.ndarray:
        return np.fft.irfft(np.fft.rfft(x, size) * variances, size)[:n]

    # the circulant of the same noise: close to the matrix but for its corners, and its
    # inverse is two transforms
    def precondition(x: np.ndarray) -> np.ndarray:
        return np.fft.irfft(np.fft.rfft(x) / near, n)

    x = np.zeros(n)
    left = right.copy()
    step = z = precondition(left)
    product = left @ z
    target = RESIDUAL**2 * product
    for _ in range(MOST_ROUNDS):
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
        f"the filter for {n} samples has not converged in {MOST_ROUNDS} rounds: "
        f"{np.sqrt(product / target) * RESIDUAL:.1g} left, {RESIDUAL:g} wanted"
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

    The arrival's error is that of the maximum of signal and noise: the slope of the
    noise over the curvature of the signal, which for the best filter is the bound of
    Cramér and Rao.

    Args:
        taps: The filter, of any scale.
        signal: The template in the filter's window, of any scale.
        scale: What the signal is to be multiplied by for the template as given.
        variances: Of the noise's bins.
        size: Samples of their transform.
        rate_hz: Sampling rate [Hz].
    """
    # by the spectrum (Parseval): no second filter for the slopes
    omega = 2 * np.pi * np.fft.rfftfreq(size, 1 / rate_hz)
    twice = np.full(omega.size, 2.0 / size)
    twice[0] /= 2
    if size % 2 == 0:
        twice[-1] /= 2
    gain, shape = np.fft.rfft(taps, size), np.fft.rfft(signal, size)
    power = twice * np.abs(gain) ** 2 * variances
    cross = twice * (np.conj(gain) * shape).real
    sigma = np.sqrt(power.sum())
    away = np.sum(power * np.sin(omega / (2 * rate_hz)) ** 2)  # (1 - correlation) / 2
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
        kernel: The filter it comes from.
        false_alarms_per_hour: How many of them on average [1/h].

    Raises:
        InputError: The rate is not positive, or as high as that of the noise itself.
    """
    rate = checked_positive("false_alarms_per_hour", false_alarms_per_hour, "1/h")
    most = false_alarms_at(kernel, 0.0)
    if rate >= most:
        raise InputError(
            f"{argument('false_alarms_per_hour')}: expected less than the noise rises "
            f"through 0, {most:.3g} an hour, got {rate:g}"
        )
    low, high = 0.0, math.sqrt(2 * math.log(most / rate))  # Rice's is never below
    while high - low > ACCURACY:
        middle = 0.5 * (low + high)
        if false_alarms_at(kernel, middle) > rate:
            low = middle
        else:
            high = middle
    return high


def false_alarms_at(kernel: MatchedKernel, threshold: float) -> float:
    """Return how often noise alone rises through a threshold [1/h].

    Args:
        kernel: The filter.
        threshold: In standard deviations, from 0 up.
    """
    # exp(-u^2 / (1 + cos p)) without its value at 0, which may underflow
    phase = 0.5 * kernel.phase_step_rad * (1 + _NODES)
    fall = np.exp(-0.5 * threshold**2 * np.tan(phase / 2) ** 2)
    mean = 0.5 * float(_WEIGHTS @ fall)
    rate_hz = kernel.rate_hz * kernel.phase_step_rad / (2 * math.pi)
    return HOUR_S * rate_hz * mean * math.exp(-0.5 * threshold**2)


def in_decibels(statistic: float) -> float:
    """Return the signal-to-noise ratio 2E/N0 of a statistic in sigmas [dB]."""
    return 20 * math.log10(statistic)


class Detection(NamedTuple):
    """One blast that was heard.

    Attributes:
        time_s: When the template's first sample lands, from the first sample on [s].
        sigma_s: Standard deviation of that time [s].
        snr_db: 2E/N0 as estimated [dB].
        statistic: The same, in standard deviations of the noise.
    """

    time_s: float
    sigma_s: float
    snr_db: float
    statistic: float


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
        threshold: In standard deviations, positive.
        dead_s: A blast silences lower peaks so long after it [s]; none for the length
            of the filter.
        wait_s: And so long before it [s]; none for the length of the template.
    """
    picker = PeakPicker(filtered.kernel, threshold, dead_s=dead_s, wait_s=wait_s)
    inside = filtered.statistic[filtered.start : filtered.stop]
    picker.skip(filtered.start)
    return (*picker.push(inside), *picker.finish())


class PeakPicker:
    """Picks blasts from a filter's output as it comes, in constant memory.

    Attributes:
        settles: Outputs after a peak that have to be known before it counts.
        threshold: In standard deviations.
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
        """Get ready; arguments as in `detections`."""
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
        self._held = np.zeros(0)
        self._first = 0  # where the held outputs begin
        self._judged = 0  # peaks before this one have been settled

    def skip(self, outputs: int) -> None:
        """Pass over outputs that are not to be searched, before any other."""
        self._first += outputs
        self._judged = self._first

    def push(self, outputs: Float[np.ndarray, " new"]) -> tuple[Detection, ...]:
        """Take in outputs; return the blasts that are now settled."""
        held = np.concatenate([self._held, outputs])
        until = self._first + held.size - self.settles
        found = self._settled(held, until)
        keep = max(until - self._back - self._first, 0)
        self._held, self._first = held[keep:].copy(), self._first + keep
        return found

    def finish(self) -> tuple[Detection, ...]:
        """Return the blasts that the end left unsettled."""
        return self._settled(self._held, self._first + self._held.size)

    def _settled(self, held: np.ndarray, until: int) -> tuple[Detection, ...]:
        """Return blasts whose peak lies from the last one judged to before `until`."""
        judged, self._judged = self._judged, max(until, self._judged)
        over = held > self.threshold
        if not over.any():
            return ()
        inner = held[1:-1]
        rising = (inner > held[:-2]) & (inner >= held[2:]) & over[1:-1]
        peaks = 1 + np.flatnonzero(rising)
        heights = np.append(held[peaks], -np.inf)
        lo = np.searchsorted(peaks, peaks - self._dead)
        hi = np.searchsorted(peaks, peaks + self._wait, side="right")
        bounds = np.stack([lo, hi], axis=1).ravel()
        highest = np.maximum.reduceat(heights, bounds)[::2] if peaks.size else heights
        # of equals the first; none higher, and none as high before
        stands = heights[:-1] >= highest[: peaks.size]
        mine = (peaks + self._first >= judged) & (peaks + self._first < until)
        return tuple(self._detection(held, int(peak)) for peak in peaks[stands & mine])

    def _detection(self, held: np.ndarray, peak: int) -> Detection:
        around = np.arange(peak - HALF_WIDTH, peak + HALF_WIDTH + 1)
        known = (around >= 0) & (around < held.size)
        near = np.where(known, held[np.clip(around, 0, held.size - 1)], 0.0)
        shift, height = between_samples(near)
        kernel = self.kernel
        return Detection(
            time_s=float((self._first + peak + shift) / kernel.rate_hz),
            sigma_s=float(1 / (kernel.timing_rad_s * height)),
            snr_db=in_decibels(height),
            statistic=height,
        )


def between_samples(near: Float[np.ndarray, " sample"]) -> tuple[float, float]:
    """Return where a maximum lies from the middle sample on [samples], and its height.

    Args:
        near: The samples around the highest, `HALF_WIDTH` either side of it.
    """
    fine = _INTERPOLATION @ near
    top = int(np.clip(np.argmax(fine), 1, fine.size - 2))
    low, mid, high = fine[top - 1 : top + 2]
    bend = 2 * mid - low - high
    part = 0.5 * (high - low) / bend if bend > 0 else 0.0
    height = mid + 0.25 * (high - low) * part
    return float(_OFFSETS[top] + part / FINE), float(height)


class Stream:
    """A detector that listens for ever; `stream` makes it.

    Attributes:
        rate_hz: Sampling rate [Hz].
        kernel: Its filter; none while it learns what the noise is.
        threshold: In standard deviations; none while it learns.
        statistic: Outputs of the filter that the last push made known.
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
        """Get ready.

        Args:
            rate_hz: Sampling rate [Hz].
            block: Samples that are filtered at a time.
            learn: Samples that the noise is measured in.
            begin: Makes filter and threshold for a noise.
            noise: Spectrum of the noise, or none to measure it.
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
        """From the first sample of a blast to its report, at most [s]."""
        if self.kernel is None:
            return None
        later = self.kernel.reach + self._picker.settles + self._block
        return later / self.rate_hz

    def push(self, samples: ArrayLike) -> tuple[Detection, ...]:
        """Take in samples, however many; return the blasts that are now settled.

        Raises:
            InputError: Samples are not finite. The stream is as it was before them.
        """
        new = checked_samples("samples", samples, least=0)
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
        return self._heard(whole[:cut])

    def finish(self) -> tuple[Detection, ...]:
        """Return the blasts that were still unsettled: the stream is over.

        Raises:
            InputError: It ended before there was enough of it to know the noise.
        """
        rest = np.concatenate([np.zeros(0), *self._waiting])
        self._waiting, self._count = [], 0
        if self.kernel is None:
            self._begin(measured_spectrum(rest, self.rate_hz))
        return (*self._heard(rest), *self._picker.finish())

    def _begin(self, noise: NoiseSpectrum) -> None:
        self._picker = self._make(noise)
        kernel, self.threshold = self._picker.kernel, self._picker.threshold
        self._filter = OverlapSave(kernel.taps, kernel.before, self._block)
        self._picker.skip(kernel.before)
        self.kernel = kernel

    def _heard(self, samples: Float[np.ndarray, " new"]) -> tuple[Detection, ...]:
        assert self.kernel is not None
        known = self._filter.out
        self.statistic = self._filter.push(samples - self.kernel.offset)
        # outputs before the first whole one are not searched
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
    """Return a detector to which samples are pushed as they come.

    Args:
        template: Samples of what is listened for, of any scale.
        rate_hz: Sampling rate of it and of the stream [Hz].
        block_s: So much sound is filtered at a time [s].
        threshold: In standard deviations; none to set it by the next.
        false_alarms_per_hour: How many on average [1/h].
        noise_spectrum: Of the noise, in the stream's unit; none to measure it in the
            first of the stream, in which blasts are found, too, but later.
        learn_s: So much of it [s].
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
    """Return a length from `least` up whose Fourier transform is quick.

    A power of two times one of `ODD`: mostly at most a tenth longer than requested.
    """
    return min(n << max(-(-least // n) - 1, 0).bit_length() for n in ODD)


class OverlapSave:
    """Correlates samples with a row of taps as they come.

    Output k is the sum of `taps[j]` times sample `k - before + j`; samples outside the
    sound count as 0.

    Attributes:
        out: Outputs handed back so far.
    """

    def __init__(
        self, taps: Float[np.ndarray, " tap"], before: int, block: int | None = None
    ):
        """Get ready.

        Args:
            taps: The filter.
            before: So many of its taps stand before the sample that an output is for.
            block: Outputs of one transform; none for a number that is cheap.
        """
        if block is None:
            block = max(3 * taps.size, 2**15)
        self._overlap = taps.size - 1
        self._size = fast_length(self._overlap + block)
        self._block = self._size - self._overlap
        self._gain = np.conj(np.fft.rfft(taps, self._size)) / self._size
        self._held = np.zeros(before)
        self._reach = taps.size - 1 - before
        self.out = 0

    def push(self, samples: Float[np.ndarray, " new"]) -> Float[np.ndarray, " output"]:
        """Take in samples; return the outputs that are now known, in order."""
        held = np.concatenate([self._held, samples])
        ready = max(held.size - self._overlap, 0)
        parts = []
        for start in range(0, ready, self._block):
            stop = min(start + self._block, ready)
            spectrum = np.fft.rfft(held[start : stop + self._overlap], self._size)
            spectrum *= self._gain
            around = np.fft.irfft(spectrum, self._size, norm="forward")
            parts.append(around[: stop - start])
        self._held = held[ready:].copy()
        self.out += ready
        return parts[0] if len(parts) == 1 else np.concatenate([np.zeros(0), *parts])

    def finish(self) -> Float[np.ndarray, " output"]:
        """Return the last outputs: with them there are as many as samples came."""
        return self.push(np.zeros(self._reach))
