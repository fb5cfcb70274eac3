r"""Duration and impulse of the positive phase, from the charge to the far field.

Kingery and Bulmash to the end of their table, Z = 40 m/kg^(1/3); from there as in a
weak shock (Landau 1945; Whitham 1974, section 9.3), whose front eats the wave behind:

$$t_d = t_{40} \sqrt{\frac{\ln(Z/b)}{\ln(40/b)}}, \qquad i = i_{40}\,\frac{40}{Z}$$

with the length $b$ of the tail of the pressure (`front.py`). Peak times duration then
falls as $1/Z$, so the impulse keeps its share of it: 0.42 on the surface and 0.47 in
free air, near the 1/2 of the triangle that every such pulse becomes. It is what lets a
record go on with one picture: front, duration and impulse of one pulse.

Past 40 the curves are blended over 5 % in Z, where the slope of the duration falls from
0.31 to 0.18 (free air: 0.28 to 0.23), that of the impulse from -1.02 to -1 (-1.10).

Nothing here knows absorption, turbulence or weather. `ford_2021`, fitted to recordings
on the surface, has durations 13 % shorter at Z = 100 and 13 % longer at 1000, impulses
21 % and 44 % smaller. That is what is chosen there for a log; this is not
(`fidelity.measured_errors`). It gives durations and impulses where a record needs them
from one picture at all distances.

Range: that of Kingery's and Bulmash's tables nearer, to Z = 300. Past it the median of
recorded impulses is 0.7 of this, of durations 1.2 to 1.3 times; from 200 on the scatter
grows as measured (`waves/shock/far_scatter.py`).
"""

import math
from collections.abc import Callable

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.waves.arguments import checked
from jblast.waves.curves.log_polynomial import BLEND_WIDTH, smooth_step
from jblast.waves.laws.kingery_bulmash.table import (
    kingery_bulmash_curve,
    kingery_bulmash_joins,
)
from jblast.waves.laws.shock_kinematics.front import front_tail
from jblast.waves.scaling import (
    log_scaled_distance,
    sachs_impulse_factor,
    sachs_time_factor,
    scaled_distance,
)
from jblast.waves.shock.far_scatter import FAR_END, measured_far_scatter

END_OF_TABLE = 40.0
"""Up to which the curves are Kingery's and Bulmash's [m/kg^(1/3)]."""

BLEND = END_OF_TABLE * math.sqrt(1.0 + BLEND_WIDTH)
"""Middle of the blend, which begins where the table ends [m/kg^(1/3)]."""


@checked
def shock_kinematics_duration(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the duration of the positive phase [s].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    length = math.log(front_tail(burst).length)
    start = math.log(END_OF_TABLE) - length
    log_value = _continued(
        "positive_phase_duration",
        burst,
        log_scaled_distance(slant_range, charge_mass, ambient_pressure),
        lambda log_z: 0.5 * (jnp.log(log_z - length) - math.log(start)),
    )
    factor = sachs_time_factor(charge_mass, ambient_pressure, sound_speed)
    return factor * jnp.exp(log_value)


@checked
def shock_kinematics_impulse(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the incident impulse of the positive phase [Pa s].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    log_value = _continued(
        "incident_impulse",
        burst,
        log_scaled_distance(slant_range, charge_mass, ambient_pressure),
        lambda log_z: math.log(END_OF_TABLE) - log_z,
    )
    factor = sachs_impulse_factor(charge_mass, ambient_pressure, sound_speed)
    return factor * jnp.exp(log_value)


def _continued(
    quantity: str,
    burst: str,
    log_z: Float[Array, "..."],
    log_growth: Callable[[Float[Array, "..."]], Float[Array, "..."]],
) -> Float[Array, "..."]:
    """Return ln of a curve of the table, that goes on past its end.

    Args:
        quantity: As the table calls it.
        burst: "surface" or "free-air".
        log_z: ln of the scaled distance.
        log_growth: ln of the far curve over its value at the end of the table, there.
    """
    curve = kingery_bulmash_curve(quantity, burst)
    near = curve.log_value(log_z)
    end = math.log(END_OF_TABLE)
    at_end = curve.segments[-1].log_value(end)
    far = at_end + log_growth(jnp.maximum(log_z, end))
    return near + smooth_step(log_z, BLEND) * (far - near)


def shock_kinematics_duration_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Bool[Array, "..."]:
    """Return where it holds: from the first tabulated duration to Z = 300."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    first = kingery_bulmash_curve("positive_phase_duration", burst).z_min
    return (z >= first) & (z <= FAR_END)


def shock_kinematics_impulse_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Bool[Array, "..."]:
    """Return where it holds: from the first tabulated impulse to Z = 300."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    first = kingery_bulmash_curve("incident_impulse", burst).z_min
    return (z >= first) & (z <= FAR_END)


for _quantity, _function, _valid, _first in (
    (
        "positive_duration_s",
        shock_kinematics_duration,
        shock_kinematics_duration_valid,
        "0.178 (free-air 0.147)",
    ),
    (
        "positive_impulse_pa_s",
        shock_kinematics_impulse,
        shock_kinematics_impulse_valid,
        "0.0674 (free-air 0.0531)",
    ),
):
    register(
        Law(
            quantity=_quantity,
            name="shock_kinematics",
            function=_function,
            range=f"Z = {_first} to 300 m/kg^(1/3); no absorption",
            source="Kingery & Bulmash 1984 to Z = 40, weak shock from there",
            valid=_valid,
            scatter=declared_scatter(shot=0.10, record=0.10),
            scatter_source="declared",
            joins=kingery_bulmash_joins(),
            far_scatter=measured_far_scatter(_quantity),
        )
    )
