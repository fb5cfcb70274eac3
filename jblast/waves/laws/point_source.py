r"""The blast of a point source in air of gamma 1.4, from the strong shock to sound.

The solution of the equations of motion for energy released at a point, as a function of
$\lambda = R\,(P_0/E)^{1/3}$ with $E = 4.184$ MJ/kg times the mass. With $x = p/P_0$ the
front is one curve $x(\lambda)$. From 0.1 to 100 (Z = 346) it is the cubic spline of
$\ln x$ in $\ln\lambda$ through the nodes of `data/point_source_euler.csv`, computed by
`calibration.euler`. Nearer the source it is Sedov's and Taylor's strong limit with the
constant that meets the first value,

$$x = \frac{8}{60\,\alpha}\lambda^{-3} + 1.063, \qquad \alpha(1.4) = 0.851071854758$$

and farther the weak-shock law that leaves the last node in value and slope
(`waves/shock.py`). The curvature jumps where the three meet, and nowhere else. The
arrival is the integral of one over the speed,

$$\frac{c_0 t}{R_0} = \int_0^\lambda \frac{d\lambda}{M}, \qquad
  M^2 = 1 + \tfrac67 x, \qquad R_0 = (E/P_0)^{1/3}$$

as a series below the first node, a table from there to $\lambda$ = 1e4, and past it the
head start over sound of a weak shock (`waves/tables.py`).

On the grid the pressure is within 1e-6 of the method of characteristics in all 41 rows
of its table there (S. Hancock, blast-ips, table S1x4, itself good to 7e-7) and within
2e-6 of the solver between the nodes; the arrival is within 4e-6 of the table and 5e-6
of the solver's. Beyond the grid, to Z = 1e4, the weak-shock continuation joins the
solver, with its error stated: against the same table 0.02 % low at $\lambda$ = 228,
0.09 % at 664, 0.21 % at 2359 (Z = 8150), 0.37 % at 1.07e4, 0.7 % at 5.7e5
(`calibration/results/point_source.txt`).

A charge of TNT is no point source, and its products continue to burn: by the pressure
in free air of Kingery and Bulmash it acts as a point source of 1.5 MJ/kg at Z = 0.3,
3.0 at 0.5, 5.35 at 1, 6.4 at 2, 5.2 at 10 to 20, 4.1 at 40. So with 4.184 MJ/kg this
law gives 2.7 times their pressure at Z = 0.3, 1.4 at 0.5, 0.80 at 1, 0.73 at 2, 0.91 at
10 and 20, and the arrival is 0.36, 0.57, 0.88, 1.06, 1.02 and 1.02 of theirs.

Range: $\lambda \ge 0.1$ (Z = 0.346, 158 ambient pressures: real air has lost its gamma
of 1.4 well before) to Z = 1e4 of arrival and speed, where absorption counts; the
pressure to Z = 300, past which recorded peaks are half of a weak shock's
(`waves/shock.py`). Outside it remains finite, by the strong limit and the weak-shock
law.
"""

import math

import numpy as np

from jblast.constants import (
    STANDARD_PRESSURE,
    TNT_SPECIFIC_ENERGY,
)
from jblast.types import namespace
from jblast.waves.scaling import scaled_law
from jblast.waves.shock import (
    FAR_END,
    LOG_STANDARD_PRESSURE,
    WeakShockTail,
    log_shock_speed,
    measured_far_scatter,
    tail_from,
)
from jblast.waves.tables import (
    Curve,
    Form,
    Numbers,
    arrival,
    cubics,
    data_rows,
    spline_slopes,
)

