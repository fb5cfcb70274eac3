r"""The arrival of a point source's shock as the integral of one over its speed.

$$\frac{c_0 t}{R_0} = \int_0^\lambda \frac{d\lambda}{M}, \qquad
  M^2 = 1 + \tfrac67 x, \qquad R_0 = (E/P_0)^{1/3}$$

with $x(\lambda)$ of `front.py`: a series below the first node, a table
from there to $\lambda$ = 1e4, and past it the head start over sound of a weak shock.
`waves/curves/arrival.py` puts them together.
"""

import math
from functools import cache

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.waves.curves.arrival import Arrival, Tail, head_start
from jblast.waves.curves.hermite import hermite_curve
from jblast.waves.laws.point_source.front import (
    STRONG,
    point_source_curve,
    point_source_mach_number,
    point_source_tail,
    strong_offset,
)

PARTS = 3
"""Stretches of the table for each of the pressure: it leaves 1e-9 of the arrival."""

END = 1e4
r"""$\lambda$ where the table ends: $x$ is 1e-5 there, and its square forgotten."""


@cache
def point_source_arrival() -> Arrival:
    r"""Integrate 1/M: in NumPy, always in float64, also under jit.

    The near curve goes through nodes that are evenly spaced and fall on those of the
    pressure, a spline that no one series follows.
    """
    curve = point_source_curve()
    first, step = float(curve.nodes[0]), np.diff(curve.nodes)[0] / PARTS
    count = math.ceil((math.log(END) - first) / step)
    nodes = first + step * np.arange(count + 1)
    points, weights = np.polynomial.legendre.leggauss(8)
    inner = nodes[:-1, None] + step * (points + 1.0) / 2.0
    parts = (np.exp(inner) / _mach_number(inner)) @ weights * step / 2.0
    start = math.exp(first + float(_log_fraction_near(first)))
    arrival = start + np.concatenate([[0.0], np.cumsum(parts)])
    slopes = np.exp(nodes) / (_mach_number(nodes) * arrival) - 1.0
    tail = point_source_tail()
    # Of degree 0, so a straight line: the shock is weak enough.
    weak = Tail(tail.log_pressure, degree=0, log_length=math.log(tail.length))
    last, lead = float(nodes[-1]), float(np.exp(nodes[-1]) - arrival[-1])
    return Arrival(
        first=first,
        join=last,
        inner=_log_fraction_near,
        near=hermite_curve(nodes, np.log(arrival) - nodes, slopes).value,
        head_start=head_start(weak, last, lead),
        mach_number=point_source_mach_number,
    )


def _log_fraction_near(log_lambda):
    r"""Return ln(c t/R) of $M^2 = a\lambda^{-3} + b$, below the first node.

    $$c_0 t/R_0 = \tfrac25 a^{-1/2} \lambda^{5/2} \left[1 - \tfrac12 \tfrac5{11} w +
    \tfrac38 \tfrac5{17} w^2 - \dots\right], \qquad w = b\lambda^3/a < 0.015$$

    Its first factor is Sedov's and Taylor's $R = (E t^2/\alpha\rho_0)^{1/5}$.
    """
    a, b = 6.0 / 7.0 * STRONG, 1.0 + 6.0 / 7.0 * strong_offset()
    xp = np if isinstance(log_lambda, float) else jnp
    w = b / a * xp.exp(3.0 * log_lambda)
    total, binomial = 0.0, 1.0  # binomial coefficients of (1 + w)^(-1/2)
    terms = []
    for n in range(7):
        terms.append(binomial * 5.0 / (5.0 + 6.0 * n))
        binomial *= -(n + 0.5) / (n + 1.0)
    for term in reversed(terms[1:]):
        total = (total + term) * w
    return math.log(0.4 / math.sqrt(a)) + 1.5 * log_lambda + xp.log1p(total)


def _mach_number(log_lambda: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return U/c from the first node on: NumPy's twin of `point_source_mach_number`."""
    curve, tail = point_source_curve(), point_source_tail()
    last = curve.nodes[-1]
    far = np.maximum(log_lambda, last)
    near = curve.inside(np.minimum(log_lambda, last))
    ratio = np.where(log_lambda > last, tail.log_pressure(far), near)
    return np.sqrt(1.0 + 6.0 / 7.0 * np.exp(ratio))
