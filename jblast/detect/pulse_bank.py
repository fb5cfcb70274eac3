"""Blasts of which nothing is known beforehand: a bank of pulses, the loudest answer.

Waves of laws differ mostly by how long they last: a bank in even steps of ln duration
has one near any blast, with which a matched filter loses little. Each is a filter of
its own; what one hears above its threshold is a blast, unless another hears it louder
within the length of the longest. The false alarms that are borne with are shared among
them, which costs some 0.6 dB with one an hour.

It is preferred to STA/LTA because its output is in standard deviations of the noise, so
that its false alarms are those asked for in noise of any colour, and because its times
have an error that is known.
"""

from collections.abc import Callable, Sequence

import jax
import numpy as np
from jaxtyping import Float

from jblast.detect.peaks import Detection
from jblast.detect.samples import checked_positive
from jblast.detect.search import Channel, Searched
from jblast.errors import InputError, argument
from jblast.scene import Charge, Scene
from jblast.sensors import Heard, heard
from jblast.waves.waveform.pulse import Pulse, pulse_mean

STEP = 2**0.5
"""From one duration of the bank to the next. Half a step away, in white noise, 0.93 of
the signal is left, 0.6 dB."""
DURATIONS = tuple(0.001 * STEP**nth for nth in range(14))
"""Of the bank's positive phases, 1 to 91 ms [s]: from 2 g to 2 t at Z = 50."""
FAR = 50.0
"""Scaled distance of the bank's pulses [m/kg^(1/3)]."""
LONGEST_S = 60.0
"""A longer pulse is no template [s]."""


def pulse_template(
    mass: float, range_m: float, rate_hz: float
) -> Float[np.ndarray, " tap"]:
    """Return what a charge on the ground sounds like there, from the front on [Pa].

    A mean over each sample, to the end of the suction.

    Args:
        mass: TNT mass [kg].
        range_m: From the charge [m].
        rate_hz: Samples a second.

    Raises:
        InputError: A number is not positive, or the pulse lasts for minutes.
    """
    mass = checked_positive("charge", mass, "kg")
    range_m = checked_positive("range", range_m, "m")
    pulse = _wave(mass, range_m).pulse
    if not (lasts := _lasting(pulse)) <= LONGEST_S:
        raise InputError(
            f"{argument('charge')}, {argument('range')}: expected a pulse of "
            f"{LONGEST_S:g} s at most, got {lasts:.3g} s of {mass:g} kg at "
            f"{range_m:g} m"
        )
    return _sampled([pulse], rate_hz)[0]


def bank_of_pulses(rate_hz: float) -> list[np.ndarray]:
    """Return templates of all `DURATIONS`.

    Args:
        rate_hz: Samples a second.
    """
    unit = _wave(1.0, FAR).pulse
    sizes = np.array(DURATIONS) / float(unit.duration)  # lengths scale as W^(1/3)
    return _sampled([_wave(s**3, FAR * s).pulse for s in sizes], rate_hz)


def search_bank(
    channel: Channel,
    templates: Sequence[np.ndarray],
    false_alarms_per_hour: float,
    look: Callable[[Channel, np.ndarray, float], Searched],
) -> Searched:
    """Search a channel for several templates.

    The output is the largest of all at each sample, the threshold the highest.

    Args:
        channel: Where.
        templates: What for, at the channel's rate.
        false_alarms_per_hour: Of all together [1/h].
        look: `search`, or `search_as_stream`.

    Raises:
        InputError: Templates or recording cannot be used.
    """
    share = false_alarms_per_hour / len(templates)
    every = [look(channel, template, share) for template in templates]
    longest = max(template.size for template in templates) / channel.rate_hz
    found = [(one, of) for of in every for one in of.detections]
    found.sort(key=lambda heard: -heard[0].statistic)
    kept: list[Detection] = []
    for one, _ in found:
        if all(abs(one.time_s - other.time_s) > longest for other in kept):
            kept.append(one)
    kept.sort(key=lambda one: one.time_s)
    loudest = found[0][1] if found else every[0]
    length = min(one.statistic.size for one in every)
    outputs = np.max([one.statistic[:length] for one in every], axis=0)
    return loudest._replace(
        threshold=max(one.threshold for one in every),
        statistic=outputs,
        detections=tuple(kept),
        latency_s=max(one.latency_s for one in every) + longest,
    )


def _wave(mass: float, range_m: float) -> Heard:
    """Return the wave of a charge on the ground, there too."""
    return heard(Scene(charge=Charge(mass=mass)), [range_m, 0.0, 0.0])[0]


def _lasting(pulse: Pulse) -> float:
    return float(pulse.duration + pulse.suction_duration)


def _sampled(pulses: Sequence[Pulse], rate_hz: float) -> list[np.ndarray]:
    """Return the samples of pulses, all by one program."""
    rate_hz = checked_positive("rate_hz", rate_hz, "Hz")
    counts = [int(np.ceil(_lasting(pulse) * rate_hz)) for pulse in pulses]
    edges = np.arange(max(counts) + 1) / rate_hz
    sampled = jax.jit(pulse_mean)
    return [
        np.asarray(
            sampled(pulse._replace(arrival_time=np.zeros(())), edges[:-1], edges[1:]),
            float,
        )[:count]
        for pulse, count in zip(pulses, counts, strict=True)
    ]
