r"""Sound searched for blasts: files, streams and microphones of a simulation.

`SoundWatch` is pushed samples in packets of any size and returns what it has decided.
It filters them in blocks of its own, so that packets change nothing. The filters of all
templates share the transform of a block. The statistic of a sample is the largest
output over its threshold. A maximum above 1 is a sound if none is higher within the
longest filter before it and within the longest template after it. The accepted false
alarms are shared among the templates, which costs 0.6 dB at one per hour for a bank.
Compared with STA/LTA the output is in standard deviations of the noise: the false-alarm
rate is the requested one in noise of any colour, and arrivals have a known error. A
sound found by a bank of pulses is compared with the form of a blast (`pulse_fit`).

The noise is given, or learnt from the first second by the median over windows, which a
blast in it hardly changes. It is then refined as more of it is known
(`noise.NoiseFollower`), without the sound around arrivals. In addition the pulse of a
blast must exceed the threshold in the noise just before it (`PulseTest`).

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

The Cramér-Rao bound of an arrival decreases without limit as a blast becomes louder.
The error by the position of the front between two samples does not decrease. It is
added in quadrature. Time and error of a blast of another form are those of its pick
(`picked_arrivals`).
"""

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import ArrayLike

from jblast.errors import InputError
from jblast.signals.detection import Detection
from jblast.signals.matched_filter import (
    FALSE_ALARMS_PER_HOUR,
    HALF_WIDTH,
    MatchedKernel,
    between_samples,
    in_decibels,
    matched_kernel,
    threshold_for,
)
from jblast.signals.noise import (
    MEDIAN_SHARE,
    NoiseFollower,
    NoiseSpectrum,
    bin_variances,
    checked_samples,
    fast_length,
    noise_spectrum,
    white_noise,
    window_size,
)
from jblast.signals.picked_arrivals import timed
from jblast.signals.pulse_fit import (
    AFTER_S,
    BEFORE_S as FITTED_BEFORE_S,
    NOISE_S,
    PulseTest,
)

BEFORE_S, MASKED_LENGTHS = 0.01, 3
"""Parts of a recording that are left out of its noise at a sound: time before it [s],
and lengths of the longest template after it, for reverberation."""
LEAST_QUIET = 0.5
"""Smallest share of a recording in which the noise is measured without its sounds; with
less left, the spectrum of the whole recording is the better estimate."""
FRONT = 0.1
"""Error of an arrival of exactly the template's form, by the position of the front
between samples [samples]. Measured for 5 kg at 100 m, 48 kHz, 40 dB and more."""
LEARN_S = 1.0
"""First part of a stream, in which the noise is learnt [s]: its median is worth the
mean of ten windows. The first thresholds of short pulses are 1.1 times as high as later
ones, of the longest pulses 2.2 times."""
LEAST_NOISE = 20e-6
"""Smallest standard deviation of noise: the hearing threshold of 20 uPa for samples in
pascals, two thirds of a step of 16 bits for samples of full scale 1."""


class Channel(NamedTuple):
    """One microphone's recording.

    Attributes:
        sensor: Name: the stem of its file, or stem.channel.
        record: Its file.
        number: Number of the channel in the file, from 1.
        samples: Samples in any unit.
        rate_hz: Sampling rate [Hz].
    """

    sensor: str
    record: str
    number: int
    samples: Float[np.ndarray, " sample"]
    rate_hz: float


class Searched(NamedTuple):
    """Result of the search of a channel.

    Attributes:
        channel: The channel.
        noise: Spectrum of its noise.
        threshold: Highest threshold [standard deviations of the noise].
        statistic: Largest output of the filters at each sample.
        detections: Arrivals of blasts, in order of time.
        others: Sounds above the threshold that are not blasts by form, or have equally
            loud noise before them.
        latency_s: Largest delay of a report from the first sample of a blast [s].
    """

    channel: Channel
    noise: NoiseSpectrum
    threshold: float
    statistic: Float[np.ndarray, " sample"]
    detections: tuple[Detection, ...]
    others: tuple[Detection, ...]
    latency_s: float

    @property
    def threshold_snr_db(self) -> float:
        """The threshold as 2E/N0 [dB]."""
        return in_decibels(self.threshold)


