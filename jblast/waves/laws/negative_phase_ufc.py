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
from functools import partial

import numpy as np

from jblast.constants import STANDARD_PRESSURE
from jblast.waves.scaling import scaled_law
from jblast.waves.tables import Curve, cubics, data_rows, spline_slopes

# No suction exceeds the ambient pressure; 5 % keeps the change to few readings.
AMBIENT_HALF_WIDTH = math.log(1.05)
"""Half width in ln of the smooth limit at the ambient pressure."""


def ufc_curve(column: str, unit: float) -> Curve:
    """Return one curve, as ln of the SI value at standard air and 1 kg against ln Z.

    Args:
        column: Name in the table, with its unit: "Pso_neg_kPa", ...
        unit: SI value of that unit.
    """
    rows = data_rows("negative_phase_ufc")
    z = [float(row["Z_m_kg13"]) for row in rows]
    log_value = np.log([unit * float(row[column]) for row in rows])
    # Only a pressure has this bound; impulses and durations have none.
    if column.endswith("kPa"):
        log_value = _below_ambient(log_value)
    slopes = spline_slopes(np.log(z), log_value)
    return Curve(cubics(np.log(z), log_value, slopes), z[0], z[-1])


def _below_ambient(log_pressure: np.ndarray) -> np.ndarray:
    """Return ln of readings with a smooth limit below the ambient pressure."""
    ambient = math.log(STANDARD_PRESSURE)
    d = log_pressure - ambient
    t = np.clip((d + AMBIENT_HALF_WIDTH) / (2.0 * AMBIENT_HALF_WIDTH), 0.0, 1.0)
    # The derivative by d is one minus the quintic smoothstep 6 t^5 - 15 t^4 + 10 t^3:
    # value, slope and curvature have no jump at either end.
    excess = t**4 * (t**2 - 3.0 * t + 2.5)
    return ambient + np.minimum(d, AMBIENT_HALF_WIDTH) - 2 * AMBIENT_HALF_WIDTH * excess


FIRST, LAST = 0.05, 36.975
"""First and last scaled distance of the table [m/kg^(1/3)]."""
_law = partial(
    scaled_law,
    spans={"free-air": (FIRST, LAST)},
    name="ufc_3_340_02",
    source="UFC 3-340-02, figure digitised, over OpenRadioss",
    sd=(0.15, 0.10),
)
ufc_negative_pressure = _law("negative_pressure_pa", ufc_curve("Pso_neg_kPa", 1e3))
# 1 kPa ms is 1 Pa s
ufc_negative_impulse = _law(
    "negative_impulse_pa_s", ufc_curve("is_neg_kPa_ms_kg13", 1.0)
)
ufc_negative_duration = _law("negative_duration_s", ufc_curve("t_neg_ms_kg13", 1e-3))
"""One duration for incident and reflected [s]."""
ufc_reflected_negative_pressure = _law(
    "reflected_negative_pressure_pa", ufc_curve("Pr_neg_kPa", 1e3)
)
ufc_reflected_negative_impulse = _law(
    "reflected_negative_impulse_pa_s", ufc_curve("ir_neg_kPa_ms_kg13", 1.0)
)
