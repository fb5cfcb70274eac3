r"""Live sound searched for blasts, with a bank of pulses, in bounded memory.

The search is that of `search.search_bank`, in blocks of two windows of the noise's
spectrum, 0.1 to 0.2 s. Packets may have any size: the blocks, and with them all
outputs, do not depend on it. The filters of all pulses share the transform of a block.

The noise is learnt from the first second, by the median over windows, which a blast in
it hardly changes. It is refined as more of it is known (`noise.NoiseFollower`), without
the sound around arrivals. Later the filters are computed again if the noise has
changed. In addition an arrival must exceed the threshold in the noise just before it
(`PulseFit.loud`).

An estimate of the noise over few seconds has an error, which would increase the rate of
false alarms. An output in true standard deviations crosses $u$ upwards at a rate
proportional to $e^{-u^2/2}$ (Rice 1945). If the variance is estimated with $\nu$
degrees of freedom, the mean over $\chi^2_\nu$ of that rate is that of Student's t,

$$\left(1 + \frac{u_\nu^2}{\nu}\right)^{-\nu/2} = e^{-u^2/2}
\quad\Rightarrow\quad u_\nu^2 = \nu\left(e^{u^2/\nu} - 1\right)$$

with $\nu = 2 W T$ for an output of the equivalent bandwidth $W$ and noise over the time
$T$. The threshold is raised to $u_\nu$.

An exactly silent beginning has no noise. The density is therefore at least that of
white noise of a given level; sound above it is learnt when it begins.

An arrival is reported when no louder one can follow within the longest pulse, of which
the filter needs all samples: after twice the longest pulse and up to a block, or when
the noise is learnt. Packets add their own length.
"""

import math
from collections.abc import Sequence
from itertools import compress
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from jblast.errors import InputError
from jblast.signals.matched_filter import (
    FALSE_ALARMS_PER_HOUR,
    HALF_WIDTH,
    Detection,
    MatchedKernel,
    OverlapSave,
    PeakPicker,
    fast_length,
    matched_kernel,
    threshold_for,
)
from jblast.signals.noise import (
    MEMORY_S,
    RELEARN_S,
    NoiseFollower,
    NoiseSpectrum,
    bin_variances,
    checked_samples,
    noise_spectrum,
    white_noise,
    window_size,
)
from jblast.signals.pulse_fit import AFTER_S, BEFORE_S, LEVEL_S, PulseFit, PulseTest
from jblast.signals.search import (
    CHAIN_S,
    MASKED_LENGTHS,
    OTHER_FRONT,
    SAME_FRONT,
    Channel,
    Loudest,
    Searched,
    with_front,
)

LEARN_S = 1.0
"""First part of a stream, in which the noise is learnt [s]: its median is worth the
mean of ten windows. The first thresholds of short pulses are 1.1 times as high as later
ones, of the longest pulses 2.2 times."""
MEDIAN_SHARE = 0.48
"""Variance of the mean of exponential variables over that of their scaled median: the
share of the time that a median is worth."""
REFINED = 3.0
"""Ratio of the known length of noise to that of the filters at which these are computed
again, until `MEMORY_S` is reached."""
DRIFT = 0.1
"""Relative change of an output's standard deviation at which filters are computed again
later. The rate of false alarms is then up to 30 times or a fortieth of the requested
one; at once the threshold in the noise just before an arrival corrects it."""
LEAST_NOISE = 20e-6
"""Smallest standard deviation of noise: the hearing threshold of 20 uPa for samples in
pascals, two thirds of a step of 16 bits for samples of full scale 1."""
RECORDED_NOISE = 1e-5
"""The same over the standard deviation of a whole recording, in any unit."""
MAX_WINDOWS = 4
"""Largest number of pulses whose models of the form test are stored, up to 20 MB each
at 48 kHz."""


class LiveDetection(NamedTuple):
    """An arrival that is reported.

    Attributes:
        arrival: Time from the first sample of the stream, sigma and statistic.
        fit: Goodness of fit of a blast's form.
        member: Number of the template.
        reported: Number of samples of the stream at the report.
    """

    arrival: Detection
    fit: PulseFit
    member: int
    reported: int


