r"""Kingery and Bulmash (1984): air blast of TNT in free air and on the ground.

The curves of ARBRL-TR-02555 for a TNT sphere in free air and a TNT hemisphere on the
ground, read second-hand: the provenance, the misprints and one unresolved digit stand
in the head of `data/kingery_bulmash.csv`. Each curve is

$$Y = 10^{C_0 + C_1 U + C_2 U^2 + \dots}, \qquad U = K_0 + K_1 \log_{10} Z$$

of the scaled distance $Z$ of `scaling.py`, brought to other air by Sachs' factors.

Range: Z = 0.0674 to 40 m/kg^(1/3) (surface), 0.0531 to 40 (free-air); durations from
0.178 and 0.147. Outside it a curve is a power law with the end slope, finite and not
valid.

Pressures, reflected impulse, arrival and shock speed are one polynomial each. Impulse
has one join and duration two, where the printed curves jump; they are blended over
5 % in Z (2.5 % to each side). Inside a blend the curve differs from the printed one
by at most 0.35 % (impulse, surface, Z = 0.955), 0.31 % (free-air, 0.792), 0.92 and
0.44 % (duration, surface, 1.01 and 2.78), 0.48 and 0.04 % (free-air, 0.888 and 2.28),
half of the printed jump or a little more; outside it agrees to rounding. The slope
d ln Y/d ln Z passes through -0.33 to 1.34 (surface impulse), -0.43 to 1.15 (free-air),
1.98 to 3.45 and 0.93 to 1.45 (surface duration), 0.67 to 1.44 and 1.08 to 1.27.

The tables contain neither the wind nor the dynamic pressure behind the front. Both
follow from the incident pressure by the jump relations of `waves/shock.py`, for air as
an ideal gas, so above some ten bar (Z below 1) they are less accurate than the
pressure.

`ground_factor` is the mass in free air with the peak pressure of 1 kg on the ground. A
rigid ground would double the charge, because it reflects upwards the lower half of the
blast. Craters and warmed ground take a share, so handbooks use 1.8. By the two curve
sets it depends on the distance: the factor $f$ in

$$p_{free\,air}(R, f W) = p_{surface}(R, W)$$

is 1.38 (Z = 0.2), 1.46 (0.5), 1.66 (1), 1.65 (2), 1.73 (5), 1.88 (10), 2.01 (20).
Outside this range it is constant. Farther both curves end in wiggles (2.07 at 30, 2.04
at 40). Nearer they flatten towards the surface of their charges, which has another
shape on the ground: by the curves the factor would be 2.2 at 0.1, and at 0.0674, where
that for the surface starts, no distance in free air has its pressure.
"""

import math
from functools import cache

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.types import as_float_array
from jblast.waves.arguments import checked
from jblast.waves.curves import (
    HermiteCurve,
    LogCurve,
    LogPolynomial,
    data_rows,
    hermite_curve,
)
from jblast.waves.scaling import (
    log_scaled_distance,
    sachs_impulse_factor,
    sachs_pressure_factor,
    sachs_time_factor,
    scaled_distance,
)
from jblast.waves.shock import blast_wind, dynamic_pressure

