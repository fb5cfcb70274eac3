"""Templates: recorded blasts and blasts by the laws.

A template begins with the sample at which the front arrives. The filter does not depend
on its scale. By the laws it is the mean of the pressure over each sample, as an
instrument records it, from the front to the end of the suction, without ground effects
and echoes.

Pulses by the laws differ mostly in duration: a bank in even steps of ln duration has a
member near any blast, with which a matched filter loses little.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.errors import InputError, argument
from jblast.signals.noise import (
    checked_positive,
    checked_samples,
    checked_template,
)
from jblast.waves.waveform import blast_pulse

LONGEST_S = 60.0
"""Longest duration of a template [s]: that of a nuclear blast; its samples and the
equations of its filter stay within memory."""
FADE = 0.2
"""Share of a recorded template over which its end fades; a cut would be another
front."""
DURATION_RATIO = 2**0.5
"""Ratio of neighbouring durations of the bank. Half a step away, in white noise, 0.93
of the signal remains, a loss of 0.6 dB."""
DURATIONS = tuple(0.001 * DURATION_RATIO**nth for nth in range(14))
"""Positive phases of the bank, 1 to 91 ms [s]: from 2 g to 2 t at Z = 50."""
BANK_SCALED_DISTANCE = 50.0
"""Scaled distance of the bank's pulses [m/kg^(1/3)]: there the form hardly depends on
it, as all pulses of one duration beyond Z = 5."""


def recorded_template(
    recording: ArrayLike, rate_hz: float, start_s: float, duration_s: float
) -> Float[np.ndarray, " tap"]:
    """Return an interval of a recording as a template.

    The mean of the recording before the interval is subtracted, and its end fades.

    Args:
        recording: Samples of one channel.
        rate_hz: Sampling rate [Hz].
        start_s: Arrival of the front [s].
        duration_s: Length of the interval [s].

    Raises:
        InputError: The interval is not within the recording, or silent.
    """
    samples = checked_samples("recording", recording)
    rate_hz = checked_positive("rate_hz", rate_hz, "Hz")
    count = round(checked_positive("duration_s", duration_s, "s") * rate_hz)
    start = round(start_s * rate_hz)
    if not 0 <= start < start + count <= samples.size:
        raise InputError(
            f"{argument('start_s')}, {argument('duration_s')}: expected an interval "
            f"within the {samples.size / rate_hz:.6g} s of the recording, got "
            f"{start_s:g} to {start_s + duration_s:g} s"
        )
    stretch = samples[start : start + count]
    # as long an interval before it as the template, so that drift cancels best
    before = samples[max(start - count, 0) : start]
    if before.size:
        stretch = stretch - before.mean()
    fading = max(round(FADE * count), 1)
    fade = 0.5 + 0.5 * np.cos(np.pi * (np.arange(fading) + 1) / (fading + 1))
    return checked_template(np.r_[stretch[:-fading], stretch[-fading:] * fade])


def blast_template(
    mass_kg: float,
    range_m: float,
    rate_hz: float,
    *,
    ambient_pressure_pa: float = STANDARD_PRESSURE,
    sound_speed_m_s: float = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[np.ndarray, " tap"]:
    """Return the blast of a charge at a range, by the laws, as a template [Pa].

    Args:
        mass_kg: TNT-equivalent mass [kg].
        range_m: Slant range [m].
        rate_hz: Sampling rate [Hz].
        ambient_pressure_pa: Ambient pressure [Pa].
        sound_speed_m_s: Speed of sound [m/s].
        burst: "surface" or "free-air".

    Raises:
        InputError: A number is not positive, or the blast is over within two samples.
    """
    mass = checked_positive("mass_kg", mass_kg, "kg")
    distance = checked_positive("range_m", range_m, "m")
    air = (ambient_pressure_pa, sound_speed_m_s)
    return blast_templates([mass], [distance], rate_hz, *air, burst)[0]


def blast_templates(
    masses_kg: Sequence[float],
    ranges_m: Sequence[float],
    rate_hz: float,
    ambient_pressure_pa: float = STANDARD_PRESSURE,
    sound_speed_m_s: float = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> list[Float[np.ndarray, " tap"]]:
    """Return one template for each of several charges [Pa]; as `blast_template`.

    Args:
        masses_kg: TNT-equivalent masses [kg].
        ranges_m: Slant ranges [m], of the same number.
        rate_hz: Sampling rate [Hz].
        ambient_pressure_pa: Ambient pressure [Pa].
        sound_speed_m_s: Speed of sound [m/s].
        burst: "surface" or "free-air".
    """
    from jblast.signals.law_pulses import pulses_by_law, sampled

    rate_hz = checked_positive("rate_hz", rate_hz, "Hz")
    mass, distance = (np.asarray(part, float) for part in (masses_kg, ranges_m))
    pulses = pulses_by_law(mass, distance, ambient_pressure_pa, sound_speed_m_s, burst)
    whole_s = np.asarray(pulses.duration + pulses.suction_duration, float)
    short = ~(whole_s * rate_hz >= 2)
    if short.any():
        nth = int(np.argmax(short))
        raise InputError(
            f"{argument('rate_hz')}: expected two samples within the "
            f"{whole_s[nth]:.3g} s of the blast of {mass[nth]:g} kg at "
            f"{distance[nth]:g} m, got {rate_hz:g} Hz"
        )
    if (long := ~(whole_s <= LONGEST_S)).any():
        nth = int(np.argmax(long))
        raise InputError(
            f"{argument('mass_kg')}, {argument('range_m')}: expected a blast of "
            f"{LONGEST_S:g} s at most, got {whole_s[nth]:.3g} s of {mass[nth]:g} kg at "
            f"{distance[nth]:g} m"
        )
    counts = np.ceil(whole_s * rate_hz).astype(int)
    # one compiled program for each power of two, not for each length
    longest = 2 ** int(counts.max() - 1).bit_length()
    rows = np.asarray(sampled(pulses, rate_hz, longest), float)
    return [checked_template(row[:n]) for row, n in zip(rows, counts, strict=True)]


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