LENGTH = (TNT_SPECIFIC_ENERGY / STANDARD_PRESSURE) ** (1.0 / 3.0)
"""Scaled distance of lambda = 1 [m/kg^(1/3)]: 3.456."""
ENDS = (0.1, 100.0)
r"""$\lambda$ of the first and the last node, where the curvature jumps."""
# The correction of Sedov's and Taylor's arrival is 1e-14 there.
START = 1e-5
r"""$\lambda$ at which the integral of the arrival starts."""
SPAN = (START * LENGTH, 1e6)
"""Scaled distances of the curves [m/kg^(1/3)]."""
SEDOV_ALPHA = 0.851071854758
"""$E t^2/(\rho_0 R^5)$ for gamma 1.4; `laws/sedov_taylor.py` computes it."""
STRONG = 8.0 / (60.0 * SEDOV_ALPHA)
"""$x \\lambda^3$ of the strong limit: $p = 8E/(25 \\cdot 2.4\\,\alpha R^3)$."""


def _front() -> tuple[Form, WeakShockTail]:
    r"""Return $\ln x$ of $\ln\lambda$, and the tail beyond the last node."""
    rows = data_rows("point_source_euler")
    table = np.array([[float(value) for value in row.values()] for row in rows])
    _, pressure, slopes, _ = table.T
    # With eight digits the nodes are even to 1e-7 only, fewer digits than the values.
    first, last = math.log(ENDS[0]), math.log(ENDS[1])
    nodes = np.linspace(first, last, len(rows))
    # The slope of the strong limit and its constant; the solver's is 2e-4 steeper.
    ends = -3.0 * STRONG / (ENDS[0] ** 3 * pressure[0]), slopes[-1]
    log_pressure = np.log(pressure)
    steep = spline_slopes(nodes, log_pressure, ends)
    between = cubics(nodes, log_pressure, steep)
    offset = pressure[0] - STRONG / ENDS[0] ** 3
    tail = tail_from(ENDS[1], pressure[-1], slopes[-1])

    def form(log_lambda: Numbers) -> Numbers:
        xp = namespace(log_lambda)
        close = xp.minimum(log_lambda, first)
        strong = xp.log(STRONG * xp.exp(-3.0 * close) + offset)
        # each branch has an argument in its own range, so that none is NaN
        near = between(xp.minimum(xp.maximum(log_lambda, first), last))
        far = tail.log_pressure(xp.maximum(log_lambda, last))
        value = xp.where(log_lambda < first, strong, near)
        return xp.where(log_lambda > last, far, value)

    return form, tail


def _of_z(form: Form, summand: float = 0.0) -> Curve:
    """Return a form of ln lambda as a curve of the scaled distance."""
    return Curve(lambda x: form(x - math.log(LENGTH)) + summand, *SPAN)


def _law(quantity: str, curve: Curve, last: float, factor: str = ""):
    return scaled_law(
        quantity,
        curve,
        {"free-air": (ENDS[0] * LENGTH, last)},
        name="point_source",
        factor=factor,
        title="point-source",
        source="calibration/point_source.py to Z = 346, weak-shock tail; "
        "1/U integrated",
        note="; source small and light",
        far_scatter=measured_far_scatter(quantity) if last == FAR_END else None,
    )


log_overpressure_ratio, TAIL = _front()
r"""$\ln(p/P_0)$ of $\ln\lambda$, and its tail."""
_pressure = _of_z(log_overpressure_ratio, LOG_STANDARD_PRESSURE)
# Sedov's and Taylor's R = (E t^2/(alpha rho_0))^(1/5), as M^2 = 6/7 STRONG lambda^-3.
_start_time = 0.4 * START**2.5 / math.sqrt(6.0 / 7.0 * STRONG)
log_sound_fraction = arrival(
    log_overpressure_ratio, START, _start_time, SPAN[1] / LENGTH
)
r"""$\ln(c_0 t/R)$ of $\ln\lambda$."""
point_source_arrival_time = _law(
    "air_arrival_s", _of_z(log_sound_fraction), 1e4, "travel"
)
point_source_pressure = _law("peak_overpressure_pa", _pressure, FAR_END)
point_source_shock_speed = _law("shock_speed_m_s", _pressure.then(log_shock_speed), 1e4)
