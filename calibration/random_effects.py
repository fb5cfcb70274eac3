r"""Likelihood of records that share effects, with Student-t errors of their own.

A record is $y_i = m_i(x) + s\,\epsilon_i$: $m$ what is predicted from the hidden
$x$ (coefficients with a flat prior, effects scaled to unit normals), $\epsilon$
Student-t. $x$ is integrated out by Laplace's method, which is exact for Gaussian errors
and a prediction linear in $x$. A flat prior on the coefficients makes the
likelihood the restricted one (REML), which does not mistake fitted coefficients for
small scatter.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.scipy.special import gammaln
from jaxtyping import Array, Float

NEAR = 1e-2
"""Step in a hidden variable below which Newton's method takes over."""

MOST_STEPS = 200
"""Reweighted least-squares steps at most; they gain a factor of about 0.5 each."""


class Marginal(NamedTuple):
    """What is left when the hidden $x$ is integrated out.

    Attributes:
        log_likelihood: ln of the integral over $x$.
        mode: The most likely $x$.
        covariance: Of $x$ about it.
        steepness: Largest gradient left at the mode; large if it was not found.
    """

    log_likelihood: Float[Array, ""]
    mode: Float[Array, " hidden"]
    covariance: Float[Array, "hidden hidden"]
    steepness: Float[Array, ""]


def log_student_t(residual: Array, scale: Array, nu: float) -> Array:
    """Return the log density of a Student-t error; infinite `nu` is Gaussian."""
    squared = (residual / scale) ** 2
    if math.isinf(nu):
        return -0.5 * squared - jnp.log(scale) - 0.5 * math.log(2 * math.pi)
    norm = gammaln((nu + 1) / 2) - gammaln(nu / 2) - 0.5 * math.log(nu * math.pi)
    return norm - jnp.log(scale) - (nu + 1) / 2 * jnp.log1p(squared / nu)


def marginal(
    predict: Callable[[Array, Array], Array],
    parameters: Float[Array, " parameter"],
    precision: Float[Array, " hidden"],
    start: Float[Array, " hidden"],
    value: Float[Array, " record"],
    weight: Float[Array, " record"],
    nu: float,
) -> Marginal:
    """Integrate the hidden variables out; differentiable in the parameters.

    Args:
        predict: Expected values of the records, from parameters and hidden variables.
        parameters: What stays; the last is the scale of the records' own errors.
        precision: 1 for a unit-normal effect, 0 for a coefficient with a flat prior.
        start: Where the search for the mode begins.
        value: Measured values.
        weight: 1, or 0 for a record left out.
        nu: Degrees of freedom of the records' own errors; `math.inf` is Gaussian.
    """

    def cost(parameters: Array, x: Array) -> Array:
        residual = value - predict(parameters, x)
        terms = weight * log_student_t(residual, parameters[-1], nu)
        return 0.5 * jnp.sum(precision * x**2) - jnp.sum(terms)

    # The search is not differentiated; one Newton step from its end carries the
    # derivative of the mode by the parameters.
    frozen = jax.lax.stop_gradient(parameters)

    def reweighted_step(x: Array) -> Array:
        residual = value - predict(frozen, x)
        slope = jax.jacfwd(predict, argnums=1)(frozen, x)
        if math.isinf(nu):
            pull = weight / frozen[-1] ** 2
        else:
            pull = weight * (nu + 1) / (nu * frozen[-1] ** 2 + residual**2)
        curvature = slope.T @ (pull[:, None] * slope) + jnp.diag(precision)
        return jnp.linalg.solve(curvature, slope.T @ (pull * residual) - precision * x)

    def still_far(state: tuple[Array, Array, Array]) -> Array:
        count, _, step = state
        return (count < MOST_STEPS) & (jnp.max(jnp.abs(step)) > NEAR)

    def walk(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        count, x, step = state
        return count + 1, x + step, reweighted_step(x + step)

    def newton_step(parameters: Array, x: Array) -> Array:
        curvature = jax.hessian(cost, argnums=1)(frozen, jax.lax.stop_gradient(x))
        slope = jax.grad(cost, argnums=1)(parameters, x)
        return x - jnp.linalg.solve(curvature, slope)

    begin = jax.lax.stop_gradient(start)
    state = (jnp.asarray(0), begin, reweighted_step(begin))
    _, x, _ = jax.lax.while_loop(still_far, walk, state)
    x = jax.lax.fori_loop(0, 4, lambda _, x: newton_step(frozen, x), x)
    x = newton_step(parameters, x)
    curvature = jax.hessian(cost, argnums=1)(parameters, x)
    slope = jax.grad(cost, argnums=1)(parameters, x)
    flat = jnp.sum(1.0 - precision)
    return Marginal(
        log_likelihood=-cost(parameters, x)
        - 0.5 * jnp.linalg.slogdet(curvature)[1]
        + 0.5 * flat * math.log(2 * math.pi),
        mode=x,
        covariance=jnp.linalg.inv(curvature),
        steepness=jnp.max(jnp.abs(slope)),
    )
