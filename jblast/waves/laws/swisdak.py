r"""Swisdak (1994): air blast of a TNT hemisphere on the ground.

The metric rows of *Simplified Kingery airblast calculations*, read second-hand; the
provenance stands in `data/swisdak_1994.csv`. Each curve is

$$Y = e^{A + B L + C L^2 + \dots + G L^6}, \qquad L = \ln Z$$

of the scaled distance $Z$ of `scaling.py`, brought to other air by Sachs' factors. It
refits the curves of Kingery and Bulmash on the surface with polynomials short enough to
type: within 0.5 % rms and 1.9 % at worst of `kingery_bulmash`.

Range, Z in m/kg^(1/3): incident pressure and duration 0.2 to 40, incident impulse 0.2
to 158.7, all others 0.06 to 40. Past 23.8 the incident pressure is the power
$Z^{-1.4066}$, past 33.7 the incident impulse $Z^{-1.062}$. The pressure is printed to
198.5 (452 Pa at 130, as DDESB's tables have it), but a weak shock decays as $Z^{-1.1}$,
and so did seven shots that were recorded from Z = 20 to 300: against them this curve
falls too fast by $Z^{0.24}$ (0.19 to 0.32), `shock_kinematics` (668 Pa at 130) by
$Z^{0.0}$ (-0.06 to 0.07; `calibration/results/far_pressure.txt`). So for pressure it
ends where the other curves do. Outside the range a curve is a power law with its end
slope, finite and not valid.

Neighbouring segments do not meet: the printed curves jump by -0.04 % (incident
pressure, Z = 2.9), 0.70 % (23.8), -0.24, -2.40 and -0.18 % (incident impulse, 0.96,
2.38, 33.7), 0.08 % (reflected pressure, 2), 0.16 % (arrival, 1.5), -1.19 and -0.90 %
(duration, 1.02, 2.8) and -0.11 % (shock speed, 1.5). They are blended over 5 % in Z
(`waves/curves.py`); outside the blends the curves are the printed ones to
rounding.
"""

from collections.abc import Callable
from functools import cache

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.types import as_float_array
from jblast.waves.arguments import checked
from jblast.waves.curves import LogCurve, LogPolynomial, data_rows
from jblast.waves.laws.kingery_bulmash import segment_in_si
from jblast.waves.scaling import (
    log_scaled_distance,
    sachs_impulse_factor,
    sachs_pressure_factor,
    sachs_time_factor,
    scaled_distance,
)

# The print goes to 198.5, but recorded shots decay more slowly past 20 (see above).
END = {"incident_pressure": 40.0}
"""Largest valid scaled distance of curves that are printed farther [m/kg^(1/3)]."""
SOURCE = "Swisdak 1994 (ADA526744), metric, over three transcriptions"


@checked
def swisdak_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    """Return the peak incident (side-on) overpressure [Pa].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = swisdak_curve("incident_pressure")
    return sachs_pressure_factor(ambient_pressure) * jnp.exp(curve.log_value(log_z))


@checked
def swisdak_reflected_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    """Return the peak overpressure on a rigid wall facing the charge [Pa]."""
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = swisdak_curve("reflected_pressure")
    return sachs_pressure_factor(ambient_pressure) * jnp.exp(curve.log_value(log_z))


@checked
def swisdak_impulse(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    """Return the incident impulse of the positive phase [Pa s].

    The arguments here and below:

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = swisdak_curve("incident_impulse")
    factor = sachs_impulse_factor(charge_mass, ambient_pressure, sound_speed)
    return factor * jnp.exp(curve.log_value(log_z))


