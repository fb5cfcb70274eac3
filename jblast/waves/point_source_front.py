r"""The shock front of a point source in scaled terms: energy, air and sound are one.

With $\lambda = R\,(P_0/E)^{1/3}$ and $x = p/P_0$ the front is one curve $x(\lambda)$.
From 0.1 to 1e6 it runs through the values and slopes of `data/point_source.csv`, cubic
in $\ln x$ against $\ln\lambda$. Nearer the source it is Sedov's and Taylor's strong
limit with the constant that meets the first value,

$$x = \frac{8}{60\,\alpha}\lambda^{-3} + 1.135, \qquad \alpha(1.4) = 0.851071854758$$

and farther a power law. The arrival is the integral of one over the speed,

$$\frac{c_0 t}{R_0} = \int_0^\lambda \frac{d\lambda}{M}, \qquad
  M^2 = 1 + \tfrac67 x, \qquad R_0 = (E/P_0)^{1/3}$$

summed as a series below 0.1 and tabulated from there; its derivative is $1/M$ itself.
"""

import math
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.waves.data_table import data_rows
from jblast.waves.hermite_curve import HermiteCurve, hermite_curve

SEDOV_ALPHA = 0.851071854758
"""$E t^2/(\rho_0 R^5)$ for gamma 1.4; `sedov_alpha.py` computes it."""

STRONG = 8.0 / (60.0 * SEDOV_ALPHA)
"""$x \\lambda^3$ of the strong limit: $p = 8E/(25 \\cdot 2.4\\,\\alpha R^3)$."""

SPACING = 0.02
"""Of the arrival table, in ln(lambda): it leaves less than 1e-9 of the arrival."""


@cache
def _pressure_curve() -> HermiteCurve:
    """Read ln x against ln(lambda)."""
    rows = data_rows("point_source")
    table = np.array([[float(value) for value in row.values()] for row in rows])
    distance, pressure, slopes = table.T
    # The printed slope there, to more digits: that of the strong limit and a constant.
    slopes[0] = -3.0 * STRONG / (distance[0] ** 3 * pressure[0])
    return hermite_curve(np.log(distance), np.log(pressure), slopes)


@cache
def _offset() -> float:
    """Return the constant on top of the strong limit: what the first node has more."""
    curve = _pressure_curve()
    return math.exp(curve.coefficients[0, 0]) - STRONG * math.exp(-3 * curve.nodes[0])


def point_source_nodes() -> tuple[float, ...]:
    """Return where the pressure's curvature jumps, as scaled distances lambda."""
    return tuple(np.exp(_pressure_curve().nodes).tolist())


def log_overpressure_ratio(log_lambda: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return ln(p/P0)."""
    curve, offset = _pressure_curve(), _offset()
    first = float(curve.nodes[0])
    near = log_lambda < first
    close = jnp.where(near, log_lambda, first)
    strong = math.log(STRONG) - 3.0 * close
    strong = strong + jnp.log1p(offset / STRONG * jnp.exp(3.0 * close))
    return jnp.where(near, strong, curve.value(jnp.where(near, first, log_lambda)))


def point_source_mach_number(log_lambda: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return U/c."""
    return jnp.sqrt(1.0 + 6.0 / 7.0 * jnp.exp(log_overpressure_ratio(log_lambda)))


@jax.custom_jvp
def log_sound_fraction(log_lambda: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return ln(c t / R): the arrival as a fraction of the sound's travel time."""
    first, last = _pressure_curve().nodes[[0, -1]].tolist()
    table, lead = _arrival_table()
    close = _log_fraction_near(jnp.minimum(log_lambda, first))
    inside = table.value(jnp.minimum(jnp.maximum(log_lambda, first), last))
    # Past the table the lead over sound grows by nothing that could be seen.
    far = jnp.log1p(-lead * jnp.exp(-jnp.maximum(log_lambda, last)))
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
    a, b = 6.0 / 7.0 * STRONG, 1.0 + 6.0 / 7.0 * _offset()
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
    """Integrate 1/M: in NumPy, always in float64, also under jit.

    Returns:
        ln(c t/R) against ln(lambda), and R - c t at its end.
    """
    pressure = _pressure_curve()
    points, weights = np.polynomial.legendre.leggauss(8)
    log_lambda, mach, arrival = [], [], []
    first = float(pressure.nodes[0])
    start = math.exp(first + float(_log_fraction_near(first)))
    for k, width in enumerate(np.diff(pressure.nodes)):
        count = math.ceil(width / SPACING)
        starts = np.arange(count + 1) / count
        inner = starts[:-1, None] + (points[None, :] + 1.0) / (2.0 * count)

        def mach_number(fraction, k=k):
            return np.sqrt(1.0 + 6.0 / 7.0 * np.exp(pressure.piece(k, fraction)))

        lambdas = np.exp(pressure.nodes[k] + width * inner)
        parts = (lambdas / mach_number(inner)) @ weights * width / (2.0 * count)
        times = start + np.concatenate([[0.0], np.cumsum(parts)])
        keep = slice(1 if k else 0, None)
        log_lambda.append((pressure.nodes[k] + width * starts)[keep])
        mach.append(mach_number(starts)[keep])
        arrival.append(times[keep])
        start = times[-1]
    nodes, m, t = (np.concatenate(part) for part in (log_lambda, mach, arrival))
    table = hermite_curve(nodes, np.log(t) - nodes, np.exp(nodes) / (m * t) - 1.0)
    return table, float(np.exp(nodes[-1]) - t[-1])