SOURCE = "Kingery & Bulmash 1984 (ARBRL-TR-02555), over eight transcriptions"
RANGE = "Z = 0.0674 (free-air 0.0531) to 40 m/kg^(1/3)"
DURATION_RANGE = "Z = 0.178 (free-air 0.147) to 40 m/kg^(1/3)"
TABLE_NAMES = {"surface": "hemispherical", "free-air": "spherical"}
# 1 kPa ms is 1 Pa s, so impulses need no factor.
SI_UNITS = {
    "kPa": 1e3,
    "kPa-ms/kg^(1/3)": 1.0,
    "ms/kg^(1/3)": 1e-3,
    "m/ms": 1e3,
}
GROUND_FACTOR_RANGE = (0.2, 20.0)
"""Scaled distances of the table [m/kg^(1/3)]."""
# The remaining error is below 1e-7 of the factor.
GROUND_FACTOR_SPACING = 0.02
"""Spacing of the table in ln Z."""


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

    Its derivative is no shock speed near Z = 40: it oscillates by up to 7 %.
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
    """Return the speed of the shock front [m/s], proportional to $c_0$ at a given Z.

    Beyond Z = 40 the power law departs slowly from the speed of sound (352 m/s at
    Z = 1e6 on the surface, 311 in free air): not valid there.
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
    """Return True within the tables of all quantities except duration."""
    return _tabulated(
        "incident_pressure", burst, slant_range, charge_mass, ambient_pressure
    )


def kingery_bulmash_duration_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Bool[Array, "..."]:
    """Return True within the table of duration, which starts later than the others."""
    return _tabulated(
        "positive_phase_duration", burst, slant_range, charge_mass, ambient_pressure
    )


def _tabulated(
    quantity: str, burst: str, slant_range, charge_mass, ambient_pressure
) -> Bool[Array, "..."]:
    """Return True within the table of a curve."""
    curve = kingery_bulmash_curve(quantity, burst)
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= curve.z_min) & (z <= curve.z_max)


@cache
def kingery_bulmash_joins() -> tuple[float, ...]:
    """Return the scaled distances of limits and joins of all curves [m/kg^(1/3)]."""
    rows = data_rows("kingery_bulmash")
    return tuple(
        sorted({float(row[end]) for row in rows for end in ("z_min", "z_max")})
    )


@checked
def kingery_bulmash_blast_wind(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the peak speed of the air behind the front [m/s].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    peak = kingery_bulmash_pressure(slant_range, charge_mass, ambient_pressure, burst)
    return blast_wind(peak, ambient_pressure, sound_speed)


@checked
def kingery_bulmash_dynamic_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the peak dynamic pressure of the wind [Pa].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    peak = kingery_bulmash_pressure(slant_range, charge_mass, ambient_pressure, burst)
    return dynamic_pressure(peak, ambient_pressure)


@cache
def kingery_bulmash_curve(quantity: str, burst: str) -> LogCurve:
    """Read one curve, as ln of the SI value at standard air and 1 kg against ln Z.

    Args:
        quantity: Name in the table: "incident_pressure", "arrival_time", ...
        burst: "surface" or "free-air".

    Raises:
        ValueError: The burst is unknown.
    """
    if burst not in TABLE_NAMES:
        raise ValueError(f"burst must be 'surface' or 'free-air', got {burst!r}")
    # Python numbers, not arrays: an array made while a program is traced, and cached,
    # would leak its tracer.
    return LogCurve(
        tuple(
            _segment(row)
            for row in data_rows("kingery_bulmash")
            if row["burst"] == TABLE_NAMES[burst]
            and row["quantity"] == quantity
            and row["variant"] == "brl1984"
        )
    )


def _segment(row: dict[str, str]) -> LogPolynomial:
    """Return the polynomial of a row, with natural logarithms and in SI."""
    coefficients = [
        float(row[f"C{i}"]) * math.log(10) for i in range(int(row["degree"]) + 1)
    ]
    scale = float(row["K1"]) / math.log(10)
    return segment_in_si(row, coefficients, float(row["K0"]), scale)


def segment_in_si(
    row: dict[str, str],
    coefficients: list[float],
    offset: float = 0.0,
    scale: float = 1.0,
) -> LogPolynomial:
    """Return a row's polynomial, its values in SI.

    Args:
        row: It names the unit of the values, and where the segment starts and ends.
        coefficients: Of the natural logarithm of the values in that unit.
        offset: $k_0$ of `LogPolynomial`.
        scale: $k_1$.
    """
    first, *others = coefficients
    # In ln a unit is a summand, so only the constant term changes.
    return LogPolynomial(
        z_min=float(row["z_min"]),
        z_max=float(row["z_max"]),
        offset=offset,
        scale=scale,
        coefficients=(first + math.log(SI_UNITS[row["y_unit"]]), *others),
    )


@checked
def ground_factor(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    r"""Return the factor of the mass that has the same peak in free air [-].

    Range: Z = 0.2 to 20 m/kg^(1/3) of the surface burst; constant outside.

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass on the ground $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    return jnp.exp(_log_ground_factor().value(log_z))


@cache
def _log_ground_factor() -> HermiteCurve:
    """Tabulate ln f: in NumPy, always in float64, also under jit.

    If free air has at $Z_s$ the pressure of the surface at $Z$, then $f = (Z/Z_s)^3$.
    The slope of f follows from those of both curves.
    """
    surface = kingery_bulmash_curve("incident_pressure", "surface").segments[0]
    free_air = kingery_bulmash_curve("incident_pressure", "free-air").segments[0]
    start, end = (math.log(z) for z in GROUND_FACTOR_RANGE)
    nodes = np.linspace(
        start, end, math.ceil((end - start) / GROUND_FACTOR_SPACING) + 1
    )
    pressure = surface.log_value(nodes)
    # f is 1.4 to 2.0; eight Newton steps from 1.6, of which five reach rounding
    log_z = nodes - math.log(1.6) / 3.0
    for _ in range(8):
        log_z = log_z - (free_air.log_value(log_z) - pressure) / free_air.log_slope(
            log_z
        )
    # f is the cube of the ratio of both Z at one pressure; its slope is that of the
    # implicit function.
    return hermite_curve(
        nodes,
        3.0 * (nodes - log_z),
        3.0 * (1.0 - surface.log_slope(nodes) / free_air.log_slope(log_z)),
        slope_before=0.0,
        slope_after=0.0,
    )


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
            title="Kingery-Bulmash",
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

for _wind_quantity, _wind_function in {
    "blast_wind_m_s": kingery_bulmash_blast_wind,
    "dynamic_pressure_pa": kingery_bulmash_dynamic_pressure,
}.items():
    register(
        Law(
            quantity=_wind_quantity,
            name="kingery_bulmash",
            title="Kingery-Bulmash",
            function=_wind_function,
            range=f"{RANGE}; ideal gas",
            source=f"{SOURCE}; Rankine-Hugoniot",
            valid=kingery_bulmash_valid,
            scatter=declared_scatter(shot=0.10, record=0.10),
            scatter_source="declared",
            joins=kingery_bulmash_joins(),
        )
    )
