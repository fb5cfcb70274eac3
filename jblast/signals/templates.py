"""Templates: recorded blasts and blasts by the laws.

A template begins with the sample at which the front arrives. The filter does not depend
on its scale. By the laws it is the mean of the pressure over each sample, as an
instrument records it, from the front to the end of the suction, without ground effects
and echoes.
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

LONGEST_S = 60.0
"""Longest duration of a template [s]: that of a nuclear blast; its samples and the
equations of its filter stay within memory."""
FADE = 0.2
"""Share of a recorded template over which its end fades; a cut would be another
front."""


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
