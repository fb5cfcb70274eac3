r"""Scaled distance and Sachs' factors: one curve for every charge and atmosphere.

Hopkinson (1915) and Cranz (1926): at a given ambient air, distance, time and impulse
grow as $W^{1/3}$ while pressure stays. Sachs (1944, BRL Report 466): in other air the
overpressure over the ambient pressure $P_0$ depends on $R (P_0/W)^{1/3}$ alone. The
curves are tabulated for 101325 Pa and 340.29 m/s; evaluate them at $Z = R/S_d$ and
multiply by the factors below. Temperature enters only through the sound speed.

Half of a nuclear yield goes into air blast, the rest into heat and radiation, so a
charge of mass W blasts like a nuclear yield of 2 W: 1 kt of TNT like 2 kt. The factor
is MultiPEM's C2N = 2. A law for a yield is therefore evaluated at Y = 2 W, and at a
distance in metres per kt^(1/3).
"""

import math

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.types import as_float_array, as_float_arrays
from jblast.waves.arguments import checked

NUCLEAR_YIELD_PER_MASS = 2.0
"""Nuclear yield with the air blast of a TNT charge, over its mass [-]."""

NUCLEAR_SCALED_METRES = (1e6 / NUCLEAR_YIELD_PER_MASS) ** (1.0 / 3.0)
"""Scaled distance in m/kt^(1/3) that is 1 m/kg^(1/3): 79.37 [kg^(1/3)/kt^(1/3)]."""

LOG_NUCLEAR_SCALED_METRES = math.log(NUCLEAR_SCALED_METRES)


@checked
def scaled_distance(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    r"""Return the scaled distance $Z = R/S_d$ [m/kg^(1/3)].

    At standard pressure it is Hopkinson's and Cranz's $Z = R/W^{1/3}$.

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    slant_range = as_float_array(slant_range)
    return slant_range / sachs_distance_factor(charge_mass, ambient_pressure)


def log_scaled_distance(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    r"""Return $\ln Z = \ln R - \tfrac13 \ln(W/S_p)$, what the curves are evaluated at.

    Two logarithms: cheaper than the cube root and its logarithm.

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    slant_range, charge_mass = as_float_arrays(slant_range, charge_mass)
    return jnp.log(slant_range) - (
        jnp.log(charge_mass / sachs_pressure_factor(ambient_pressure)) / 3.0
    )


@checked
def sachs_pressure_factor(
    ambient_pressure: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return $S_p = P_0 / 101325$ Pa, by which pressures multiply [-].

    Args:
        ambient_pressure: $P_0$ [Pa].
    """
    return as_float_array(ambient_pressure) / STANDARD_PRESSURE


@checked
def sachs_distance_factor(
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    r"""Return $S_d = (W/S_p)^{1/3}$, by which distances multiply [kg^(1/3)].

    Args:
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    charge_mass = as_float_array(charge_mass)
    # Neither cbrt, which XLA does not vectorise on a CPU, nor a power: this shares its
    # logarithm with that of Z, which makes an arrival a third faster.
    log_mass = jnp.log(charge_mass / sachs_pressure_factor(ambient_pressure))
    return jnp.exp(log_mass / 3.0)


@checked
def sachs_time_factor(
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    r"""Return $S_t = S_d \cdot 340.29/c_0$, by which times multiply [kg^(1/3)].

    In dry air it is the usual $S_d (288.15/T)^{1/2}$.

    Args:
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
    """
    distance_factor, sound_speed = as_float_arrays(
        sachs_distance_factor(charge_mass, ambient_pressure), sound_speed
    )
    return distance_factor * (STANDARD_SOUND_SPEED / sound_speed)


@checked
def sachs_impulse_factor(
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    r"""Return $S_i = S_p S_t$, by which impulses multiply [kg^(1/3)].

    Args:
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
    """
    return sachs_pressure_factor(ambient_pressure) * sachs_time_factor(
        charge_mass, ambient_pressure, sound_speed
    )
