"""Channels searched for blasts, with a template or a bank of pulses.

A loud blast in a recording raises the estimate of its noise, and would appear less
significant than it is. The noise is therefore measured twice: in the whole recording,
and, if a blast is found, in the rest without it.

The Cramér-Rao bound of an arrival decreases without limit as a blast becomes louder.
The error by the position of the front between two samples, and by a front that is not
the template's, does not decrease. It is added in quadrature.

Without a template a channel is searched with a bank of pulses by the laws. They differ
mostly in duration: a bank in even steps of ln duration has a member near any blast,
with which a matched filter loses little. Of the arrivals above the thresholds within
the length of the longest pulse the loudest is kept, if its form is that of a blast
(`pulse_fit`). The accepted false alarms are shared among the members, which costs 0.6
dB at one per hour. Compared with STA/LTA the output is in standard deviations of the
noise: the false-alarm rate is the requested one in noise of any colour, and arrivals
have a known error.
"""

from collections.abc import Callable, Sequence
from itertools import compress
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.signals.matched_filter import (
    BLOCK_S,
    FALSE_ALARMS_PER_HOUR,
    LEARN_S,
    Detection,
    Filtered,
    MatchedKernel,
    PeakPicker,
    Stream,
    detections,
    in_decibels,
    matched_filter,
    stream,
    threshold_for,
)
from jblast.signals.noise import NoiseSpectrum, noise_spectrum
from jblast.signals.pulse_fit import PulseFit, PulseTest
from jblast.signals.templates import blast_templates
from jblast.waves.waveform import blast_pulse

