"""The maximum of a marginal likelihood over scatters, with its curve's coefficients."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize

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
