"""Each channel of a recording searched for a template, at once or as a stream.

What a loud bang adds to the noise of its own recording would make it seem less loud
and less sure than it is. So the noise is measured twice: in all of the recording, and,
where a bang is found by that, in what is left without it.

The bound of Cramér and Rao, what noise does to an arrival, falls without end as a bang
grows louder. How its front stands between samples, and what it has not of the
template's front, does not: it is added in quadrature.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.detect.kernel import MatchedKernel
from jblast.detect.matched_filter import Filtered, matched_filter
from jblast.detect.peaks import Detection, PeakPicker, detections
from jblast.detect.pulse_fit import PulseFit
from jblast.detect.stream import BLOCK_S, LEARN_S, Stream, stream
from jblast.detect.threshold import FALSE_ALARMS_PER_HOUR, in_decibels, threshold_for
from jblast.detect.whitening import NoiseSpectrum, noise_spectrum

BEFORE_S, LENGTHS = 0.01, 3
"""Taken out about a bang: so much before it, and so many lengths of the template."""
SAME_FRONT = 0.1
"""Error of an arrival of the template's very form, in samples: where its front stands
between two of them. Measured: 5 kg at 100 m, 48 kHz, 40 dB and more."""
OTHER_FRONT = 0.5
"""The same of a template by the laws, whose front is that of no one blast. Measured
there: 0.68 by a template for a quarter of the distance, 0.55 by clipping at two fifths
of the peak."""
LEAST_QUIET = 0.5
"""Share of a recording that has to be left to know the noise by."""


class Channel(NamedTuple):
    """One microphone's recording.

    Attributes:
        sensor: What it is called: the stem of its file, or stem.channel.
        record: Its file.
        number: Which channel of it, from 1.
        samples: In any unit.
        rate_hz: Samples a second.
    """

    sensor: str
    record: str
    number: int
    samples: Float[np.ndarray, " sample"]
    rate_hz: float


class Searched(NamedTuple):
    """What was heard in a channel.

    Attributes:
        channel: Where it was searched.
        noise: What it was searched in.
        kernel: The filter.
        threshold: In standard deviations of the noise.
        statistic: The filter's output, a sample for each that it is known of.
        detections: Blasts, in order of time.
        latency_s: From the first sample of a blast to its being told, as a stream [s].
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
) -> Searched:
    """Search a whole recording.

    Args:
        channel: Where.
        template: What for, at the channel's rate.
        false_alarms_per_hour: How many on average [1/h].
        front_samples: Error of an arrival by its front, in samples: `SAME_FRONT`, or
            `OTHER_FRONT`.

    Raises:
        InputError: Template or recording cannot be used.
    """
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
        detections=_with_front(
            detections(filtered, threshold), front_samples / channel.rate_hz
        ),
        latency_s=(kernel.reach + settles) / channel.rate_hz,
    )


def quiet_noise(
    samples: Float[np.ndarray, " sample"],
    template: Float[np.ndarray, " tap"],
    rate_hz: float,
    false_alarms_per_hour: float = FALSE_ALARMS_PER_HOUR,
) -> NoiseSpectrum:
    """Measure the noise in what is left of a recording without the bangs in it.

    Where bangs take up more than half of it, it is that of all of it.

    Args:
        samples: Of one channel.
        template: What bangs look like.
        rate_hz: Of both [Hz].
        false_alarms_per_hour: As for the search [1/h].

    Raises:
        InputError: Template or recording cannot be used.
    """
    return _quieted(samples, template, rate_hz, false_alarms_per_hour)[0]


def _quieted(
    samples: Float[np.ndarray, " sample"],
    template: Float[np.ndarray, " tap"],
    rate_hz: float,
    false_alarms_per_hour: float,
) -> tuple[NoiseSpectrum, Filtered | None]:
    """Return that noise, and what was heard in it where that is all of the noise."""
    noise = noise_spectrum(samples, rate_hz)
    filtered = matched_filter(samples, template, rate_hz, noise_spectrum=noise)
    threshold = threshold_for(filtered.kernel, false_alarms_per_hour)
    quiet = np.ones(samples.size, bool)
    for found in detections(filtered, threshold):
        start = max(int((found.time_s - BEFORE_S) * rate_hz), 0)
        stop = int(found.time_s * rate_hz) + LENGTHS * template.size
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
    """Search a recording block by block, as a stream would be; arguments as `search`.

    The noise is that of the first ten seconds, or of all where it is shorter.

    Args:
        channel: Where.
        template: What for, at the channel's rate.
        false_alarms_per_hour: How many on average [1/h].
        front_samples: Error of an arrival by its front, in samples.
        block_s: So much sound is filtered at a time [s].
        pushed: Called with how many samples have been taken in.

    Raises:
        InputError: Template or recording cannot be used.
    """
    learnt = channel.samples[: max(round(LEARN_S * channel.rate_hz), template.size)]
    noise = quiet_noise(learnt, template, channel.rate_hz, false_alarms_per_hour)
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
        detections=_with_front(found, front_samples / channel.rate_hz),
        latency_s=listening.latency_s,
    )


def _with_front(found: tuple[Detection, ...], front_s: float) -> tuple[Detection, ...]:
    """Return arrivals with what their fronts add to the bound of their errors."""
    return tuple(
        one._replace(sigma_s=float(np.hypot(one.sigma_s, front_s))) for one in found
    )


def _listened(
    listening: Stream, channel: Channel, block_s: float, pushed: Callable[[int], None]
) -> tuple[tuple[Detection, ...], np.ndarray]:
    """Return what a stream finds, and all its outputs."""
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