def peaks_of(
    outputs: Float[np.ndarray, " output"], before: int, after: int
) -> Int[np.ndarray, " peak"]:
    """Return the maxima above 1 of a statistic, of which none nearby is higher.

    Args:
        outputs: The statistic.
        before: Number of outputs before a peak in which none is higher.
        after: Number of outputs after it likewise.
    """
    inner = outputs[1:-1]
    rising = (inner > outputs[:-2]) & (inner >= outputs[2:]) & (inner > 1)
    peaks = 1 + np.flatnonzero(rising)
    # reduceat needs an index behind the last peak, at a height that never counts
    heights = np.append(outputs[peaks], -np.inf)
    lo = np.searchsorted(peaks, peaks - before)
    hi = np.searchsorted(peaks, peaks + after, side="right")
    bounds = np.stack([lo, hi], axis=1).ravel()
    highest = np.maximum.reduceat(heights, bounds)[::2] if peaks.size else heights
    return peaks[heights[:-1] >= highest[: peaks.size]]


class SoundWatch:
    """Search of an unlimited stream of samples for blasts, in bounded memory.

    Args:
        templates: Templates at the stream's rate (`templates.bank_of_pulses`).
        rate_hz: Sampling rate [Hz].
        false_alarms_per_hour: Mean rate of false alarms of all together [1/h].
        noise: Spectrum of the noise, which is then not followed; None to learn it.
        least_noise: Smallest standard deviation of the noise, in the stream's unit.
        forms: True to compare arrivals with the form of a blast.

    Attributes:
        rate_hz: Sampling rate [Hz].
        statistic: Largest outputs of all filters, by the last push; 0 where the filters
            lack samples before or after.
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
        *,
        false_alarms_per_hour: float = FALSE_ALARMS_PER_HOUR,
        noise: NoiseSpectrum | None = None,
        least_noise: float = LEAST_NOISE,
        forms: bool = True,
    ):
        self._templates, self.rate_hz, self._forms = templates, rate_hz, forms
        # by Bonferroni: alarms of the bank are at most the sum of the members'
        self._share = false_alarms_per_hour / len(templates)
        self._floor = float(white_noise(least_noise, rate_hz).density[0])
        self._window = size = window_size(rate_hz)
        self._sizes = np.array([[template.size] for template in templates])
        self._longest = longest = int(self._sizes.max())
        # short blocks have little delay, but long pulses need long transforms anyway
        self._block = size * max(1, min(longest // (2 * size) + 1, 2))
        self._learn = self._block * math.ceil(LEARN_S * rate_hz / self._block)
        # the form test uses samples after the pulse, too, and long before it
        after, earlier = (AFTER_S, NOISE_S + FITTED_BEFORE_S) if forms else (0.0, 0.0)
        self._wait = max(longest, round(after * rate_hz) + 1, HALF_WIDTH)
        self._keep = round(earlier * rate_hz) + 2 * (size + longest + self._block)
        self._keep += self._wait
        self._waiting = np.zeros(0)
        # the latest samples, from those of 0 before the first one on, and outputs: the
        # number of the first, those of all filters, and the largest over its threshold
        self._ring = np.zeros(0)
        self._recent = deque[tuple[int, np.ndarray, np.ndarray]]()
        # numbers of samples, with those of 0 that end the stream, of samples in the
        # estimate of the noise, and of outputs whose peaks are decided
        self._taken, self._end, self._fed, self._decided = 0, 0, 0, 0
        self._outputs: list[np.ndarray] = []
        self._found: list[Detection] = []
        self._loud_at, self._known_s = -math.inf, 0.0
        self._follower: NoiseFollower | None = None
        self.kernels: list[MatchedKernel] = []
        self.thresholds: Float[np.ndarray, " template"] = np.zeros(0)
        self.statistic: Float[np.ndarray, " output"] = np.zeros(0)
        self.noise: NoiseSpectrum | None = None
        if noise is not None:
            self._tune(noise, math.inf)

    @property
    def latency_s(self) -> float:
        """Largest delay from the first sample of a blast to its report [s]."""
        return (self._wait + self._longest + self._block) / self.rate_hz

    @property
    def latest(self) -> tuple[int, Float[np.ndarray, " sample"]]:
        """Number of the first stored sample, and the stored samples.

        They contain those about the arrivals of the last push.
        """
        first = self._end - self._ring.size
        return max(first, 0), self._ring[max(-first, 0) : self._taken - first]

    def push(self, samples: ArrayLike) -> tuple[Detection, ...]:
        """Add any number of samples; return the sounds that are decided by now.

        Raises:
            InputError: Samples are not finite. The stream is left unchanged.
        """
        new = checked_samples("samples", samples, least=0)
        self._waiting = np.concatenate([self._waiting, new])
        if not self.kernels and self._waiting.size >= self._learn:
            self._learn_noise(self._waiting[: self._learn])
        if self.kernels:
            cut = self._waiting.size - self._waiting.size % self._block
            whole, self._waiting = self._waiting[:cut], self._waiting[cut:].copy()
            for start in range(0, cut, self._block):
                self._taken += self._block
                self._process(whole[start : start + self._block])
        return self._reported()

    def finish(self) -> tuple[Detection, ...]:
        """Return the remaining sounds at the end of the stream."""
        rest, self._waiting = self._waiting, np.zeros(0)
        if not self.kernels:
            self._learn_noise(rest)
        self._taken += rest.size
        # the last outputs need samples after the end, and their peaks outputs
        rest = np.append(rest, np.zeros(self._longest + self._wait))
        for start in range(0, rest.size, self._block):
            self._process(rest[start : start + self._block])
        return self._reported()

    def _reported(self) -> tuple[Detection, ...]:
        self.statistic = np.concatenate([np.zeros(0), *self._outputs])
        found, self._found, self._outputs = self._found, [], []
        return tuple(found)

    def _learn_noise(self, samples: np.ndarray) -> None:
        try:
            noise = noise_spectrum(samples, self.rate_hz, average="median")
        except InputError:
            # silent or too short: noise of the least level
            offset = float(np.median(samples)) if samples.size else 0.0
            frequency = np.fft.rfftfreq(self._window, 1 / self.rate_hz)
            noise = NoiseSpectrum(frequency, np.zeros(frequency.size), offset)
        self._follower = NoiseFollower(self.rate_hz, noise.offset)
        self._tune(noise, MEDIAN_SHARE * max(samples.size, self._block) / self.rate_hz)

    def _tune(self, noise: NoiseSpectrum, seconds: float) -> None:
        """Compute filters and thresholds for noise that was measured over a time."""
        rate = self.rate_hz
        noise = noise._replace(density=np.maximum(noise.density, self._floor))
        self.kernels = [matched_kernel(one, rate, noise) for one in self._templates]
        self._before = self.kernels[0].before
        taps = np.zeros((len(self.kernels), self._before + self._longest))
        for row, kernel in zip(taps, self.kernels, strict=True):
            row[: kernel.taps.size] = kernel.taps
        self._overlap = taps.shape[1] - 1
        self._size = size = fast_length(self._overlap + self._block)
        self._gain = np.conj(np.fft.rfft(taps, size))
        single = np.array([threshold_for(one, self._share) for one in self.kernels])
        self.thresholds = single
        if math.isfinite(seconds):
            powers = np.abs(self._gain) ** 2 * bin_variances(noise, size, rate)
            width_hz = powers.sum(axis=1) ** 2 / np.sum(powers**2, axis=1) * rate / size
            # the window of the spectrum has a width of 1.5 lines
            dof = 2 * np.maximum(width_hz, 1.5 * rate / self._window) * seconds
            # and filters prefer lines whose noise is underestimated: with n windows the
            # variance of their output is n / (n - 2) times the estimate (Reed, Mallett
            # and Brennan 1974, for the mean of inverse densities)
            windows = max(2 * seconds * rate / self._window, 4.0)
            raised = np.sqrt(dof * np.expm1(single**2 / dof))
            self.thresholds = raised / math.sqrt(1 - 2 / windows)
        if self.noise is None:
            self._ring = np.zeros(self._overlap)
        self.noise, self._known_s = noise, seconds
        if self._forms:
            self._test = PulseTest(self._templates, rate, noise)

    def _process(self, block: Float[np.ndarray, " sample"]) -> None:
        """Filter a block by overlap-save.

        That is a transform of the block and of the samples before it (Oppenheim and
        Schafer, Discrete-Time Signal Processing, section 8.7.3).
        """
        assert self.noise is not None
        self._end += block.size
        self._ring = np.concatenate([self._ring, block])[-self._keep :]
        # of noise of mean 0
        used = self._ring[-(self._overlap + block.size) :] - self.noise.offset
        spectrum = np.fft.rfft(used, self._size)
        outputs = np.fft.irfft(spectrum * self._gain, self._size)[:, : block.size]
        filtered = self._end - self._longest + 1
        start = filtered - block.size
        # outputs that lack samples before or after the stream are not searched
        at = np.arange(start, filtered)
        outputs[(at < self._before) | (at > self._taken - self._sizes)] = 0.0
        scaled = (outputs / self.thresholds[:, None]).max(axis=0)
        self._recent.append((start, outputs, scaled))
        inside = slice(max(-start, 0), max(self._taken - start, 0))
        self._outputs.append(outputs.max(axis=0)[inside])
        loud = np.flatnonzero(scaled > 1)
        if loud.size:
            self._loud_at = start + int(loud[-1])
        near = np.concatenate([part for *_, part in self._recent])
        peaks = peaks_of(near, self._overlap + 1, self._wait) + self._recent[0][0]
        # the last output is a peak or not by the next one
        decided, self._decided = self._decided, filtered - self._wait - 1
        peaks = peaks[(peaks >= decided) & (peaks < self._decided)]
        self._found += [self._detection(peak) for peak in peaks.tolist()]
        oldest = self._decided - self._overlap - 2 - HALF_WIDTH
        while len(self._recent) > 1 and self._recent[1][0] < oldest:
            self._recent.popleft()
        if self._follower is not None and self._end <= self._taken:
            self._follow(self._follower, filtered)

    def _detection(self, peak: int) -> Detection:
        """Return the sound whose statistic has a peak, of the loudest filter there."""
        outputs = np.concatenate([part for _, part, _ in self._recent], axis=1)
        at, rate = peak - self._recent[0][0], self.rate_hz
        nth = int(np.argmax(outputs[:, at] / self.thresholds))
        near = np.pad(outputs[nth], HALF_WIDTH)[at : at + 2 * HALF_WIDTH + 1]
        shift, height = between_samples(near)
        beside = outputs[:, max(at - self._longest, 0) : at + self._longest + 1]
        loud = beside.max(axis=1) > self.thresholds
        times = beside[loud].argmax(axis=1)
        kernel, time_s = self.kernels[nth], (peak + shift) / rate
        found = Detection(
            time_s=time_s,
            sigma_s=math.hypot(1 / (kernel.timing_rad_s * height), FRONT / rate),
            snr_db=in_decibels(height),
            statistic=height,
            template_s=(kernel.reach + 1) / rate,
            spread_s=float(np.ptp(times)) / rate if times.size else 0.0,
        )
        if not self._forms:
            return found
        first, samples = self.latest
        at_s, least = time_s - first / rate, float(self.thresholds[nth])
        fit, picked = self._test(samples, at_s, nth, least)
        return timed(found._replace(fit=fit), picked, rate, first / rate)

    def _follow(self, follower: NoiseFollower, filtered: int) -> None:
        """Update the noise by blocks whose neighbourhood is filtered."""
        first = self._end - self._ring.size
        while self._fed + self._block + self._longest <= filtered:
            quiet = self._loud_at < self._fed - MASKED_LENGTHS * self._longest
            at = self._fed - first
            follower.add(self._ring[at : at + self._block], quiet=quiet)
            self._fed += self._block
        better = follower.better(self._known_s)
        if better is not None:
            self._tune(*better)


def search(
    channel: Channel,
    templates: Sequence[np.ndarray],
    *,
    false_alarms_per_hour: float = FALSE_ALARMS_PER_HOUR,
    noise: NoiseSpectrum | None = None,
    forms: bool = True,
) -> Searched:
    """Search a recording by `SoundWatch`, with the noise of all of it.

    A loud blast raises the estimate of the noise, and would appear less significant
    than it is. The noise is therefore measured twice: in the whole recording, and, if
    there are sounds, in the rest without them.

    Args:
        channel: The channel.
        templates: As for `SoundWatch`, at the channel's rate.
        false_alarms_per_hour: As for `SoundWatch`.
        noise: Spectrum of the noise; None to measure it.
        forms: As for `SoundWatch`.

    Raises:
        InputError: Templates or recording cannot be used.
    """
    samples, rate_hz = channel.samples, channel.rate_hz
    longest = max(template.size for template in templates)
    least = longest + window_size(rate_hz, samples.size) // 2
    if samples.size < least:
        raise InputError(
            f"{channel.record}: expected a recording at least as long as the longest "
            f"template and the noise before it, {least / rate_hz:.6g} s; got "
            f"{samples.size / rate_hz:.6g} s"
        )

    def searched(noise: NoiseSpectrum, forms: bool) -> Searched:
        watch = SoundWatch(
            templates,
            rate_hz,
            false_alarms_per_hour=false_alarms_per_hour,
            noise=noise,
            forms=forms,
        )
        found, statistic = watch.push(samples), watch.statistic
        found += watch.finish()
        return Searched(
            channel=channel,
            noise=noise,
            threshold=float(watch.thresholds.max()),
            statistic=np.concatenate([statistic, watch.statistic]),
            detections=tuple(one for one in found if one.is_blast),
            others=tuple(one for one in found if not one.is_blast),
            latency_s=watch.latency_s,
        )

    if noise is None:
        noise = noise_spectrum(samples, rate_hz)
        quiet = np.ones(samples.size, bool)
        for one in searched(noise, forms=False).detections:
            start = max(int((one.time_s - BEFORE_S) * rate_hz), 0)
            stop = int(one.time_s * rate_hz) + MASKED_LENGTHS * longest
            quiet[start:stop] = False
        if quiet.mean() >= LEAST_QUIET:
            noise = noise_spectrum(samples[quiet], rate_hz)
    return searched(noise, forms)
