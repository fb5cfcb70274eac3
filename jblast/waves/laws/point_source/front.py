r"""The shock front of a point source in scaled terms: energy, air and sound are one.

With $\lambda = R\,(P_0/E)^{1/3}$ and $x = p/P_0$ the front is one curve $x(\lambda)$.
From 0.1 to 100 it is the cubic spline of $\ln x$ in $\ln\lambda$ through the nodes of
`data/point_source_euler.csv`, which `jblast.waves.euler` computed. Nearer the source it
is Sedov's and Taylor's strong limit with the constant that meets the first value,

$$x = \frac{8}{60\,\alpha}\lambda^{-3} + 1.063, \qquad \alpha(1.4) = 0.851071854758$$

and farther the weak-shock law that leaves the last node in value and slope
(`shock/weak_shock_tail.py`). Curvature jumps where the three meet, and nowhere else.
"""

import math
from functools import cache

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.waves.curves.hermite import HermiteCurve
from jblast.waves.curves.log_spline import clamped_log_spline
from jblast.waves.curves.printed_table import data_rows
from jblast.waves.shock.weak_shock_tail import WeakShockTail, tail_from

SEDOV_ALPHA = 0.851071854758
"""$E t^2/(\rho_0 R^5)$ for gamma 1.4; `laws/sedov_taylor/alpha.py` computes it."""

STRONG = 8.0 / (60.0 * SEDOV_ALPHA)
"""$x \\lambda^3$ of the strong limit: $p = 8E/(25 \\cdot 2.4\\,\\alpha R^3)$."""


ENDS = (0.1, 100.0)
r"""$\lambda$ of the first and the last node, where the curvature jumps."""


@cache
def point_source_curve() -> HermiteCurve:
    r"""Return $\ln x$ against $\ln\lambda$ from 0.1 to 100, its nodes evenly spaced."""
    rows = data_rows("point_source_euler")
    table = np.array([[float(value) for value in row.values()] for row in rows])
    distance, pressure, slopes, _ = table.T
    # Printed to eight digits, the nodes are even to 1e-7: less than the values' digits.
    distance = np.geomspace(*ENDS, distance.size)
    # The slope of the strong limit and its constant; the solver's is 2e-4 steeper.
    start = -3.0 * STRONG / (distance[0] ** 3 * pressure[0])
    return clamped_log_spline(distance, pressure, start, slopes[-1])


@cache
def point_source_tail() -> WeakShockTail:
    r"""Return the law past the last node: $x$ against $\lambda$."""
    curve = point_source_curve()
    return tail_from(ENDS[1], math.exp(curve.coefficients[-1].sum()), curve.slope_after)


@cache
def strong_offset() -> float:
    """Return the constant on top of the strong limit: what the first node has more."""
    return math.exp(point_source_curve().coefficients[0, 0]) - STRONG / ENDS[0] ** 3


def log_overpressure_ratio(log_lambda: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return ln(p/P0)."""
    curve, offset = point_source_curve(), strong_offset()
    first, last = math.log(ENDS[0]), math.log(ENDS[1])
    close = jnp.minimum(log_lambda, first)
    strong = math.log(STRONG) - 3.0 * close
    strong = strong + jnp.log1p(offset / STRONG * jnp.exp(3.0 * close))
    near, far = log_lambda < first, log_lambda > last
    between = curve.value(jnp.where(near | far, last, log_lambda))
    weak = point_source_tail().log_pressure(jnp.where(far, log_lambda, last))
    return jnp.where(near, strong, jnp.where(far, weak, between))


def point_source_mach_number(log_lambda: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return U/c."""
    return jnp.sqrt(1.0 + 6.0 / 7.0 * jnp.exp(log_overpressure_ratio(log_lambda)))