@checked
def swisdak_reflected_impulse(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    """Return the impulse on a rigid wall facing the charge [Pa s]."""
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = swisdak_curve("reflected_impulse")
    factor = sachs_impulse_factor(charge_mass, ambient_pressure, sound_speed)
    return factor * jnp.exp(curve.log_value(log_z))


@checked
def swisdak_duration(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    """Return the duration of the positive phase [s]."""
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = swisdak_curve("positive_phase_duration")
    factor = sachs_time_factor(charge_mass, ambient_pressure, sound_speed)
    return factor * jnp.exp(curve.log_value(log_z))


@checked
def swisdak_arrival_time(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    """Return the time from detonation to the arrival of the shock [s]."""
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = swisdak_curve("arrival_time")
    factor = sachs_time_factor(charge_mass, ambient_pressure, sound_speed)
    return factor * jnp.exp(curve.log_value(log_z))


@checked
def swisdak_shock_speed(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    """Return the speed of the shock front [m/s]; at a given Z it goes with $c_0$."""
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = swisdak_curve("shock_front_velocity")
    factor = as_float_array(sound_speed) / STANDARD_SOUND_SPEED
    return factor * jnp.exp(curve.log_value(log_z))


def swisdak_valid(quantity: str) -> Callable[..., Bool[Array, "..."]]:
    """Return the validity function of a quantity.

    Args:
        quantity: Name in the table: "incident_pressure", "arrival_time", ...
    """

    def valid(
        slant_range: Float[ArrayLike, "..."],
        charge_mass: Float[ArrayLike, "..."],
        ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
        burst: str = "surface",
    ) -> Bool[Array, "..."]:
        """Return True within the table up to `END`, for a surface burst."""
        curve = swisdak_curve(quantity)
        z = scaled_distance(slant_range, charge_mass, ambient_pressure)
        end = END.get(quantity, curve.z_max)
        return (z >= curve.z_min) & (z <= end) & (burst == "surface")

    return valid


def swisdak_joins(quantity: str) -> tuple[float, ...]:
    """Return the scaled distances of limits and joins of a curve [m/kg^(1/3)]."""
    curve = swisdak_curve(quantity)
    return (*(segment.z_min for segment in curve.segments), curve.z_max)


@cache
def swisdak_curve(quantity: str) -> LogCurve:
    """Read one curve, as ln of the SI value at standard air and 1 kg against ln Z.

    Args:
        quantity: Name in the table: "incident_pressure", "arrival_time", ...
    """
    rows = data_rows("swisdak_1994")
    return LogCurve(tuple(_segment(row) for row in rows if row["quantity"] == quantity))


def _segment(row: dict[str, str]) -> LogPolynomial:
    """Return the polynomial of a row in SI; the logarithms of the table are natural."""
    coefficients = [float(row[letter]) for letter in "ABCDEFG"]
    # The table pads shorter polynomials with zeros, each a product of no effect.
    while coefficients[-1] == 0.0:
        coefficients.pop()
    return segment_in_si(row, coefficients)


for _quantity, _function, _curve in (
    ("air_arrival_s", swisdak_arrival_time, "arrival_time"),
    ("peak_overpressure_pa", swisdak_pressure, "incident_pressure"),
    ("positive_impulse_pa_s", swisdak_impulse, "incident_impulse"),
    ("positive_duration_s", swisdak_duration, "positive_phase_duration"),
    ("reflected_pressure_pa", swisdak_reflected_pressure, "reflected_pressure"),
    ("reflected_impulse_pa_s", swisdak_reflected_impulse, "reflected_impulse"),
    ("shock_speed_m_s", swisdak_shock_speed, "shock_front_velocity"),
):
    _joins = swisdak_joins(_curve)
    _sd = 0.01 if _quantity in ("air_arrival_s", "shock_speed_m_s") else 0.10
    register(
        Law(
            quantity=_quantity,
            name="swisdak",
            title="Swisdak",
            function=_function,
            range=f"surface, Z = {_joins[0]:g} to {END.get(_curve, _joins[-1]):g} "
            "m/kg^(1/3)",
            source=SOURCE,
            valid=swisdak_valid(_curve),
            scatter=declared_scatter(shot=_sd, record=_sd),
            scatter_source="declared",
            joins=_joins,
        )
    )
