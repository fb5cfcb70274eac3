"""Rigby et al. (2014): negative phase on a rigid wall facing the charge.

The only source is the code of AnaWaldila/dynablast2.0 @598f47a, Class_Blast.m. The
paper was not available, so a mistake in that one transcription could be found by two
checks only. Neighbouring pieces meet within 1 %. For Z = 1 to 10 the free-air fits lie
below the table of `negative_phase_ufc.py`, by 8 to 23 % in pressure (most at Z = 1.5),
4 to 14 % in impulse and 0 to 2 % in duration.

Each curve is made of constants, parabolas and powers of $Z$. They are blended in ln y
over 5 % of Z where they meet. Pressures stay below 101 kPa, so below the ambient
pressure.

Range: the transcription states none; taken as that of the tables of Kingery and
Bulmash, Z = 0.0674 (free-air 0.0531) to 40 m/kg^(1/3). Outside it is a power law with
the end slope, finite and not valid.
"""

import math
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.waves.arguments import checked
from jblast.waves.curves import LogCurve, LogPolynomial
from jblast.waves.scaling import (
    log_scaled_distance,
    sachs_impulse_factor,
    sachs_pressure_factor,
    sachs_time_factor,
    scaled_distance,
)

ENDS = {"surface": (0.0674, 40.0), "free-air": (0.0531, 40.0)}
"""First and last scaled distance [m/kg^(1/3)]: assumed."""


# Pieces as y = a Z^n, (a, n), or y = a Z^2 + b Z + c, (a, b, c), and the Z between.
# kPa; kPa-ms/kg^(1/3); ms/kg^(1/3)
PRINTED: dict[tuple[str, str], tuple[Any, ...]] = {
    ("pressure", "surface"): (
        (100.0, 0.0),
        0.669,
        (-32.91, 13.0, 106.0),
        1.27,
        (93.0, -1.215),
        2.78,
        (72.99, -0.978),
    ),
    ("impulse", "surface"): (
        (-724.37, 445.34, 553.0),
        0.58,
        (11.356, -314.76, 752.0),
        1.19,
        (461.8, -0.88),
        5.25,
        (433.6, -0.842),
    ),
    ("duration", "surface"): (
        (10.57, 0.0),
        0.267,
        (-0.474, 2.745, 9.87),
        2.9,
        (13.9, 0.0),
    ),
    ("pressure", "free-air"): (
        (100.0, 0.0),
        0.7,
        (-29.078, 0.0352, 114.0),
        1.469,
        (84.132, -1.286),
        2.754,
        (59.559, -0.945),
    ),
    ("impulse", "free-air"): (
        (496.0, 0.0),
        0.304,
        (36.919, -298.72, 583.0),
        1.44,
        (316.36, -0.879),
    ),
    ("duration", "free-air"): (
        (0.382, 2.952, 7.917),
        0.537,
        (-0.309, 1.6443, 8.818),
        2.83,
        (11.0, 0.0),
    ),
}
# 1 kPa ms is 1 Pa s, so the impulse needs no factor.
SI_UNITS = {"pressure": 1e3, "impulse": 1.0, "duration": 1e-3}


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
    """Return True within the assumed range of the fits."""
    first, last = ENDS[burst]
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= first) & (z <= last)


@dataclass(frozen=True)
class _Parabola:
    """y = a Z^2 + b Z + c."""

    z_min: float
    z_max: float
    a: float
    b: float
    c: float

    def log_value(self, log_z):
        """Return ln y."""
        z = jnp.exp(log_z)
        # Each printed parabola is positive on its own interval, so the logarithm
        # exists.
        return jnp.log((self.a * z + self.b) * z + self.c)

    def log_slope(self, log_z: float) -> float:
        """Return d ln y/d ln Z."""
        z = math.exp(log_z)
        return (2 * self.a * z + self.b) * z / ((self.a * z + self.b) * z + self.c)


def _curve(burst: str, printed: tuple[Any, ...]) -> LogCurve:
    """Return the curve of the printed segments and their joins."""
    first, last = ENDS[burst]
    ends = (first, *printed[1::2], last)
    segments = []
    for numbers, z_min, z_max in zip(printed[::2], ends, ends[1:], strict=False):
        if len(numbers) == 3:
            segments.append(_Parabola(z_min, z_max, *numbers))
        else:
            terms = (math.log(numbers[0]), numbers[1])
            segments.append(LogPolynomial(z_min, z_max, 0.0, 1.0, terms))
    return LogCurve(tuple(segments))


CURVES = {(what, burst): _curve(burst, PRINTED[what, burst]) for what, burst in PRINTED}
"""ln of the value in the units above against ln Z, by quantity and burst."""
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