class SoundWatch:
    """Search of an unlimited stream of samples for blasts of any duration.

    Args:
        templates: Templates at the stream's rate (`bank_of_pulses`).
        rate_hz: Sampling rate [Hz].
        false_alarms_per_hour: Mean rate of false alarms of all together [1/h].
        front_samples: Error of an arrival by its front [samples].
        any_form: True to accept arrivals of any form.
        noise: Spectrum of the noise, which is then not followed; None to learn it.
        least_noise: Smallest standard deviation of the noise, in the stream's unit.

    Attributes:
        rate_hz: Sampling rate [Hz].
        rejected: Arrivals of another form, by the last push.
        statistic: Largest outputs of all filters, by the last push.
        kernels: Filters; empty while the noise is learnt.
        thresholds: Their thresholds [standard deviations of the noise].
        noise: Present estimate of the noise; None while it is learnt.

    Raises:
        InputError: Templates or numbers cannot be used.
    """

    def __init__(
        self,
        templates: Sequence[np.ndarray],
        rate_hz: float,
        false_alarms_per_hour: float = FALSE_ALARMS_PER_HOUR,
        *,
        front_samples: float = OTHER_FRONT,
        any_form: bool = False,
        noise: NoiseSpectrum | None = None,
        least_noise: float = LEAST_NOISE,
    ):
        self._templates, self.rate_hz = templates, rate_hz
        # by Bonferroni: alarms of the bank are at most the sum of the members'
        self._share = false_alarms_per_hour / len(templates)
        self._front_s, self._any_form = front_samples / rate_hz, any_form
        self._floor = float(white_noise(least_noise, rate_hz).density[0])
        size = window_size(rate_hz)
        self._block, self._before = 2 * size, size // 4
        self._learn = self._block * math.ceil(LEARN_S * rate_hz / self._block)
        self._longest = longest = max(template.size for template in templates)
        # samples after an arrival that the form test uses
        self._after = longest + round(AFTER_S * rate_hz) + 1
        # and before the oldest undecided one, with the memory of its whitening filter
        before = round((LEVEL_S + BEFORE_S + CHAIN_S) * rate_hz) + 2 * size
        self._keep = before + 3 * longest + self._after + self._block
        self._loudest = Loudest(longest / rate_hz)
        self._waiting = np.zeros(0)
        self._outputs: list[np.ndarray] = []
        self._tested: list[LiveDetection] = []
        # the latest samples, and numbers of filtered samples, of outputs, of samples in
        # the estimate of the noise, and of all
        self._ring, self._taken, self._filtered, self._fed = np.zeros(0), 0, 0, 0
        self._loud_at, self._count, self._known_s = -math.inf, 0, 0.0
        self._filter: OverlapSave | None = None
        self._pickers: list[PeakPicker] = []
        self._tests: dict[int, PulseTest] = {}
        self._follower: NoiseFollower | None = None
        self.kernels: list[MatchedKernel] = []
        self.thresholds: Float[np.ndarray, " template"] = np.zeros(0)
        self.rejected: tuple[LiveDetection, ...] = ()
        self.statistic: Float[np.ndarray, " output"] = np.zeros(0)
        self.noise: NoiseSpectrum | None = None
        if noise is not None:
            self._tune(noise, math.inf)

    @property
    def latency_s(self) -> float:
        """Largest delay from the first sample of a blast to its report [s]."""
        after = max(2 * self._longest + HALF_WIDTH + 2, self._after)
        return (after + self._block) / self.rate_hz

    @property
    def latest(self) -> tuple[int, Float[np.ndarray, " sample"]]:
        """Number of the first stored sample, and the stored samples.

        They contain those about the arrivals of the last push.
        """
        return self._taken - self._ring.size, self._ring

    def push(self, samples: ArrayLike) -> tuple[LiveDetection, ...]:
        """Add any number of samples; return the blasts that are decided by now.

        Raises:
            InputError: Samples are not finite. The stream is left unchanged.
        """
        new = checked_samples("samples", samples, least=0)
        self._waiting = np.concatenate([self._waiting, new])
        self._count += new.size
        if not self.kernels and self._waiting.size >= self._learn:
            self._learn_noise(self._waiting[: self._learn])
        if self.kernels:
            cut = self._waiting.size - self._waiting.size % self._block
            whole, self._waiting = self._waiting[:cut], self._waiting[cut:].copy()
            for start in range(0, cut, self._block):
                self._process(whole[start : start + self._block])
        return self._reported()

    def finish(self) -> tuple[LiveDetection, ...]:
        """Return the remaining blasts at the end of the stream."""
        rest, self._waiting = self._waiting, np.zeros(0)
        if not self.kernels:
            self._learn_noise(rest)
        for start in range(0, rest.size, self._block):
            self._process(rest[start : start + self._block])
        self._process(None)
        return self._reported()

    def _reported(self) -> tuple[LiveDetection, ...]:
        """Return the blasts among the tested arrivals, in order of time."""
        tested = sorted(self._tested, key=lambda one: one.arrival.time_s)
        self.statistic = np.concatenate([np.zeros(0), *self._outputs])
        self._tested, self._outputs = [], []
        blasts = [self._any_form or one.fit.blast_form for one in tested]
        self.rejected = tuple(compress(tested, (not blast for blast in blasts)))
        return tuple(compress(tested, blasts))

    def _learn_noise(self, samples: np.ndarray) -> None:
        try:
            noise = noise_spectrum(samples, self.rate_hz, average="median")
        except InputError:
            # silent or too short: noise of the least level
            offset = float(np.median(samples)) if samples.size else 0.0
            half = self.rate_hz / 2
            noise = NoiseSpectrum(np.array([0.0, half]), np.zeros(2), offset)
        self._follower = NoiseFollower(self.rate_hz, noise.offset)
        self._tune(noise, MEDIAN_SHARE * max(samples.size, self._block) / self.rate_hz)

    def _tune(self, noise: NoiseSpectrum, seconds: float) -> None:
        """Compute filters and thresholds for noise that was measured over a time."""
        rate = self.rate_hz
        noise = noise._replace(density=np.maximum(noise.density, self._floor))
        before_s = self._before / rate
        self.kernels = [
            matched_kernel(template, rate, noise, before_s=before_s)
            for template in self._templates
        ]
        taps = np.zeros((len(self.kernels), self._before + self._longest))
        for row, kernel in zip(taps, self.kernels, strict=True):
            row[: kernel.taps.size] = kernel.taps
        size = fast_length(2 * taps.shape[1])
        # response of the outputs' power to that of the noise, by Parseval's theorem
        self._power = np.abs(np.fft.rfft(taps, size)) ** 2 * (2 / size)
        self._sums = taps.sum(axis=1)
        powers = self._power * bin_variances(noise, size, rate)
        width_hz = powers.sum(axis=1) ** 2 / np.sum(powers**2, axis=1) * rate / size
        # the window of the spectrum has a width of 1.5 lines
        dof = 2 * np.maximum(width_hz, 1.5 * rate / self._block * 2) * seconds
        single = np.array([threshold_for(one, self._share) for one in self.kernels])
        raised = (
            single if math.isinf(seconds) else np.sqrt(dof * np.expm1(single**2 / dof))
        )
        # and filters prefer lines whose noise is underestimated: with n windows the
        # variance of their output is n / (n - 2) times the estimate (Reed, Mallett and
        # Brennan 1974, for the mean of inverse densities)
        windows = max(4 * seconds * rate / self._block, 4.0)
        self.thresholds = raised * math.sqrt(1 / (1 - 2 / windows))
        if self._filter is None:
            self._filter = OverlapSave(taps, self._before, self._block)
            # arrivals of all filters within the longest pulse compete anyway
            self._pickers = [
                PeakPicker(kernel, height, wait_s=0.0)
                for kernel, height in zip(self.kernels, self.thresholds, strict=True)
            ]
            for picker in self._pickers:
                picker.skip(self._before)
        self._filter.retune(taps)
        tuned = zip(self._pickers, self.kernels, self.thresholds, strict=True)
        for picker, kernel, height in tuned:
            picker.retune(kernel, float(height))
        self.noise, self._known_s, self._tests = noise, seconds, {}

    def _process(self, block: np.ndarray | None) -> None:
        """Filter a block; None for the end of the stream."""
        assert self._filter is not None
        assert self.noise is not None
        if block is None:
            outputs = self._filter.finish()
        else:
            outputs = self._filter.push(block)
            self._ring = np.concatenate([self._ring, block])[-self._keep :]
            self._taken += block.size
        outputs -= (self.noise.offset * self._sums)[:, None]
        start, self._filtered = self._filtered, self._filtered + outputs.shape[1]
        self._outputs.append(outputs.max(axis=0))
        loud = np.flatnonzero((outputs > self.thresholds[:, None]).any(axis=0))
        if loud.size:
            self._loud_at = start + int(loud[-1])
        found: list[tuple[Detection, int]] = []
        for nth, picker in enumerate(self._pickers):
            # outputs that lack samples before or after the stream are not searched
            stop = outputs.shape[1]
            if block is None:
                stop = self._taken - self.kernels[nth].reach - start
            inside = outputs[nth, max(self._before - start, 0) : max(stop, 0)]
            peaks = picker.push(inside)
            if block is None:
                peaks += picker.finish()
            found += [(one, nth) for one in with_front(peaks, self._front_s)]
        # a peak is up to a sample after its highest output
        until = min(picker.decided for picker in self._pickers) - 1
        until = min(until, self._taken - self._after + self._longest)
        until_s = math.inf if block is None else until / self.rate_hz
        for one, nth in self._loudest.push(found, until_s):
            self._tested.append(self._test(one, nth))
        if block is not None and self._follower is not None:
            self._follow(self._follower)

    def _test(self, arrival: Detection, nth: int) -> LiveDetection:
        assert self.noise is not None
        if nth not in self._tests:
            if len(self._tests) == MAX_WINDOWS:
                self._tests.clear()
            self._tests[nth] = PulseTest(self._templates, self.rate_hz, self.noise)
        first = self._taken - self._ring.size
        since_s = arrival.time_s - first / self.rate_hz
        fit = self._tests[nth](self._ring, since_s, nth)
        fit = fit.over(arrival.statistic, float(self.thresholds[nth]))
        return LiveDetection(arrival, fit, nth, self._count)

    def _follow(self, follower: NoiseFollower) -> None:
        """Update the noise by blocks whose neighbourhood is filtered."""
        first = self._taken - self._ring.size
        while self._fed + self._block + self._longest <= self._filtered:
            quiet = self._loud_at < self._fed - MASKED_LENGTHS * self._longest
            at = self._fed - first
            follower.add(self._ring[at : at + self._block], quiet=quiet)
            self._fed += self._block
        louder = follower.relearnt()
        if louder is not None:
            self._tune(louder, MEDIAN_SHARE * RELEARN_S)
        elif follower.quiet_s >= REFINED * self._known_s or self._drifted(follower):
            self._tune(follower.mean(), follower.quiet_s)

    def _drifted(self, follower: NoiseFollower) -> bool:
        """Return True if outputs have another standard deviation in the noise now."""
        if follower.quiet_s < MEMORY_S / REFINED:
            return False
        size = 2 * (self._power.shape[1] - 1)
        noise = follower.mean()
        least = np.maximum(noise.density, self._floor)
        powers = bin_variances(noise._replace(density=least), size, self.rate_hz)
        return bool(np.any(np.abs(np.sqrt(self._power @ powers) - 1) > DRIFT))


