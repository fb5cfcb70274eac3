"""Blasts of which nothing is known beforehand: a bank of pulses, the loudest answer.

Waves of laws differ mostly by how long they last: a bank in even steps of ln duration
has one near any blast, with which a matched filter loses little. Each is a filter of
its own. Of the arrivals above the thresholds within the length of the longest pulse the
loudest counts, if its form is that of a blast (`pulse_fit.py`). The accepted false
alarms are shared among them, which costs some 0.6 dB with one an hour.

It is preferred to STA/LTA because its output is in standard deviations of the noise, so
that its false alarms are those asked for in noise of any colour, and because its times
have an error that is known.
"""

from collections.abc import Callable, Sequence

import numpy as np

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.detect.peaks import Detection
from jblast.detect.pulse_fit import PulseFit, PulseTest
from jblast.detect.search import BEFORE_S, LEAST_QUIET, LENGTHS, Channel, Searched
from jblast.detect.templates import blast_templates
from jblast.detect.whitening import NoiseSpectrum, noise_spectrum
from jblast.waves.waveform import blast_pulse

STEP = 2**0.5
"""From one duration of the bank to the next. Half a step away, in white noise, 0.93 of
the signal is left, 0.6 dB."""
DURATIONS = tuple(0.001 * STEP**nth for nth in range(14))
"""Of the bank's positive phases, 1 to 91 ms [s]: from 2 g to 2 t at Z = 50."""
FAR = 50.0
"""Scaled distance of the bank's pulses [m/kg^(1/3)]."""


def bank_of_pulses(rate_hz: float) -> list[np.ndarray]:
    """Return templates of all `DURATIONS`.

    Args:
        rate_hz: Samples a second.
    """
    air = (STANDARD_PRESSURE, STANDARD_SOUND_SPEED)
    unit = float(blast_pulse(FAR, 1.0, *air, "surface").duration)
    sizes = [duration / unit for duration in DURATIONS]  # lengths scale as W^(1/3)
    masses, ranges = [size**3 for size in sizes], [FAR * size for size in sizes]
    return blast_templates(masses, ranges, rate_hz)


def search_bank(
    channel: Channel,
    templates: Sequence[np.ndarray],
    false_alarms_per_hour: float,
    look: Callable[[Channel, np.ndarray, float], Searched],
    *,
    any_form: bool = False,
) -> Searched:
    """Search a channel for several templates.

    The output is the largest of all at each sample, the threshold the highest. Of
    arrivals nearer to each other than the longest pulse the loudest is tested: those
    of other forms (`jblast.detect.pulse_fit`), and those no louder than the threshold
    in the noise just before them, are rejected.

    Args:
        channel: Where.
        templates: What for, at the channel's rate.
        false_alarms_per_hour: Of all together [1/h].
        look: `search`, or `search_as_stream`.
        any_form: Whether arrivals of any form are accepted.

    Raises:
        InputError: Templates or recording cannot be used.
    """
    share = false_alarms_per_hour / len(templates)
    every = [look(channel, template, share) for template in templates]
    longest = max(template.size for template in templates) / channel.rate_hz
    found = [(one, nth) for nth, of in enumerate(every) for one in of.detections]
    found.sort(key=lambda heard: -heard[0].statistic)
    tested: list[tuple[Detection, PulseFit]] = []
    accepted: set[Detection] = set()
    quiet = _noise_beside(channel, [one.time_s for one, _ in found], longest)
    tests: dict[int, PulseTest] = {}
    for one, nth in found:
        if any(abs(one.time_s - other.time_s) <= longest for other, _ in tested):
            continue
        if nth not in tests:
            noise = every[nth].noise if quiet is None else quiet
            tests[nth] = PulseTest(templates, channel.rate_hz, noise)
        fit = tests[nth](channel.samples, one.time_s, nth)
        # where the noise is louder than on average, so is the threshold
        loud = one.statistic > every[nth].threshold * fit.level
        fit = fit._replace(loud=bool(loud))
        tested.append((one, fit))
        if any_form or fit.blast_form:
            accepted.add(one)
    tested.sort(key=lambda pair: pair[0].time_s)
    loudest = every[found[0][1]] if found else every[0]
    length = min(one.statistic.size for one in every)
    outputs = np.max([one.statistic[:length] for one in every], axis=0)
    return loudest._replace(
        threshold=max(one.threshold for one in every),
        statistic=outputs,
        detections=tuple(one for one, _ in tested if one in accepted),
        fits=tuple(fit for one, fit in tested if one in accepted),
        rejected=tuple(pair for pair in tested if pair[0] not in accepted),
        latency_s=max(one.latency_s for one in every) + longest,
    )


def _noise_beside(
    channel: Channel, times_s: Sequence[float], longest_s: float
) -> NoiseSpectrum | None:
    """Return the noise away from all arrivals; None where too little is left.

    The search leaves out only as much as its own template needs, and so keeps most of
    a long sound in the noise, which then seems to have no tail.

    Args:
        channel: Where.
        times_s: Arrivals of all templates [s].
        longest_s: Length of the longest template [s].
    """
    if not times_s:
        return None
    rate = channel.rate_hz
    quiet = np.ones(channel.samples.size, bool)
    for time in times_s:
        start = max(int((time - BEFORE_S) * rate), 0)
        quiet[start : int((time + LENGTHS * longest_s) * rate) + 1] = False
    if quiet.all() or quiet.mean() < LEAST_QUIET:
        return None
    return noise_spectrum(channel.samples[quiet], rate)
