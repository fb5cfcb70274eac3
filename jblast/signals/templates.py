"""Templates: blasts by the laws.

A template begins with the sample at which the front arrives. The filter does not depend
on its scale. It is the mean of the pressure over each sample, as an
instrument records it, from the front to the end of the suction, without ground effects
and echoes.

Pulses by the laws differ mostly in duration: a bank in even steps of ln duration has a
member near any blast, with which a matched filter loses little.
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.errors import InputError, argument
from jblast.kept_programs import kept
from jblast.signals.noise import checked_positive, checked_template
from jblast.types import as_float_arrays
from jblast.waves.laws.shock_kinematics import shock_kinematics_impulse
from jblast.waves.pulse import Pulse, blast_pulse, pulse_of, weak_shock_rise_time

LONGEST_S = 60.0
"""Longest duration of a template [s]: that of a nuclear blast; its samples and the
equations of its filter stay within memory."""
DURATION_RATIO = 2**0.5
"""Ratio of neighbouring durations of the bank. Half a step away, in white noise, 0.93
of the signal remains, a loss of 0.6 dB."""
DURATIONS = tuple(0.001 * DURATION_RATIO**nth for nth in range(14))
"""Positive phases of the bank, 1 to 91 ms [s]: from 2 g to 2 t at Z = 50."""
BANK_SCALED_DISTANCE = 50.0
"""Scaled distance of the bank's pulses [m/kg^(1/3)]: there the form hardly depends on
it, as all pulses of one duration beyond Z = 5."""
AIR = STANDARD_PRESSURE, STANDARD_SOUND_SPEED


def blast_template(
    mass_kg: float, range_m: float, rate_hz: float
) -> Float[np.ndarray, " tap"]:
    """Return the blast of a charge on the ground, by the laws, as a template [Pa].

    Args:
        mass_kg: TNT-equivalent mass [kg].
        range_m: Slant range [m].
        rate_hz: Sampling rate [Hz].

    Raises:
        InputError: A number is not positive, or the blast is over within two samples.
    """
    mass = checked_positive("mass_kg", mass_kg, "kg")
    distance = checked_positive("range_m", range_m, "m")
    return blast_templates([mass], [distance], rate_hz)[0]


def blast_templates(
    masses_kg: Sequence[float], ranges_m: Sequence[float], rate_hz: float
) -> list[Float[np.ndarray, " tap"]]:
    """Return one template for each of several charges; as `blast_template`."""
    rate_hz = checked_positive("rate_hz", rate_hz, "Hz")
    mass, distance = (np.asarray(part, float) for part in (masses_kg, ranges_m))
    pulses = _pulses(mass, distance)
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
    rows = np.asarray(_sampled(pulses, rate_hz, longest), float)
    return [checked_template(row[:n]) for row, n in zip(rows, counts, strict=True)]


def bank_of_pulses(rate_hz: float) -> list[np.ndarray]:
    """Return templates of the `DURATIONS` of at least one sample.

    Args:
        rate_hz: Sampling rate [Hz].

    Raises:
        InputError: The rate is too low for all of them.
    """
    unit = float(blast_pulse(BANK_SCALED_DISTANCE, 1.0, *AIR, "surface").duration)
    # at one scaled distance, durations and distances scale as W^(1/3)
    long = [one for one in DURATIONS if one * rate_hz >= 1.0] or DURATIONS[-1:]
    size = np.array(long) / unit
    masses, ranges = size**3, BANK_SCALED_DISTANCE * size
    return blast_templates(masses.tolist(), ranges.tolist(), rate_hz)


@kept
def _pulses(
    mass: Float[ArrayLike, " pulse"], distance: Float[ArrayLike, " pulse"]
) -> Pulse:
    """Return blasts on the ground whose fronts arrive at time zero."""
    mass, distance, *air = as_float_arrays(mass, distance, *AIR)
    ambient, speed = (jnp.broadcast_to(x, mass.shape) for x in air)
    blast = blast_pulse(distance, mass, ambient, speed, "surface")
    impulse = shock_kinematics_impulse(distance, mass, ambient, speed, "surface")
    rise = weak_shock_rise_time(blast.peak, impulse, blast.duration)
    return pulse_of(
        jnp.zeros_like(mass),
        blast.peak,
        impulse,
        blast.duration,
        rise,
        blast.suction,
        9.0 / 16.0 * blast.suction * blast.suction_duration,
    )


@kept
def _sampled(pulses: Pulse, rate_hz: float, count: int) -> Float[Array, "pulse sample"]:
    """Return the mean of each pulse over each sample from its front on [Pa]."""
    edges = jnp.arange(count + 1, dtype=pulses.peak.dtype) / rate_hz
    return jax.vmap(lambda pulse: pulse.mean(edges[:-1], edges[1:]))(pulses)