def search_bank_as_stream(
    channel: Channel,
    templates: Sequence[np.ndarray],
    false_alarms_per_hour: float,
    *,
    front_samples: float = SAME_FRONT,
    any_form: bool = False,
    noise: NoiseSpectrum | None = None,
) -> Searched:
    """Search a recording by `SoundWatch`; arguments as for `search.search_bank`.

    Args:
        channel: The channel.
        templates: Templates at the channel's rate.
        false_alarms_per_hour: Mean rate of false alarms of all together [1/h].
        front_samples: Error of an arrival by its front [samples].
        any_form: True to accept arrivals of any form.
        noise: Spectrum of the noise; None to learn it.

    Raises:
        InputError: Templates or recording cannot be used.
    """
    watch = SoundWatch(
        templates,
        channel.rate_hz,
        false_alarms_per_hour,
        front_samples=front_samples,
        any_form=any_form,
        noise=noise,
        least_noise=RECORDED_NOISE * float(np.std(channel.samples)),
    )
    found, rejected, outputs = [], [], []
    step = max(round(channel.rate_hz), 1)
    for start in range(0, channel.samples.size + step, step):
        ended = start >= channel.samples.size
        part = channel.samples[start : start + step]
        found += watch.finish() if ended else watch.push(part)
        rejected += watch.rejected
        outputs.append(watch.statistic)
    assert watch.noise is not None
    loudest = max(
        [*found, *rejected], key=lambda one: one.arrival.statistic, default=None
    )
    return Searched(
        channel=channel,
        noise=watch.noise,
        kernel=watch.kernels[loudest.member if loudest else 0],
        threshold=float(watch.thresholds.max()),
        statistic=np.concatenate(outputs),
        detections=tuple(one.arrival for one in found),
        latency_s=watch.latency_s,
        fits=tuple(one.fit for one in found),
        rejected=tuple((one.arrival, one.fit) for one in rejected),
    )
