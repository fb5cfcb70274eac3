"""Each number by itself, told from draws: as `laplace.marginals` does from a normal."""

import math

import jax
import numpy as np
from jaxtyping import Float

from jblast.inference.posterior.estimate import Estimate
from jblast.inference.posterior.parameters import Parameters
from jblast.scene import parameter_named


def marginals_of_draws(
    parameters: Parameters,
    z: Float[np.ndarray, "draw free"],
    weights: Float[np.ndarray, " draw"] | None = None,
    quantiles: Float[np.ndarray, "3 free"] | None = None,
) -> dict[str, Estimate]:
    """Summarise each number by itself, value and median at the draws' median.

    Args:
        parameters: What was fitted.
        z: Draws of the coordinates.
        weights: What each counts; all alike without them.
        quantiles: 5, 50 and 95 % of each coordinate, where they are known better.
    """
    if weights is None:
        weights = np.full(len(z), 1 / len(z))
    values = parameters.values_of_each(jax.device_put(z))
    known = (
        None
        if quantiles is None
        else parameters.values_of_each(jax.device_put(quantiles))
    )
    answer = {}
    for name in parameters.names:
        value = np.asarray(values[name])
        q05, q50, q95 = (
            weighted_quantiles(value, weights, (0.05, 0.5, 0.95))
            if known is None
            else map(float, np.asarray(known[name]))
        )
        answer[name] = Estimate(
            value=q50,
            sd=_sd(value, weights),
            log_sd=_log_sd(value, weights)
            if parameter_named(name).positive
            else math.nan,
            q05=q05,
            q50=q50,
            q95=q95,
        )
    return answer


def weighted_quantiles(
    x: Float[np.ndarray, " draw"],
    weights: Float[np.ndarray, " draw"],
    shares: tuple[float, ...],
) -> tuple[float, ...]:
    """Return quantiles of weighted draws; of equal weights those of `numpy.quantile`.

    Each draw stands at the middle of its weight, stretched so that the least is at 0
    and the largest at 1.
    """
    order = np.argsort(x)
    w = weights[order]
    middle = np.cumsum(w) - 0.5 * w
    at = (middle - middle[0]) / (middle[-1] - middle[0]) if len(x) > 1 else middle
    return tuple(float(q) for q in np.interp(shares, at, x[order]))


def _sd(x, weights) -> float:
    weights = weights / np.sum(weights)
    with np.errstate(over="ignore", invalid="ignore"):  # e.g. a mass nothing bounds
        return float(np.sqrt(weights @ np.square(x - weights @ x)))


def _log_sd(x, weights) -> float:
    """Sd of ln, without draws where a normal prior reaches below zero."""
    positive = x > 0
    return _sd(np.log(x[positive]), weights[positive])
