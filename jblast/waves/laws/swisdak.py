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
(`waves/tables.py`); outside the blends the curves are the printed ones to
rounding.
"""

from functools import cache

from jblast.waves.laws.kingery_bulmash import Polynomial, curve_of_rows
from jblast.waves.scaling import scaled_law
from jblast.waves.tables import Curve, data_rows


@cache
def swisdak_curve(quantity: str) -> Curve:
    """Return one curve, as ln of the SI value at standard air and 1 kg against ln Z.

    Args:
        quantity: Name in the table: "incident_pressure", "arrival_time", ...
    """
    rows = [row for row in data_rows("swisdak_1994") if row["quantity"] == quantity]
    return curve_of_rows(rows, _polynomial)


def _polynomial(row: dict[str, str]) -> Polynomial:
    # The logarithms of the table are natural; zeros fill shorter polynomials.
    return [float(row[letter]) for letter in "ABCDEFG"], 0.0, 1.0


def _law(quantity: str, column: str, last: float = 0.0):
    curve = swisdak_curve(column)
    return scaled_law(
        quantity,
        curve,
        {"surface": (curve.z_min, last or curve.z_max)},
        name="swisdak",
        title="Swisdak",
        source="Swisdak 1994 (ADA526744), metric, over three transcriptions",
    )


swisdak_arrival_time = _law("air_arrival_s", "arrival_time")
# The print goes to 198.5, but recorded shots decay more slowly past 20 (see above).
swisdak_pressure = _law("peak_overpressure_pa", "incident_pressure", last=40.0)
swisdak_impulse = _law("positive_impulse_pa_s", "incident_impulse")
swisdak_duration = _law("positive_duration_s", "positive_phase_duration")
swisdak_reflected_pressure = _law("reflected_pressure_pa", "reflected_pressure")
swisdak_reflected_impulse = _law("reflected_impulse_pa_s", "reflected_impulse")
swisdak_shock_speed = _law("shock_speed_m_s", "shock_front_velocity")
