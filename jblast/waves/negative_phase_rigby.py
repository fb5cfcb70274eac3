r"""Negative phase on a rigid wall facing the charge, as fitted by Rigby et al.

Rigby et al. (2014), read in one place only: as coded in AnaWaldila/dynablast2.0
@598f47a, Class_Blast.m.
Nobody here has seen the paper, and a slip in that one transcription would go unnoticed,
but for two checks. Neighbouring pieces meet within 1 %. And for Z = 1 to 10 the
free-air fits lie below the table of `negative_phase_ufc.py`, by 8 to 23 % in pressure
(most at Z = 1.5), 4 to 14 % in impulse and 0 to 2 % in duration.

Each curve is made of constants, parabolas and powers of $Z$. They are blended in ln y
over 5 % of Z where they meet. Pressures stay below 101 kPa, so below the ambient
pressure.

Range: the transcription states none; taken as that of the tables of Kingery and
Bulmash, Z = 0.0674 (free-air 0.0531) to 40 m/kg^(1/3). Outside it is a power law with
the end slope, finite and not valid.
"""

import math
from dataclasses import dataclass

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.waves.arguments import checked
from jblast.waves.log_curve import BLEND_WIDTH, smooth_step
from jblast.waves.scaling import (
    log_scaled_distance,
    sachs_impulse_factor,
    sachs_pressure_factor,
    sachs_time_factor,
    scaled_distance,
)

ENDS = {"surface": (0.0674, 40.0), "free-air": (0.0531, 40.0)}
"""First and last scaled distance [m/kg^(1/3)]: assumed."""


@dataclass(frozen=True)
class _Parabola:
    """y = a Z^2 + b Z + c."""

    a: float
    b: float
    c: float

    def log_value(self, log_z):
        """Return ln y."""
        z = jnp.exp(log_z)
        return jnp.log((self.a * z + self.b) * z + self.c)

    def log_slope(self, z: float) -> float:
        """Return d ln y/d ln Z."""
        return (2 * self.a * z + self.b) * z / ((self.a * z + self.b) * z + self.c)


@dataclass(frozen=True)
class _Power:
    """y = a Z^n."""

    a: float
    n: float = 0.0

    def log_value(self, log_z):
        """Return ln y."""
        return math.log(self.a) + self.n * log_z

    def log_slope(self, z: float) -> float:
        """Return d ln y/d ln Z."""
        return self.n


# Pieces, and between them the Z where one ends and the next begins.
# kPa; kPa-ms/kg^(1/3); ms/kg^(1/3)
CURVES = {
    ("pressure", "surface"): (
        _Power(100.0),
        0.669,
        _Parabola(-32.91, 13.0, 106.0),
        1.27,
        _Power(93.0, -1.215),
        2.78,
        _Power(72.99, -0.978),
    ),
    ("impulse", "surface"): (
        _Parabola(-724.37, 445.34, 553.0),
        0.58,
        _Parabola(11.356, -314.76, 752.0),
        1.19,
        _Power(461.8, -0.88),
        5.25,
        _Power(433.6, -0.842),
    ),
    ("duration", "surface"): (
        _Power(10.57),
        0.267,
        _Parabola(-0.474, 2.745, 9.87),
        2.9,
        _Power(13.9),
    ),
    ("pressure", "free-air"): (
        _Power(100.0),
        0.7,
        _Parabola(-29.078, 0.0352, 114.0),
        1.469,
        _Power(84.132, -1.286),
        2.754,
        _Power(59.559, -0.945),
    ),
    ("impulse", "free-air"): (
        _Power(496.0),
        0.304,
        _Parabola(36.919, -298.72, 583.0),
        1.44,
        _Power(316.36, -0.879),
    ),
    ("duration", "free-air"): (
        _Parabola(0.382, 2.952, 7.917),
        0.537,
        _Parabola(-0.309, 1.6443, 8.818),
        2.83,
        _Power(11.0),
    ),
}
SI_UNITS = {"pressure": 1e3, "impulse": 1.0, "duration": 1e-3}


def _scaled_value(quantity, burst, slant_range, charge_mass, ambient_pressure):
    """Return a curve's SI value at the scaled distance."""
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    parts = CURVES[quantity, burst]
    pieces, joins = parts[::2], parts[1::2]
    first, last = ENDS[burst]
    half = 0.5 * math.log1p(BLEND_WIDTH)
    inside = jnp.clip(log_z, math.log(first), math.log(last))
    # No piece sees more than its own stretch and its blends: parabolas turn negative.
    value = pieces[0].log_value(jnp.minimum(inside, math.log(joins[0]) + half))
    for k, join in enumerate(joins, start=1):
        end = joins[k] if k < len(joins) else last
        stretch = math.log(join) - half, math.log(end) + half
        piece = pieces[k].log_value(jnp.clip(inside, *stretch))
        value = value + smooth_step(inside, join) * (piece - value)
    end_slope = jnp.where(
        log_z < 0.0, pieces[0].log_slope(first), pieces[-1].log_slope(last)
    ).astype(log_z.dtype)
    # Exactly on an end each of the two terms gives half of the slope: together one.
    return SI_UNITS[quantity] * jnp.exp(value + end_slope * (log_z - inside))


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
    return sachs_pressure_factor(ambient_pressure) * _scaled_value(
        "pressure", burst, slant_range, charge_mass, ambient_pressure
    )


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
    return sachs_impulse_factor(
        charge_mass, ambient_pressure, sound_speed
    ) * _scaled_value("impulse", burst, slant_range, charge_mass, ambient_pressure)


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
    return sachs_time_factor(
        charge_mass, ambient_pressure, sound_speed
    ) * _scaled_value("duration", burst, slant_range, charge_mass, ambient_pressure)


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


for _quantity, _curve, _function in (
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
                for z in sorted({*ends, *CURVES[_curve, burst][1::2]})
            ),
        )
    )
