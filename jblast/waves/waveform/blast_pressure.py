r"""The whole pressure record of a burst at a place, from detonation on.

What one blast is at a place, `blast_pulse`, is told here once; records and the loads on
vehicles (`vehicle.loads.blast`) both follow from it:

- arrival and peak: `shock_kinematics`, whose peak is Kingery's and Bulmash's up to
  Z = 20 and whose front has the speed that its peak asks for;
- duration: Kingery and Bulmash, past Z = 40 that of a weak shock; the decay gives
  Friedlander's pulse their impulse (`positive_phase.py` of `shock_kinematics`);
- then the cubic negative phase, with peak and impulse of the table of UFC 3-340-02.
  Its duration is the cubic's own for these two, $t^- = \tfrac{16}{9}\,i^-/P^-$, as in
  NAVFAC DM-2.08: that of the table would give up to 1.85 times the tabulated impulse
  (Z = 0.5 to 2).

A vehicle's wave has the same pulse and the same $P^-$, but a negative phase of another
length: that whose impulse is the pulse's own, $t^- = \tfrac{16}{9}\,i^+/P^-$. With the
tabulated one, 5 to 16 % larger at Z = 5 to 36, a third at 2, by half at 1, the wind, in
which the pressure is integrated, would not end.

At the end of the positive phase the pressure is continuous, its slope is not. The
pressure never falls below vacuum.

The negative table is for free air. On the surface it is read for the mass that makes
the same peak there: `ground_factor` times as much, 1.4 near the charge to 2.0 far away.
Past its last point, Z = 36.975 there (46.7 on the surface), suction and its impulse
keep their shares of peak and impulse: 0.49 and 1.20 (0.53 and 1.12 in free air).

Range: Z = 0.178 (free air 0.147) to 1e4 m/kg^(1/3), without absorption; finite
elsewhere. In single precision the time since arrival is the
difference of two larger numbers: far away, where a millisecond is little of the travel
time, use double precision.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.types import as_float_arrays
from jblast.waves.arguments import checked
from jblast.waves.laws.ground_factor import ground_factor
from jblast.waves.laws.negative_phase.ufc import (
    LAST as LAST_SUCTION,
    ufc_negative_impulse,
    ufc_negative_pressure,
)
from jblast.waves.laws.shock_kinematics.laws import (
    shock_kinematics_arrival_time,
    shock_kinematics_pressure,
)
from jblast.waves.laws.shock_kinematics.positive_phase import (
    shock_kinematics_duration,
    shock_kinematics_impulse,
)
from jblast.waves.scaling import sachs_distance_factor
from jblast.waves.waveform.friedlander import (
    friedlander_decay,
    modified_friedlander_pressure,
)
from jblast.waves.waveform.negative_phase import negative_phase_pressure


class BlastPulse(NamedTuple):
    r"""What one blast is at a place.

    Attributes:
        arrival_time: From detonation to the front [s].
        peak: Overpressure at the front $P_s$ [Pa].
        duration: Of the positive phase $t_d$ [s].
        decay: Friedlander's $b$, which gives the positive impulse [-].
        suction: Greatest underpressure $P^-$ [Pa].
        suction_impulse: Of the negative phase, $i^-$ [Pa s].
    """

    arrival_time: Float[Array, "..."]
    peak: Float[Array, "..."]
    duration: Float[Array, "..."]
    decay: Float[Array, "..."]
    suction: Float[Array, "..."]
    suction_impulse: Float[Array, "..."]


@checked
def blast_pulse(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> BlastPulse:
    """Return what one blast is at a place.

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    distance, mass, ambient, speed = as_float_arrays(
        slant_range, charge_mass, ambient_pressure, sound_speed
    )
    peak = shock_kinematics_pressure(distance, mass, ambient, burst)
    impulse = shock_kinematics_impulse(distance, mass, ambient, speed, burst)
    duration = shock_kinematics_duration(distance, mass, ambient, speed, burst)
    return BlastPulse(
        shock_kinematics_arrival_time(distance, mass, ambient, speed, burst),
        peak,
        duration,
        friedlander_decay(peak, impulse, duration),
        *suction_of(distance, mass, ambient, speed, burst),
    )


def suction_of(
    distance: Float[Array, "..."],
    mass: Float[Array, "..."],
    ambient: Float[Array, "..."],
    speed: Float[Array, "..."],
    burst: str,
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Return greatest underpressure [Pa] and impulse [Pa s] of the negative phase.

    Args:
        distance: Range $R$ [m], positive.
        mass: TNT-equivalent mass $W$ [kg], positive.
        ambient: $P_0$ [Pa], positive.
        speed: $c_0$ [m/s], positive.
        burst: "surface" or "free-air".
    """
    seen_mass = mass
    if burst == "surface":
        seen_mass = ground_factor(distance, mass, ambient) * mass
    last = LAST_SUCTION * sachs_distance_factor(seen_mass, ambient)
    known = jnp.minimum(distance, last)

    def share(law, *air):
        """Return what is left of a law's value past the last point of the tables."""
        here, there = (law(r, mass, *air, burst=burst) for r in (distance, known))
        return here / there

    return (
        ufc_negative_pressure(known, seen_mass, ambient)
        * share(shock_kinematics_pressure, ambient),
        ufc_negative_impulse(known, seen_mass, ambient, speed)
        * share(shock_kinematics_impulse, ambient, speed),
    )


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
    pulse = blast_pulse(distance, mass, ambient, speed, burst)
    duration, suction = pulse.duration, pulse.suction
    suction_duration = 16.0 / 9.0 * pulse.suction_impulse / suction
    time = time - pulse.arrival_time
    positive = time < duration
    return jnp.where(
        positive,
        # which for negative decays grows without bound past the positive phase
        modified_friedlander_pressure(
            jnp.where(positive, time, 0.0), pulse.peak, duration, pulse.decay
        ),
        negative_phase_pressure(time, duration, suction, suction_duration),
    )
