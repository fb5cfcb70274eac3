r"""The decay coefficient of a Friedlander pulse from its peak, impulse and duration.

The pulse $p = P_s (1 - s)\,e^{-bs}$ with $s = t/t_d$ has the impulse $P_s t_d\,k(b)$,

$$k(b) = \frac{b - 1 + e^{-b}}{b^2}, \qquad k(0) = \tfrac12$$

which falls with $b$ from 1 to 0 (Friedlander 1946; Baker, Explosions in Air, 1973). The
inverse is found by Newton's method, for arrays of NumPy and JAX alike.
"""

import math
from typing import Any

from jblast.types import Array, ArrayLike, Float, namespace, numpy_or_jax

SERIES = tuple((-1.0) ** n / math.factorial(n + 2) for n in range(18))
"""Coefficients of the series of $k(b)$, used for |b| < 1."""
# Four reach rounding for k from 1e-6 to 1e12; one is a margin.
NEWTON_STEPS = 5
"""Newton steps for the decay."""


def friedlander_decay(
    peak_overpressure: ArrayLike,
    impulse: ArrayLike,
    duration: ArrayLike,
) -> Float[Array, "..."]:
    r"""Return the decay $b$ that gives a pulse its impulse [-].

    It is unique for every $k = i/(P_s t_d)$: 0 at $k = 1/2$, negative above. Above
    $e - 2 = 0.718$ it is below $-1$, and peak, impulse and duration do not belong to
    one Friedlander pulse.

    Args:
        peak_overpressure: $P_s$ [Pa], positive.
        impulse: Impulse of the positive phase $i$ [Pa s], positive.
        duration: Duration of the positive phase $t_d$ [s], positive.
    """
    peak, impulse, duration = numpy_or_jax(peak_overpressure, impulse, duration)
    return decay_of_fraction(impulse / (peak * duration))


def impulse_fraction(decay: Float[Any, "..."]) -> Float[Any, "..."]:
    """Return $k(b)$: impulse over peak times duration."""
    return _fraction_and_slope(decay)[0]


def decay_of_fraction(fraction: Float[Array, "..."]) -> Float[Array, "..."]:
    r"""Return the decay $b$ of an impulse fraction $k > 0$, the inverse of $k(b)$.

    Newton's method, which always converges: $q(b) = 1/k(b)$ is convex and rising, so
    for $k \le 1/2$ the steps fall towards the root from any start above it: the tangent
    at zero gives $\tfrac32(1/k - 2)$, the asymptote $1/k - 1$. For $k > 1/2$ they are
    taken of $\ln q$, concave at negative $b$, and rise from below, where its tangent at
    zero puts $-3\ln 2k$. The last steps start at the root, so that their derivatives
    are those of the inverse.
    """
    xp = namespace(fraction)
    rising, inverse = fraction > 0.5, 1.0 / fraction
    asymptote = xp.minimum(1.5 * (inverse - 2.0), inverse - 1.0)
    decay = xp.where(rising, -3.0 * xp.log(2.0 * fraction), asymptote)
    for _ in range(NEWTON_STEPS):
        k, slope = _fraction_and_slope(decay)
        ratio = k / fraction
        residual = xp.where(rising, -xp.log(ratio), 1.0 - ratio)
        decay = decay + residual * (k / slope)
    return decay


def _fraction_and_slope(
    decay: Float[Array, "..."],
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Return k and dk/db."""
    xp = namespace(decay)
    # at |b| < 1 the closed form loses digits; the replacement keeps 0/0 out of it
    near = xp.abs(decay) < 1.0
    b, small = xp.where(near, 1.0, decay), xp.where(near, decay, 0.0)
    series, rise = 0.0 * small, 0.0 * small
    for coefficient in reversed(SERIES):
        rise = rise * small + series
        series = series * small + coefficient
    # (b + expm1(-b))/b^2, so divided that a large b does not overflow when squared
    share = xp.expm1(-b) / b
    far = (1.0 + share) / b
    return xp.where(near, series, far), xp.where(near, rise, (-share - 2.0 * far) / b)
