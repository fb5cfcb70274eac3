r"""The whole pressure record of a burst at a place, from detonation on.

Nothing until the arrival by Kingery and Bulmash; then Friedlander's pulse with their
peak and duration, and the decay that gives it their impulse; then the cubic negative
phase, with peak and impulse of the table of UFC 3-340-02. Its duration is the cubic's
own for these two, $t^- = \tfrac{16}{9}\,i^-/P^-$, as in NAVFAC DM-2.08: that of the
table would give up to 1.85 times the tabulated impulse (Z = 0.5 to 2).

At the end of the positive phase the pressure is continuous, its slope is not. The
pressure never falls below vacuum.

The negative table is for free air. On the surface it is read for the mass that makes
the same peak there: `ground_factor` times as much, 1.4 near the charge to 2.0 far away.

Range: Z = 0.178 to 40 m/kg^(1/3) on the surface, 0.147 to 36.975 in free air, where all
its parts hold; finite elsewhere. In single precision the time since arrival is the
difference of two larger numbers: far away, where a millisecond is little of the travel
time, use double precision.
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.types import as_float_arrays
from jblast.waves.arguments import checked
from jblast.waves.friedlander import friedlander_decay, modified_friedlander_pressure
from jblast.waves.ground_factor import ground_factor
from jblast.waves.kingery_bulmash import (
    kingery_bulmash_arrival_time,
    kingery_bulmash_duration,
    kingery_bulmash_impulse,
    kingery_bulmash_pressure,
)
from jblast.waves.negative_phase import negative_phase_pressure
from jblast.waves.negative_phase_ufc import ufc_negative_impulse, ufc_negative_pressure


@checked
def blast_pressure(
    time_since_detonation: Float[ArrayLike, "..."],
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the incident overpressure at a place and time [Pa].

    Args:
        time_since_detonation: When [s].
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    time, distance, mass, ambient, speed = as_float_arrays(
        time_since_detonation, slant_range, charge_mass, ambient_pressure, sound_speed
    )
    peak = kingery_bulmash_pressure(distance, mass, ambient, burst)
    impulse = kingery_bulmash_impulse(distance, mass, ambient, speed, burst)
    duration = kingery_bulmash_duration(distance, mass, ambient, speed, burst)
    decay = friedlander_decay(peak, impulse, duration)

    seen_mass = mass
    if burst == "surface":
        seen_mass = ground_factor(distance, mass, ambient) * mass
    suction = ufc_negative_pressure(distance, seen_mass, ambient)
    suction_impulse = ufc_negative_impulse(distance, seen_mass, ambient, speed)
    suction_duration = 16.0 / 9.0 * suction_impulse / suction

    time = time - kingery_bulmash_arrival_time(distance, mass, ambient, speed, burst)
    positive = time < duration
    return jnp.where(
        positive,
        # which for negative decays grows without bound past the positive phase
        modified_friedlander_pressure(
            jnp.where(positive, time, 0.0), peak, duration, decay
        ),
        negative_phase_pressure(time, duration, suction, suction_duration),
    )