BEFORE_S, MASKED_LENGTHS = 0.01, 3
"""Parts of a recording that are left out of its noise at a blast: time before it [s],
and lengths of the template after it, for reverberation."""
SAME_FRONT = 0.1
"""Error of an arrival of exactly the template's form, by the position of the front
between samples [samples]. Measured for 5 kg at 100 m, 48 kHz, 40 dB and more."""
OTHER_FRONT = 0.5
"""The same for a template by the laws, whose front differs from a real one's [samples].
Measured there: 0.68 with a template for a quarter of the distance, 0.55 with clipping
at two fifths of the peak."""
LEAST_QUIET = 0.5
"""Smallest share of a recording in which the noise is measured without its blasts; with
less left, the spectrum of the whole recording is the better estimate."""
DURATION_RATIO = 2**0.5
"""Ratio of neighbouring durations of the bank. Half a step away, in white noise, 0.93
of the signal remains, a loss of 0.6 dB."""
DURATIONS = tuple(0.001 * DURATION_RATIO**nth for nth in range(14))
"""Positive phases of the bank, 1 to 91 ms [s]: from 2 g to 2 t at Z = 50."""
CHAIN_S = 1.0
"""Longest time for which an arrival waits for the decision on a chain of ever louder
ones [s]; it is then dropped, as a forerunner of them."""
BANK_SCALED_DISTANCE = 50.0
"""Scaled distance of the bank's pulses [m/kg^(1/3)]: there the form hardly depends on
it, as all pulses of one duration beyond Z = 5 (`templates`)."""


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
        kernel: The filter.
        threshold: Threshold [standard deviations of the noise].
        statistic: Output of the filter at each sample.
        detections: Blasts, in order of time.
        latency_s: Delay of a stream's report from the first sample of a blast [s].
        fits: Goodness of fit of each detection, in a search without a template.
        rejected: Arrivals above the threshold whose form is not that of a blast.
    """

    channel: Channel
    noise: NoiseSpectrum
    kernel: MatchedKernel
    threshold: float
    statistic: Float[np.ndarray, " sample"]
    detections: tuple[Detection, ...]
    latency_s: float
    fits: tuple[PulseFit, ...] = ()
    rejected: tuple[tuple[Detection, PulseFit], ...] = ()

    @property
    def threshold_snr_db(self) -> float:
        """The threshold as 2E/N0 [dB]."""
        return in_decibels(self.threshold)


def search(
    channel: Channel,
    template: Float[np.ndarray, " tap"],
    false_alarms_per_hour: float = FALSE_ALARMS_PER_HOUR,
    *,
    front_samples: float = SAME_FRONT,
    noise: NoiseSpectrum | None = None,
) -> Searched:
    """Search a whole recording.

    Args:
        channel: The channel.
        template: Template at the channel's rate.
        false_alarms_per_hour: Mean rate of false alarms [1/h].
        front_samples: Error of an arrival by its front, in samples: `SAME_FRONT`, or
            `OTHER_FRONT`.
        noise: Spectrum of the noise; None to measure it.

    Raises:
        InputError: Template or recording cannot be used.
    """
    filtered = None
    if noise is None:
        noise, filtered = _quieted(
            channel.samples, template, channel.rate_hz, false_alarms_per_hour
        )
    if filtered is None:
        filtered = matched_filter(
            channel.samples, template, channel.rate_hz, noise_spectrum=noise
        )
    kernel = filtered.kernel
    threshold = threshold_for(kernel, false_alarms_per_hour)
    settles = PeakPicker(kernel, threshold).settles
    return Searched(
        channel=channel,
        noise=noise,
        kernel=kernel,
        threshold=threshold,
        statistic=filtered.statistic,
        detections=with_front(
            detections(filtered, threshold), front_samples / channel.rate_hz
        ),
        latency_s=(kernel.reach + settles) / channel.rate_hz,
    )


def _quieted(
    samples: Float[np.ndarray, " sample"],
    template: Float[np.ndarray, " tap"],
    rate_hz: float,
    false_alarms_per_hour: float,
) -> tuple[NoiseSpectrum, Filtered | None]:
    """Return the noise of a recording without its blasts.

    If blasts take up more than half of the recording, the result is the spectrum of all
    of it, with the filter's output by that.
    """
    noise = noise_spectrum(samples, rate_hz)
    filtered = matched_filter(samples, template, rate_hz, noise_spectrum=noise)
    threshold = threshold_for(filtered.kernel, false_alarms_per_hour)
    quiet = np.ones(samples.size, bool)
    for found in detections(filtered, threshold):
        start = max(int((found.time_s - BEFORE_S) * rate_hz), 0)
        stop = int(found.time_s * rate_hz) + MASKED_LENGTHS * template.size
        quiet[start:stop] = False
    if quiet.all() or quiet.mean() < LEAST_QUIET:
        return noise, filtered
    return noise_spectrum(samples[quiet], rate_hz), None


def search_as_stream(
    channel: Channel,
    template: Float[np.ndarray, " tap"],
    false_alarms_per_hour: float = FALSE_ALARMS_PER_HOUR,
    *,
    front_samples: float = SAME_FRONT,
    block_s: float = BLOCK_S,
    pushed: Callable[[int], None] = lambda samples: None,
) -> Searched:
    """Search a recording block by block, like a stream; arguments as for `search`.

    The noise is that of the first ten seconds, or of all of a shorter recording.

    Args:
        channel: The channel.
        template: Template at the channel's rate.
        false_alarms_per_hour: Mean rate of false alarms [1/h].
        front_samples: Error of an arrival by its front [samples].
        block_s: Length of sound that is filtered together [s].
        pushed: Called with the number of samples pushed so far.

    Raises:
        InputError: Template or recording cannot be used.
    """
    learnt = channel.samples[: max(round(LEARN_S * channel.rate_hz), template.size)]
    # without its blasts, which would raise the estimated noise and so lower their
    # statistic
    noise, _ = _quieted(learnt, template, channel.rate_hz, false_alarms_per_hour)
    listening = stream(
        template,
        channel.rate_hz,
        block_s=block_s,
        false_alarms_per_hour=false_alarms_per_hour,
        noise_spectrum=noise,
    )
    found, statistic = _listened(listening, channel, block_s, pushed)
    assert listening.kernel is not None
    assert listening.threshold is not None
    assert listening.latency_s is not None
    return Searched(
        channel=channel,
        noise=noise,
        kernel=listening.kernel,
        threshold=listening.threshold,
        statistic=statistic,
        detections=with_front(found, front_samples / channel.rate_hz),
        latency_s=listening.latency_s,
    )


def with_front(found: tuple[Detection, ...], front_s: float) -> tuple[Detection, ...]:
    """Return arrivals with the errors by their fronts added to the bound."""
    return tuple(
        one._replace(sigma_s=float(np.hypot(one.sigma_s, front_s))) for one in found
    )


def _listened(
    listening: Stream, channel: Channel, block_s: float, pushed: Callable[[int], None]
) -> tuple[tuple[Detection, ...], np.ndarray]:
    """Return the detections of a stream, and all its outputs."""
    found: list[Detection] = []
    outputs: list[np.ndarray] = []
    block = max(round(block_s * channel.rate_hz), 1)
    for start in range(0, channel.samples.size, block):
        found += listening.push(channel.samples[start : start + block])
        outputs.append(listening.statistic)
        pushed(start + block)
    found += listening.finish()
    outputs.append(listening.statistic)
    return tuple(found), np.concatenate(outputs)


def bank_of_pulses(rate_hz: float) -> list[np.ndarray]:
    """Return templates of the `DURATIONS` of at least one sample.

    Args:
        rate_hz: Sampling rate [Hz].

    Raises:
        InputError: The rate is too low for all of them.
    """
    air = (STANDARD_PRESSURE, STANDARD_SOUND_SPEED)
    unit = float(blast_pulse(BANK_SCALED_DISTANCE, 1.0, *air, "surface").duration)
    # at one scaled distance, durations and distances scale as W^(1/3)
    sampled = [one for one in DURATIONS if one * rate_hz >= 1.0] or DURATIONS[-1:]
    sizes = [duration / unit for duration in sampled]
    masses, ranges = (
        [size**3 for size in sizes],
        [BANK_SCALED_DISTANCE * size for size in sizes],
    )
    return blast_templates(masses, ranges, rate_hz)


def search_bank(
    channel: Channel,
    templates: Sequence[np.ndarray],
    false_alarms_per_hour: float,
    *,
    front_samples: float = SAME_FRONT,
    any_form: bool = False,
    noise: NoiseSpectrum | None = None,
) -> Searched:
    """Search a whole channel for several templates.

    The output is the largest of all at each sample, the threshold the highest. Of
    arrivals closer to each other than the longest pulse the loudest is tested. It is
    rejected if its form is not that of a blast (`pulse_fit`), or if it is below the
    threshold in the noise just before it. `live.search_bank_as_stream` is the same
    search block by block.

    Args:
        channel: The channel.
        templates: Templates at the channel's rate.
        false_alarms_per_hour: Mean rate of false alarms of all together [1/h].
        front_samples: Error of an arrival by its front [samples].
        any_form: True to accept arrivals of any form.
        noise: Spectrum of the noise; None to measure it.

    Raises:
        InputError: Templates or recording cannot be used.
    """
    # by Bonferroni: alarms of the bank are at most the sum of the members'
    share = false_alarms_per_hour / len(templates)
    every = [
        search(channel, template, share, front_samples=front_samples, noise=noise)
        for template in templates
    ]
    # one blast is above the threshold of several members within its duration
    longest = max(template.size for template in templates) / channel.rate_hz
    found = [(one, nth) for nth, of in enumerate(every) for one in of.detections]
    quiet = noise
    if quiet is None:
        quiet = _noise_beside(channel, [one.time_s for one, _ in found], longest)
    tested: list[tuple[Detection, PulseFit]] = []
    tests: dict[int, PulseTest] = {}
    for one, nth in Loudest(longest).push(found, np.inf):
        if nth not in tests:
            beside = every[nth].noise if quiet is None else quiet
            tests[nth] = PulseTest(templates, channel.rate_hz, beside)
        fit = tests[nth](channel.samples, one.time_s, nth)
        tested.append((one, fit.over(one.statistic, every[nth].threshold)))
    tested.sort(key=lambda pair: pair[0].time_s)
    accepted = [any_form or fit.blast_form for _, fit in tested]
    loudest = max(found, key=lambda arrival: arrival[0].statistic, default=(None, 0))
    length = min(one.statistic.size for one in every)
    outputs = np.max([one.statistic[:length] for one in every], axis=0)
    return every[loudest[1]]._replace(
        threshold=max(one.threshold for one in every),
        statistic=outputs,
        detections=tuple(pair[0] for pair in compress(tested, accepted)),
        fits=tuple(pair[1] for pair in compress(tested, accepted)),
        rejected=tuple(
            pair for pair in tested if not any_form and not pair[1].blast_form
        ),
        latency_s=max(one.latency_s for one in every) + longest,
    )


class Loudest:
    """Choice of the loudest of arrivals that are close to each other.

    The loudest arrival is chosen, and those within a given time of it are dropped; then
    the loudest of the rest, and so on. In a stream an arrival is decided as soon as no
    louder one can follow within that time.

    Args:
        apart_s: Smallest time between chosen arrivals [s].
    """

    def __init__(self, apart_s: float):
        self._apart_s = apart_s
        self._open: list[tuple[Detection, int]] = []
        self._chosen: list[float] = []

    def push(
        self, found: Sequence[tuple[Detection, int]], until_s: float
    ) -> list[tuple[Detection, int]]:
        """Add arrivals; return the newly chosen ones, the loudest first.

        Args:
            found: Arrivals, each with the number of its template.
            until_s: Time before which all arrivals are known [s].
        """
        chosen: list[tuple[Detection, int]] = []
        undecided: list[tuple[Detection, int]] = []
        arrivals = sorted([*self._open, *found], key=lambda one: -one[0].statistic)
        for one in arrivals:
            time = one[0].time_s

            def close(other_s: float, time: float = time) -> bool:
                return abs(time - other_s) <= self._apart_s

            if any(map(close, self._chosen)):
                continue
            if any(close(louder.time_s) for louder, _ in undecided):
                # a chain of ever louder arrivals would need unlimited memory
                if time > until_s - CHAIN_S:
                    undecided.append(one)
            elif time + self._apart_s > until_s:
                undecided.append(one)
            else:
                # the loudest of each template, which replaces its quieter ones
                by_template = {
                    nth: other.time_s
                    for other, nth in reversed(arrivals)
                    if close(other.time_s)
                }
                spread_s = float(np.ptp([*by_template.values()]))
                chosen.append((one[0]._replace(spread_s=spread_s), one[1]))
                self._chosen.append(time)
        self._open = undecided
        oldest = until_s - CHAIN_S - 2 * self._apart_s
        self._chosen = [time for time in self._chosen if time >= oldest]
        return chosen


def _noise_beside(
    channel: Channel, times_s: Sequence[float], longest_s: float
) -> NoiseSpectrum | None:
    """Return the noise away from all arrivals; None if too little remains.

    The search with one template leaves out only its own length. Most of a long sound
    would stay in the noise, whose spectrum would then hide the tail of the sound.

    Args:
        channel: The channel.
        times_s: Arrivals of all templates [s].
        longest_s: Length of the longest template [s].
    """
    if not times_s:
        return None
    rate = channel.rate_hz
    quiet = np.ones(channel.samples.size, bool)
    for time in times_s:
        start = max(int((time - BEFORE_S) * rate), 0)
        quiet[start : int((time + MASKED_LENGTHS * longest_s) * rate) + 1] = False
    if quiet.all() or quiet.mean() < LEAST_QUIET:
        return None
    return noise_spectrum(channel.samples[quiet], rate)
