r"""Integrals of the Friedlander pulse in numbers without unit, exact at all decays.

$$k(b) = \int_0^1 (1-x)\,e^{-bx}\,dx = \frac{1}{b} - \frac{1-e^{-b}}{b^2}, \qquad
  g(b) = \int_0^1 x\,e^{-bx}\,dx = \frac{1-(1+b)\,e^{-b}}{b^2}$$

$k$ falls from $1/2$ at $b = 0$ as $1/b$, and grows as $e^{-b}/b^2$ for negative $b$.
Both closed forms cancel near zero, their derivatives more so. For $|b| < 1$ the series
in $b$ stand in for them, so that value and derivatives keep nearly all their digits.
Below $b = -700$ ($-80$ in single precision) they overflow.
"""

import math
from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

TERMS = 18
"""Terms of the series: the first left out is below 1/20! = 4e-19."""

STEPS = 5
"""Newton steps. Four reach rounding for k from 1e-6 to 1e12; one is to spare."""


@jax.jit
def impulse_fraction(decay: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return $k(b)$: impulse over peak times duration."""
    series = [(-1.0) ** n / math.factorial(n + 2) for n in range(TERMS)]
    near, b = _split(decay)
    # (b + expm1(-b))/b^2, so divided that a large b does not overflow when squared
    far = (1.0 + jnp.expm1(-b) / b) / b
    return jnp.where(near, _polynomial(series, jnp.where(near, decay, 0.0)), far)


@jax.jit
def late_fraction(decay: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return $g(b)$, which weighs what comes late."""
    series = [(-1.0) ** n / (math.factorial(n) * (n + 2)) for n in range(TERMS)]
    near, b = _split(decay)
    far = (-jnp.expm1(-b) / b - jnp.exp(-b)) / b
    return jnp.where(near, _polynomial(series, jnp.where(near, decay, 0.0)), far)


@jax.jit
def middle_fraction(decay: Float[Array, "..."]) -> Float[Array, "..."]:
    r"""Return $-k'(b) = \int_0^1 x\,(1-x)\,e^{-bx}\,dx$."""
    return -_fraction_and_slope(decay)[1]


@jax.custom_jvp
@jax.jit
def decay_of_fraction(fraction: Float[Array, "..."]) -> Float[Array, "..."]:
    r"""Return the decay $b$ of an impulse fraction $k > 0$, the inverse of $k(b)$.

    Newton's steps, which cannot fail: $q(b) = 1/k(b)$ is convex and rising, so for
    $k \le 1/2$ they fall towards the root from any start above it: the tangent at zero
    gives $\tfrac32(1/k - 2)$, the asymptote $1/k - 1$. For $k > 1/2$ they are taken of
    $\ln q$, concave at negative $b$, and rise from below, where its tangent at zero
    puts $-3\ln 2k$. The derivative is that of the implicit function, not of the steps.
    """
    rising = fraction > 0.5
    inverse = 1.0 / fraction
    decay = jnp.where(
        rising,
        -3.0 * jnp.log(2.0 * fraction),
        jnp.minimum(1.5 * (inverse - 2.0), inverse - 1.0),
    )

    def step(_, decay):
        k, slope = _fraction_and_slope(decay)
        ratio = k / fraction
        left = jnp.where(rising, -jnp.log(ratio), 1.0 - ratio)
        return decay + left * (k / slope)

    return jax.lax.fori_loop(0, STEPS, step, decay)


@decay_of_fraction.defjvp
def _decay_of_fraction_jvp(primals, tangents):
    """Of the implicit function: db/dk = 1/k'(b)."""
    (fraction,), (tangent,) = primals, tangents
    decay = decay_of_fraction(fraction)
    return decay, -tangent / middle_fraction(decay)


def _fraction_and_slope(decay):
    """Return k and dk/db."""
    return jax.jvp(impulse_fraction, (decay,), (jnp.ones_like(decay),))


def _split(decay):
    """Return where the series holds, and the decay kept away from zero there."""
    near = jnp.abs(decay) < 1.0
    return near, jnp.where(near, 1.0, decay)


def _polynomial(coefficients: Sequence[float], x: Float[Array, "..."]):
    """Sum a series by Horner's rule."""
    value = jnp.full_like(x, coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        value = value * x + coefficient
    return value
