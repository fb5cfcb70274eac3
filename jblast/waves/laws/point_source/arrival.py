r"""The arrival of a point source's shock as the integral of one over its speed.

$$\frac{c_0 t}{R_0} = \int_0^\lambda \frac{d\lambda}{M}, \qquad
  M^2 = 1 + \tfrac67 x, \qquad R_0 = (E/P_0)^{1/3}$$

with $x(\lambda)$ of `front.py`: a series below the first node, a table
from there to $\lambda$ = 1e4, and past it a head start over sound that grows as it does
where the shock is weak. The derivative is that of none of these but $1/M$ itself.
"""

import math
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.waves.curves.hermite import HermiteCurve, hermite_curve
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


@jax.custom_jvp
def log_sound_fraction(log_lambda: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return ln(c t / R): the arrival as a fraction of the sound's travel time."""
    table, lead = _arrival_table()
    first, last = table.nodes[[0, -1]].tolist()
    close = _log_fraction_near(jnp.minimum(log_lambda, first))
    inside = table.value(jnp.minimum(jnp.maximum(log_lambda, first), last))
    tail, beyond = point_source_tail(), jnp.maximum(log_lambda, last)
    # R - c t grows by 3/7 of the integral of x, which is 2 A sqrt(ln(lambda/b)).
    reach = jnp.sqrt(beyond - math.log(tail.length))
    grown = reach - math.sqrt(last - math.log(tail.length))
    lead = lead + 6.0 / 7.0 * tail.amplitude * grown
    far = jnp.log1p(-lead * jnp.exp(-beyond))
    return jnp.where(
        log_lambda < first, close, jnp.where(log_lambda < last, inside, far)
    )


@log_sound_fraction.defjvp
def log_sound_fraction_jvp(primals, tangents):
    """Make dt/dR = 1/U exact: d ln t/d ln R = (R/t)/U."""
    (log_lambda,), (tangent,) = primals, tangents
    fraction = log_sound_fraction(log_lambda)
    slope = jnp.exp(-fraction) / point_source_mach_number(log_lambda)
    return fraction, (slope - 1.0) * tangent


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


@cache
def _arrival_table() -> tuple[HermiteCurve, float]:
    r"""Integrate 1/M: in NumPy, always in float64, also under jit.

    Returns:
        ln(c t/R) against ln(lambda), on nodes that are evenly spaced and fall on those
        of the pressure; and $R - c t$ at its end.
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
    table = hermite_curve(nodes, np.log(arrival) - nodes, slopes)
    return table, float(np.exp(nodes[-1]) - arrival[-1])


def _mach_number(log_lambda: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return U/c from the first node on: NumPy's twin of `point_source_mach_number`."""
    curve, tail = point_source_curve(), point_source_tail()
    last = curve.nodes[-1]
    far = np.maximum(log_lambda, last)
    weak = math.log(tail.amplitude) - far
    weak = weak - 0.5 * np.log(far - math.log(tail.length))
    ratio = np.where(
        log_lambda > last, weak, curve.inside(np.minimum(log_lambda, last))
    )
    return np.sqrt(1.0 + 6.0 / 7.0 * np.exp(ratio))
