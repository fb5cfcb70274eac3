r"""Negative phase on a rigid wall facing the charge, as fitted by Rigby et al.

Rigby et al. (2014), read in one place only: as coded in AnaWaldila/dynablast2.0
@598f47a, Class_Blast.m.
Nobody here has seen the paper, and a slip in that one transcription would go unnoticed,
but for two checks. Neighbouring pieces meet within 1 %. And for Z = 1 to 10 the
free-air fits lie below the table of `ufc.py`, by 8 to 23 % in pressure
(most at Z = 1.5), 4 to 14 % in impulse and 0 to 2 % in duration.

Each curve is made of constants, parabolas and powers of $Z$. They are blended in ln y
over 5 % of Z where they meet. Pressures stay below 101 kPa, so below the ambient
pressure.

Range: the transcription states none; taken as that of the tables of Kingery and
Bulmash, Z = 0.0674 (free-air 0.0531) to 40 m/kg^(1/3). Outside it is a power law with
the end slope, finite and not valid.
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.waves.arguments import checked
from jblast.waves.laws.negative_phase.rigby_curves import CURVES, ENDS, SI_UNITS
from jblast.waves.scaling import (
    log_scaled_distance,
    sachs_impulse_factor,
    sachs_pressure_factor,
    sachs_time_factor,
    scaled_distance,
)


@checked
def rigby_reflected_negative_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the greatest underpressure on the wall, positive [Pa]: at most ambient.

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = CURVES["pressure", burst]
    value = SI_UNITS["pressure"] * jnp.exp(curve.log_value(log_z))
    return sachs_pressure_factor(ambient_pressure) * value


@checked
def rigby_reflected_negative_impulse(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the impulse of the negative phase on the wall, positive [Pa s].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = CURVES["impulse", burst]
    value = SI_UNITS["impulse"] * jnp.exp(curve.log_value(log_z))
    return sachs_impulse_factor(charge_mass, ambient_pressure, sound_speed) * value


@checked
def rigby_negative_duration(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the duration of the negative phase on the wall [s].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = CURVES["duration", burst]
    value = SI_UNITS["duration"] * jnp.exp(curve.log_value(log_z))
    return sachs_time_factor(charge_mass, ambient_pressure, sound_speed) * value


def rigby_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Bool[Array, "..."]:
    """Return where the fits are taken to hold: the range is assumed."""
    first, last = ENDS[burst]
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= first) & (z <= last)


for _quantity, _what, _function in (
    ("reflected_negative_pressure_pa", "pressure", rigby_reflected_negative_pressure),
    ("reflected_negative_impulse_pa_s", "impulse", rigby_reflected_negative_impulse),
    ("negative_duration_s", "duration", rigby_negative_duration),
):
    register(
        Law(
            quantity=_quantity,
            name="rigby_2014",
            function=_function,
            range="Z = 0.0674 (free-air 0.0531) to 40 m/kg^(1/3), assumed; "
            "one transcription",
            source="Rigby et al. 2014, over one transcription",
            valid=rigby_valid,
            scatter=declared_scatter(shot=0.15, record=0.10),
            scatter_source="declared",
            joins=tuple(
                z
                for burst, ends in ENDS.items()
                for z in (
                    ends[0],
                    *(piece.z_max for piece in CURVES[_what, burst].segments),
                )
            ),
        )
    )
