r"""Negative phase of a TNT sphere in free air, from a table read off UFC 3-340-02.

Its figure of the negative phase in free air, second-hand and digitised: provenance and
doubts stand in `data/negative_phase_ufc.csv`. The points carry an error of a few per
cent, and units that were inferred; 15 % a shot and 10 % a record are declared.

Through the points runs a natural cubic spline in ln-ln (`curves.py`), brought to
other charges and air by Sachs' factors. Value, slope and curvature are continuous
everywhere: no joins.

Near the charge the points exceed 101.325 kPa by up to 4 %: reading errors, for no
suction exceeds the ambient pressure. Before the spline is drawn, the points within 5 %
of it are brought below it: with $d = \ln(p/P_0)$, $\delta = \ln 1.05$ and
$t = (d + \delta)/2\delta$,

$$\ln\frac{p'}{P_0} = d - 2\delta\,t^4\,(t^2 - 3t + \tfrac52), \qquad 0 \le t \le 1$$

which changes nothing at $d = -\delta$ and ends level at $P_0$. A reading of $P_0$
becomes 0.992 of it. So no law here gives more than the ambient pressure.

Range: free air, Z = 0.05 to 36.975 m/kg^(1/3). Outside it is a power law with the end
slope, finite and not valid.
"""

import math
from functools import cache

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.waves.arguments import checked
from jblast.waves.curves import HermiteCurve, data_rows, natural_log_spline
from jblast.waves.scaling import (
    log_scaled_distance,
    sachs_impulse_factor,
    sachs_pressure_factor,
    sachs_time_factor,
    scaled_distance,
)

FIRST, LAST = 0.05, 36.975
"""First and last scaled distance of the table [m/kg^(1/3)]."""
# No suction exceeds the ambient pressure; 5 % keeps the change to few readings.
AMBIENT_HALF_WIDTH = math.log(1.05)
"""Half width in ln of the smooth limit at the ambient pressure."""
SI_UNITS = {"kPa": 1e3, "kPa_ms_kg13": 1.0, "ms_kg13": 1e-3}


@cache
def ufc_curve(column: str) -> HermiteCurve:
    """Read one curve, as ln of the SI value at standard air and 1 kg against ln Z.

    Args:
        column: Name in the table, with its unit: "Pso_neg_kPa", ...
    """
    rows = data_rows("negative_phase_ufc")
    unit = SI_UNITS[column.partition("_neg_")[2]]
    value = unit * np.array([float(row[column]) for row in rows])
    # Only a pressure has this bound; impulses and durations have none.
    if column.endswith("kPa"):
        value = _held_below_ambient(value)
    return natural_log_spline(np.array([float(row["Z_m_kg13"]) for row in rows]), value)


def _held_below_ambient(pressure: np.ndarray) -> np.ndarray:
    """Return readings with a smooth limit below the ambient pressure."""
    d = np.log(pressure / STANDARD_PRESSURE)
    t = np.clip((d + AMBIENT_HALF_WIDTH) / (2.0 * AMBIENT_HALF_WIDTH), 0.0, 1.0)
    # The derivative by d is one minus the quintic smoothstep 6 t^5 - 15 t^4 + 10 t^3:
    # value, slope and curvature have no jump at either end.
    d = np.minimum(d, AMBIENT_HALF_WIDTH) - 2.0 * AMBIENT_HALF_WIDTH * t**4 * (
        t**2 - 3.0 * t + 2.5
    )
    return STANDARD_PRESSURE * np.exp(d)


@checked
def ufc_negative_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    """Return the greatest incident underpressure, positive [Pa]: at most ambient.

    The arguments here and below:

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = ufc_curve("Pso_neg_kPa")
    return sachs_pressure_factor(ambient_pressure) * jnp.exp(curve.value(log_z))


@checked
def ufc_reflected_negative_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    """Return the greatest underpressure on a rigid wall facing the charge [Pa]."""
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = ufc_curve("Pr_neg_kPa")
    return sachs_pressure_factor(ambient_pressure) * jnp.exp(curve.value(log_z))


@checked
def ufc_negative_impulse(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    """Return the incident impulse of the negative phase, positive [Pa s].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = ufc_curve("is_neg_kPa_ms_kg13")
    factor = sachs_impulse_factor(charge_mass, ambient_pressure, sound_speed)
    return factor * jnp.exp(curve.value(log_z))


@checked
def ufc_reflected_negative_impulse(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    """Return the negative impulse on a rigid wall facing the charge [Pa s]."""
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = ufc_curve("ir_neg_kPa_ms_kg13")
    factor = sachs_impulse_factor(charge_mass, ambient_pressure, sound_speed)
    return factor * jnp.exp(curve.value(log_z))


@checked
def ufc_negative_duration(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    """Return the duration of the negative phase [s], one for incident and reflected."""
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    curve = ufc_curve("t_neg_ms_kg13")
    factor = sachs_time_factor(charge_mass, ambient_pressure, sound_speed)
    return factor * jnp.exp(curve.value(log_z))


def ufc_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "free-air",
) -> Bool[Array, "..."]:
    """Return True within the range of the table, in free air."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= FIRST) & (z <= LAST) & (burst == "free-air")


for _quantity, _function in {
    "negative_pressure_pa": ufc_negative_pressure,
    "negative_impulse_pa_s": ufc_negative_impulse,
    "negative_duration_s": ufc_negative_duration,
    "reflected_negative_pressure_pa": ufc_reflected_negative_pressure,
    "reflected_negative_impulse_pa_s": ufc_reflected_negative_impulse,
}.items():
    register(
        Law(
            quantity=_quantity,
            name="ufc_3_340_02",
            function=_function,
            range="free air, Z = 0.05 to 36.975 m/kg^(1/3)",
            source="UFC 3-340-02, figure digitised, over OpenRadioss",
            valid=ufc_valid,
            scatter=declared_scatter(shot=0.15, record=0.10),
            scatter_source="declared",
        )
    )
