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
from collections.abc import Callable
from functools import cache, partial

from jblast.constants import STANDARD_PRESSURE
from jblast.types import namespace
from jblast.waves.arguments import Number, checked
from jblast.waves.scaling import log_scaled_distance, scaled_law
from jblast.waves.shock import log_dynamic_pressure, log_wind
from jblast.waves.tables import (
    Curve,
    Numbers,
    data_rows,
    polynomial,
    segmented,
    slope_of,
)

SOURCE = "Kingery & Bulmash 1984 (ARBRL-TR-02555), over eight transcriptions"
TABLE_NAMES = {"surface": "hemispherical", "free-air": "spherical"}
# In ln a unit is a summand; 1 kPa ms is 1 Pa s.
SI_UNITS = {"kPa": 1e3, "kPa-ms/kg^(1/3)": 1.0, "ms/kg^(1/3)": 1e-3, "m/ms": 1e3}
Polynomial = tuple[list[float], float, float]
"""Coefficients of a natural logarithm, offset and scale, as in `tables.polynomial`."""
GROUND_FACTOR_RANGE = (0.2, 20.0)
"""Scaled distances between which the ground factor is not constant [m/kg^(1/3)]."""


@cache
def kingery_bulmash_curves(quantity: str) -> dict[str, Curve]:
    """Return the curve of each burst, as ln of the SI value of 1 kg against ln Z.

    Args:
        quantity: Name in the table: "incident_pressure", "arrival_time", ...
    """
    rows = [
        row
        for row in data_rows("kingery_bulmash")
        if row["quantity"] == quantity and row["variant"] == "brl1984"
    ]
    return {
        burst: curve_of_rows([r for r in rows if r["burst"] == of_table], _polynomial)
        for burst, of_table in TABLE_NAMES.items()
    }


def _polynomial(row: dict[str, str]) -> Polynomial:
    degree = int(row["degree"])
    coefficients = [float(row[f"C{i}"]) * math.log(10) for i in range(degree + 1)]
    return coefficients, float(row["K0"]), float(row["K1"]) / math.log(10)


def curve_of_rows(
    rows: list[dict[str, str]], read: Callable[[dict[str, str]], Polynomial]
) -> Curve:
    """Return the curve in SI of some rows of a table, one segment each.

    Args:
        rows: Each has the unit of its values and the limits of its Z.
        read: Function that returns the polynomial of a row.
    """
    forms = []
    for row in rows:
        (first, *others), offset, scale = read(row)
        first += math.log(SI_UNITS[row["y_unit"]])
        forms.append(polynomial([first, *others], offset, scale))
    ends = [float(row["z_min"]) for row in rows] + [float(rows[-1]["z_max"])]
    return segmented(forms, ends)


_law = partial(
    scaled_law, name="kingery_bulmash", title="Kingery-Bulmash", source=SOURCE
)
_jump = partial(_law, source=f"{SOURCE}; Rankine-Hugoniot", note="; ideal gas")
_pressure = kingery_bulmash_curves("incident_pressure")
kingery_bulmash_arrival_time = _law(
    "air_arrival_s", kingery_bulmash_curves("arrival_time")
)
"""Time from detonation to the arrival of the shock [s].

Its derivative is no shock speed near Z = 40: it oscillates by up to 7 %.
"""
kingery_bulmash_pressure = _law("peak_overpressure_pa", _pressure)
kingery_bulmash_impulse = _law(
    "positive_impulse_pa_s", kingery_bulmash_curves("incident_impulse")
)
kingery_bulmash_duration = _law(
    "positive_duration_s", kingery_bulmash_curves("positive_phase_duration")
)
kingery_bulmash_reflected_pressure = _law(
    "reflected_pressure_pa", kingery_bulmash_curves("reflected_pressure")
)
kingery_bulmash_reflected_impulse = _law(
    "reflected_impulse_pa_s", kingery_bulmash_curves("reflected_impulse")
)
kingery_bulmash_shock_speed = _law(
    "shock_speed_m_s", kingery_bulmash_curves("shock_front_velocity")
)
"""Speed of the shock front [m/s]. Beyond Z = 40 the power law departs slowly from the
speed of sound (352 m/s at Z = 1e6 on the surface, 311 in free air): not valid there."""
kingery_bulmash_blast_wind = _jump(
    "blast_wind_m_s",
    {burst: curve.then(log_wind) for burst, curve in _pressure.items()},
)
kingery_bulmash_dynamic_pressure = _jump(
    "dynamic_pressure_pa",
    {burst: curve.then(log_dynamic_pressure) for burst, curve in _pressure.items()},
)


@checked
def ground_factor(
    slant_range: Number,
    charge_mass: Number,
    ambient_pressure: Number = STANDARD_PRESSURE,
) -> Numbers:
    r"""Return the factor of the mass that has the same peak in free air [-].

    Range: Z = 0.2 to 20 m/kg^(1/3) of the surface burst; constant outside.

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass on the ground $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    xp = namespace(log_z)
    inside = xp.clip(log_z, *(math.log(z) for z in GROUND_FACTOR_RANGE))
    return xp.exp(_LOG_GROUND_FACTOR(inside))


def _log_ground_factor(log_z: Numbers) -> Numbers:
    """Return ln f: free air has at $Z_s$ the pressure at $Z$, and $f = (Z/Z_s)^3$."""
    surface, free_air = (_pressure[burst].form for burst in ("surface", "free-air"))
    # f is 1.4 to 2.0; eight Newton steps from 1.6, of which five reach rounding
    at, pressure = log_z - math.log(1.6) / 3.0, surface(log_z)
    for _ in range(8):
        at = at - (free_air(at) - pressure) / slope_of(free_air, at)
    return 3.0 * (log_z - at)


_LOG_GROUND_FACTOR = Curve(_log_ground_factor, *GROUND_FACTOR_RANGE)
