r"""A shock front from the charge to the acoustic limit, in one consistent picture.

Peak overpressure: Kingery and Bulmash up to $Z = 20$ m/kg^(1/3), from there the
weak-shock tail that meets it in value and slope. Not from 40, where their table ends:
its last stretch bends away (`calibration/kinematics_tail.py` prints it).
Surface: $A$ = 170256 Pa m/kg^(1/3), $b$ = 2.7953 m/kg^(1/3); free air: 105693, 4.8852.

Shock speed, by Rankine and Hugoniot for air of $\gamma$ = 1.4:
$$U = c_0 \sqrt{1 + \tfrac{6}{7}\, p/P_0}$$

Arrival, starting from the Kingery-Bulmash time at their first $Z$:
$$t = t_{KB}(R_1) + \int_{R_1}^{R} dr/U$$
so that $dt/dR = 1/U$ to rounding, which tends to $1/c_0$. The integral is tabulated at
first use (under 5 ms, `arrival.py`); in float64 its relative error is below
1e-10.

Listed points: at $Z = 20$ value and slope are continuous, curvature is not. At the
first $Z$ the slope of the arrival jumps (1 % surface, 7 % free air): below it, not
valid, the arrival goes on as Kingery's and Bulmash's power law.

Within the table the arrival is that of Kingery and Bulmash to 3.4 % (worst near
Z = 0.2, where the start decides), to 0.9 % past Z = 2. Below Z = 0.5 real air is slower
than the ideal gas: U is up to 5 % above their shock speed.

Range of arrival and speed: from the first $Z$ (0.0674 surface, 0.0531 free air) to 1e4;
past that the formulas continue, finite. Neither wind nor absorption is modelled.
Z = 1e4 is 10 km for 1 kg, where ISO 9613-1 (20 C, 70 % humidity) takes 3.4 dB at
125 Hz, above the 20 Hz or so where such a pulse is strongest; larger charges are lower
in pitch and lose less. That limit is a choice, not a measurement.

Range of the pressure: to Z = 300. Past it the median of recorded peaks is half of the
law, with a scatter of a factor of 1.6; from 200 on the scatter grows as measured
(`waves/shock/far_scatter.py`). A peak that is off by a factor of two moves the speed by
0.05 % at Z = 300.
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.types import as_float_array
from jblast.waves.arguments import checked
from jblast.waves.curves.arrival import log_sound_fraction
from jblast.waves.laws.kingery_bulmash.table import (
    kingery_bulmash_curve,
    kingery_bulmash_joins,
)
from jblast.waves.laws.shock_kinematics.arrival import shock_arrival
from jblast.waves.laws.shock_kinematics.front import (
    JOIN,
    front_log_pressure,
    front_mach_number,
)
from jblast.waves.scaling import (
    log_scaled_distance,
    sachs_pressure_factor,
    scaled_distance,
)
from jblast.waves.shock.far_scatter import FAR_END, measured_far_scatter

LAST_VALID = 1e4
"""Scaled distance up to which absorption may be neglected in an arrival
[m/kg^(1/3)]."""


@checked
def shock_kinematics_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the peak incident overpressure [Pa].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    return sachs_pressure_factor(ambient_pressure) * jnp.exp(
        front_log_pressure(log_z, burst)
    )


@checked
def shock_kinematics_shock_speed(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the speed of the shock front [m/s]: above $c_0$, and tending to it.

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    return as_float_array(sound_speed) * front_mach_number(log_z, burst)


@checked
def shock_kinematics_arrival_time(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the time from detonation to the arrival of the shock [s].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    sound_time = as_float_array(slant_range) / as_float_array(sound_speed)
    return sound_time * jnp.exp(log_sound_fraction(log_z, shock_arrival(burst)))


def shock_kinematics_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Bool[Array, "..."]:
    """Return where arrival and speed hold: from the first tabulated Z to 1e4."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    first = kingery_bulmash_curve("incident_pressure", burst).z_min
    return (z >= first) & (z <= LAST_VALID)


def shock_kinematics_pressure_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Bool[Array, "..."]:
    """Return where the pressure holds: from the first tabulated Z to 300."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    first = kingery_bulmash_curve("incident_pressure", burst).z_min
    return (z >= first) & (z <= FAR_END)


_FIRST = "Z = 0.0674 (free-air 0.0531)"
_TO_SOUND = f"{_FIRST} to 1e4 m/kg^(1/3); no absorption"
_RECORDED = f"{_FIRST} to 300 m/kg^(1/3); no absorption"

for _quantity, _function, _range, _valid, _sd, _far in (
    (
        "air_arrival_s",
        shock_kinematics_arrival_time,
        _TO_SOUND,
        shock_kinematics_valid,
        0.01,
        None,
    ),
    (
        "peak_overpressure_pa",
        shock_kinematics_pressure,
        _RECORDED,
        shock_kinematics_pressure_valid,
        0.10,
        measured_far_scatter("peak_overpressure_pa"),
    ),
    (
        "shock_speed_m_s",
        shock_kinematics_shock_speed,
        _TO_SOUND,
        shock_kinematics_valid,
        0.01,
        None,
    ),
):
    register(
        Law(
            quantity=_quantity,
            name="shock_kinematics",
            function=_function,
            range=_range,
            source="Kingery & Bulmash 1984 to Z = 20, weak-shock tail, 1/U integrated",
            valid=_valid,
            scatter=declared_scatter(shot=_sd, record=_sd),
            scatter_source="declared",
            joins=(*kingery_bulmash_joins(), JOIN),
            far_scatter=_far,
        )
    )
