"""Fit the curve of `waves/laws/ford_2021/curve.py` and its scatter to recordings."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize

from calibration.ford_likelihood import COEFFICIENTS, NAMES, SCATTERS, Form, objective
from calibration.ford_records import read_records
from jblast.waves.laws.ford_2021.curve import FordCurve

SMALLEST_SD = 1e-3
STARTS = {
    "positive_impulse_pa_s": (
        (6.5, -1.15, 12.0, 0.4, 0.0, 0.1, 0.06, 1.0, 0.15, 0.1),
        (6.8, -1.15, 5.0, 1.0, 0.0, 0.1, 0.15, 0.6, 0.15, 0.1),
    ),
    "positive_duration_s": ((-5.3, 0.22, 0.7, 1.0, 0.0, 0.05, 0.12, 0.6, 0.11, 0.1),),
}
"""Values of `NAMES` where searches begin; the best end is taken."""


class Fit(NamedTuple):
    """Coefficients, scatter and what they reached; the prior tells the last two apart.

    The covariance of a coefficient that was not fitted is zero.
    """

    coefficients: np.ndarray
    covariance: np.ndarray
    scatter: np.ndarray
    log_likelihood: float
    log_posterior: float
    n_free: int

    @property
    def curve(self) -> FordCurve:
        """Return the curve as the package has it: without a bend."""
        if self.coefficients[-1] != 0:
            raise ValueError(f"expected b5 = 0, got {self.coefficients[-1]:g}")
        covariance = self.covariance[:-1, :-1]
        return FordCurve(self.coefficients[:-1], covariance, *self.scatter)


def fit(
    quantity: str,
    form: Form,
    *,
    restricted: bool = True,
    weight: np.ndarray | None = None,
) -> Fit:
    """Fit one quantity from all starts, and return the best.

    Args:
        quantity: Its name in observation files.
        form: What is fitted.
        restricted: Whether to integrate over the coefficients (for estimates), or to
            maximise over them too (for AIC).
        weight: 1 for a record that is used, 0 for one left out.

    Raises:
        RuntimeError: Every search ended away from a maximum.
    """
    weights = np.ones(len(read_records().shot)) if weight is None else weight
    ends, failures = [], []
    for start in STARTS[quantity]:
        try:
            ends.append(search(quantity, form, restricted, weights, start))
        except RuntimeError as error:
            failures.append(str(error))
    if not ends:
        raise RuntimeError("; ".join(failures))
    return max(ends, key=lambda end: end.log_posterior)


def search(
    quantity: str,
    form: Form,
    restricted: bool,
    weight: np.ndarray,
    start: tuple[float, ...],
) -> Fit:
    """Fit one quantity from one start; arguments as for `fit`."""
    cost = objective(quantity, form, restricted)
    weights = jnp.asarray(weight)
    held, n = dict(form.fixed), len(COEFFICIENTS)
    theta = np.array([held.get(*pair) for pair in zip(NAMES, start, strict=True)])
    fitted = SCATTERS if restricted else NAMES
    free = np.array([NAMES.index(name) for name in fitted if name not in held])

    def at(values: np.ndarray) -> np.ndarray:
        full = theta.copy()
        full[free] = values
        return full

    def value_and_slope(values: np.ndarray) -> tuple[float, np.ndarray]:
        (value, _), gradient = cost(at(values), weights)
        return float(value), np.asarray(gradient)[free]

    found = minimize(
        value_and_slope,
        theta[free],
        jac=True,
        method="L-BFGS-B",
        bounds=[(SMALLEST_SD, 10.0) if i >= n else (-60.0, 60.0) for i in free],
        options={"ftol": 1e-13, "gtol": 1e-5, "maxiter": 500},
    )
    theta = at(found.x)
    (_, end), _ = cost(theta, weights)
    # The flag may name a line search that ended in rounding; the slope decides.
    at_bound = (found.x <= SMALLEST_SD) & (found.jac > 0)
    slope = float(np.max(np.abs(np.where(at_bound, 0.0, found.jac))))
    if slope > 0.01 or float(end.steepness) > 1e-6:
        raise RuntimeError(f"the slope of ln L is still {slope:.1g}")
    inner = [i for i, name in enumerate(COEFFICIENTS) if name not in held]
    covariance = np.zeros((n, n))
    if restricted:
        theta[inner] = end.mode[: len(inner)]
        covariance[np.ix_(inner, inner)] = end.covariance[: len(inner), : len(inner)]
    return Fit(
        coefficients=theta[:n],
        covariance=covariance,
        scatter=theta[n:],
        log_likelihood=float(end.log_likelihood),
        log_posterior=-float(found.fun),
        n_free=len(NAMES) - len(held),
    )
