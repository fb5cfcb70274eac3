r"""Likelihood of records that share effects, with Student-t errors of their own.

No measurement of its own: the likelihood of `calibration.ford_2021`,
`calibration.ground_motion` and `calibration.far_pressure`, and its maximum over
scatters.

A record is $y_i = m_i(x) + s\,\epsilon_i$: $m$ what is predicted from the hidden
$x$ (coefficients with a flat prior, effects scaled to unit normals), $\epsilon$
Student-t. $x$ is integrated out by Laplace's method, which is exact for Gaussian errors
and a prediction linear in $x$. A flat prior on the coefficients makes the
likelihood the restricted one (REML), which does not mistake fitted coefficients for
small scatter.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import gammaln
from jaxtyping import Array, Float
from scipy.optimize import minimize

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


SMALLEST_SD = 1e-3
STEEPEST, STEEPEST_INSIDE = 0.01, 1e-6
"""Slopes of ln L, and of the effects integrated over, that count as a maximum."""


class Maximum(NamedTuple):
    """Where the likelihood is greatest.

    Attributes:
        values: Coefficients, then scatters.
        covariance: Of the coefficients; zero where they were not integrated over.
        log_likelihood: There.
        log_posterior: There, the prior of scatters included.
    """

    values: np.ndarray
    covariance: np.ndarray
    log_likelihood: float
    log_posterior: float


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


def print_forms(
    quantity: str, forms: Mapping[str, Any], fit: Callable[..., Any]
) -> None:
    """Print how likely each form of a curve makes the recordings, and its AIC.

    Args:
        quantity: Its name in observation files.
        forms: What is fitted, by title.
        fit: Fits the quantity by a form; unrestricted, for AIC.
    """
    print(f"{quantity}\n  {'form':30s}     lnL  free     AIC")
    for title, form in forms.items():
        try:
            tried = fit(quantity, form, restricted=False)
        except RuntimeError as error:
            print(f"  {title:30s} no maximum: {error}")
            continue
        aic = 2 * tried.n_free - 2 * tried.log_likelihood
        numbers = f"{tried.log_likelihood:7.2f} {tried.n_free:5d} {aic:7.1f}"
        print(f"  {title:30s} {numbers}")


def likelihood_maximum(
    cost: Callable[..., Any],
    weight: np.ndarray,
    start: np.ndarray,
    free: np.ndarray,
    inner: list[int],
    coefficients: int,
    *,
    restricted: bool,
) -> Maximum:
    """Climb to the maximum from one start.

    Args:
        cost: Minus ln of the posterior with what it was found with, and the gradient,
            of all values and the records' weights.
        weight: 1 for a record that is used, 0 for one left out.
        start: Coefficients, then scatters; those that are held have their values.
        free: Which of them the search may change.
        inner: Which coefficients are not held.
        coefficients: How many of the values are coefficients.
        restricted: Whether the coefficients are integrated over, and come from there.

    Raises:
        RuntimeError: The search ended away from a maximum.
    """
    values, n, weights = start.copy(), coefficients, jnp.asarray(weight)

    def at(found: np.ndarray) -> np.ndarray:
        full = values.copy()
        full[free] = found
        return full

    def value_and_slope(found: np.ndarray) -> tuple[float, np.ndarray]:
        (value, _), gradient = cost(at(found), weights)
        return float(value), np.asarray(gradient)[free]

    found = minimize(
        value_and_slope,
        values[free],
        jac=True,
        method="L-BFGS-B",
        bounds=[(SMALLEST_SD, 10.0) if i >= n else (-60.0, 60.0) for i in free],
        options={"ftol": 1e-13, "gtol": 1e-5, "maxiter": 500},
    )
    values = at(found.x)
    (_, end), _ = cost(values, weights)
    # The flag may name a line search that ended in rounding; the slope decides.
    at_bound = (found.x <= SMALLEST_SD) & (found.jac > 0)
    slope = float(np.max(np.abs(np.where(at_bound, 0.0, found.jac))))
    if not (slope <= STEEPEST and float(end.steepness) <= STEEPEST_INSIDE):
        raise RuntimeError(f"the slope of ln L is still {slope:.1g}")
    covariance = np.zeros((n, n))
    if restricted:
        values[inner] = end.mode[: len(inner)]
        covariance[np.ix_(inner, inner)] = end.covariance[: len(inner), : len(inner)]
    return Maximum(values, covariance, float(end.log_likelihood), -float(found.fun))
