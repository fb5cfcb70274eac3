r"""Air blast of a TNT sphere in free air or a TNT hemisphere on the ground.

Kingery and Bulmash (1984), ARBRL-TR-02555, read second-hand: the provenance, the
misprints and one unresolved digit stand in `data/kingery_bulmash.csv`. Each curve is

$$Y = 10^{C_0 + C_1 U + C_2 U^2 + \dots}, \qquad U = K_0 + K_1 \log_{10} Z$$

of the scaled distance $Z$ of `scaling.py`, brought to other air by Sachs' factors.

Range: Z = 0.0674 to 40 m/kg^(1/3) (surface), 0.0531 to 40 (free-air); durations from
0.178 and 0.147. Outside it is a power law with the end slope, finite and not valid.

Pressures, reflected impulse, arrival and shock speed are one polynomial each. Impulse
has one join and duration two, where the printed curves jump; they are blended over
5 % in Z (2.5 % to each side). Inside a blend the curve differs from the printed one
by at most 0.35 % (impulse, surface, Z = 0.955), 0.31 % (free-air, 0.792), 0.92 and
0.44 % (duration, surface, 1.01 and 2.78), 0.48 and 0.04 % (free-air, 0.888 and 2.28),
half of the printed jump or a little more; outside it agrees to rounding. The slope
d ln Y/d ln Z passes through -0.33 to 1.34 (surface impulse), -0.43 to 1.15 (free-air),
1.98 to 3.45 and 0.93 to 1.45 (surface duration), 0.67 to 1.44 and 1.08 to 1.27.
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.types import as_float_array
from jblast.waves.arguments import checked
from jblast.waves.laws.kingery_bulmash.table import (
    kingery_bulmash_curve,
    kingery_bulmash_joins,
)
from jblast.waves.scaling import (
    log_scaled_distance,
    sachs_impulse_factor,
    sachs_pressure_factor,
    sachs_time_factor,
    scaled_distance,
)

SOURCE = "Kingery & Bulmash 1984 (ARBRL-TR-02555), over eight transcriptions"
RANGE = "Z = 0.0674 (free-air 0.0531) to 40 m/kg^(1/3)"
DURATION_RANGE = "Z = 0.178 (free-air 0.147) to 40 m/kg^(1/3)"


@checked
def kingery_bulmash_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the peak incident (side-on) overpressure [Pa].

    The arguments here and below:

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = kingery_bulmash_curve("incident_pressure", burst)
    return sachs_pressure_factor(ambient_pressure) * jnp.exp(curve.log_value(log_z))


@checked
def kingery_bulmash_reflected_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the peak overpressure on a rigid wall facing the charge [Pa]."""
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = kingery_bulmash_curve("reflected_pressure", burst)
    return sachs_pressure_factor(ambient_pressure) * jnp.exp(curve.log_value(log_z))


@checked
def kingery_bulmash_impulse(
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
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = kingery_bulmash_curve("incident_impulse", burst)
    factor = sachs_impulse_factor(charge_mass, ambient_pressure, sound_speed)
    return factor * jnp.exp(curve.log_value(log_z))


@checked
def kingery_bulmash_reflected_impulse(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the impulse on a rigid wall facing the charge [Pa s]."""
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = kingery_bulmash_curve("reflected_impulse", burst)
    factor = sachs_impulse_factor(charge_mass, ambient_pressure, sound_speed)
    return factor * jnp.exp(curve.log_value(log_z))


@checked
def kingery_bulmash_duration(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the duration of the positive phase [s]."""
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = kingery_bulmash_curve("positive_phase_duration", burst)
    factor = sachs_time_factor(charge_mass, ambient_pressure, sound_speed)
    return factor * jnp.exp(curve.log_value(log_z))


@checked
def kingery_bulmash_arrival_time(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the time from detonation to the arrival of the shock [s].

    Do not differentiate it near Z = 40 to get a shock speed: that wiggles up to 7 %.
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = kingery_bulmash_curve("arrival_time", burst)
    factor = sachs_time_factor(charge_mass, ambient_pressure, sound_speed)
    return factor * jnp.exp(curve.log_value(log_z))


@checked
def kingery_bulmash_shock_speed(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the speed of the shock front [m/s]; at a given Z it goes with $c_0$.

    Past Z = 40 the power law leaves the speed of sound slowly (352 m/s at Z = 1e6 on
    the surface, 311 in free air): not valid there.
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = kingery_bulmash_curve("shock_front_velocity", burst)
    factor = as_float_array(sound_speed) / STANDARD_SOUND_SPEED
    return factor * jnp.exp(curve.log_value(log_z))


def kingery_bulmash_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Bool[Array, "..."]:
    """Return where the tables of all quantities but duration hold."""
    return _tabulated(
        "incident_pressure", burst, slant_range, charge_mass, ambient_pressure
    )


def kingery_bulmash_duration_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Bool[Array, "..."]:
    """Return where the table of duration holds: it starts later than the others."""
    return _tabulated(
        "positive_phase_duration", burst, slant_range, charge_mass, ambient_pressure
    )


def _tabulated(
    quantity: str, burst: str, slant_range, charge_mass, ambient_pressure
) -> Bool[Array, "..."]:
    """Return where a curve has its table."""
    curve = kingery_bulmash_curve(quantity, burst)
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= curve.z_min) & (z <= curve.z_max)


for _quantity, _function in {
    "air_arrival_s": kingery_bulmash_arrival_time,
    "peak_overpressure_pa": kingery_bulmash_pressure,
    "positive_impulse_pa_s": kingery_bulmash_impulse,
    "positive_duration_s": kingery_bulmash_duration,
    "reflected_pressure_pa": kingery_bulmash_reflected_pressure,
    "reflected_impulse_pa_s": kingery_bulmash_reflected_impulse,
    "shock_speed_m_s": kingery_bulmash_shock_speed,
}.items():
    _is_duration = _quantity == "positive_duration_s"
    _sd = 0.01 if _quantity in ("air_arrival_s", "shock_speed_m_s") else 0.10
    register(
        Law(
            quantity=_quantity,
            name="kingery_bulmash",
            function=_function,
            range=DURATION_RANGE if _is_duration else RANGE,
            source=SOURCE,
            valid=(
                kingery_bulmash_duration_valid
                if _is_duration
                else kingery_bulmash_valid
            ),
            scatter=declared_scatter(shot=_sd, record=_sd),
            scatter_source="declared",
            joins=kingery_bulmash_joins(),
        )
    )
