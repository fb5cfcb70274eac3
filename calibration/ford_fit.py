"""Fit the curve of `waves/laws/ford_2021.py` and its scatter to recordings."""

from typing import NamedTuple

import numpy as np

from calibration.ford_likelihood import COEFFICIENTS, NAMES, SCATTERS, Form, objective
from calibration.ford_records import read_records
from calibration.likelihood_maximum import likelihood_maximum
from jblast.waves.laws.ford_2021 import FordCurve

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
    held = dict(form.fixed)
    fitted = SCATTERS if restricted else NAMES
    found = likelihood_maximum(
        objective(quantity, form, restricted),
        weight,
        np.array([held.get(*pair) for pair in zip(NAMES, start, strict=True)]),
        np.array([NAMES.index(name) for name in fitted if name not in held]),
        [i for i, name in enumerate(COEFFICIENTS) if name not in held],
        len(COEFFICIENTS),
        restricted=restricted,
    )
    return Fit(
        coefficients=found.values[: len(COEFFICIENTS)],
        covariance=found.covariance,
        scatter=found.values[len(COEFFICIENTS) :],
        log_likelihood=found.log_likelihood,
        log_posterior=found.log_posterior,
        n_free=len(NAMES) - len(held),
    )
