"""Elasticities: by how many per cent an outcome moves for one of a number."""

from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


def elasticities(
    outcome: Callable[[Mapping[str, Float[Array, ""]]], Float[Array, ""]],
    numbers: Mapping[str, float],
) -> dict[str, float]:
    r"""Return $\partial\ln|y|/\partial\ln|x|$ of each number, by `jax.grad`.

    Args:
        outcome: From numbers by name to one value.
        numbers: Where the slopes are taken; each not zero.

    Returns:
        By name; NaN where the outcome or a number is zero.
    """
    point = {name: jnp.asarray(value, float) for name, value in numbers.items()}
    value, slopes = jax.jit(jax.value_and_grad(outcome))(point)
    y = float(value)
    return {
        name: float(slopes[name]) * numbers[name] / y
        if y and numbers[name]
        else float("nan")
        for name in numbers
    }


def fitted_slopes(
    inputs: Mapping[str, Float[np.ndarray, " sample"]],
    values: Float[np.ndarray, " sample"],
) -> tuple[dict[str, float], dict[str, float]]:
    """Return elasticities, and shares of the variance, of a plane through samples.

    What a store alone tells of slopes: the plane of least squares through the tenth of
    the samples nearest to the middle, in units of standard deviations.

    Returns:
        By name the elasticity at the medians, NaN about zero; and the share that the
        number would have of the variance, were the outcome straight everywhere.
    """
    names = [name for name, of in inputs.items() if np.ptp(of) > 0]
    good = np.isfinite(values)
    matrix = np.column_stack([np.asarray(inputs[name])[good] for name in names])
    y = np.asarray(values, float)[good]
    middle, sd = np.median(matrix, axis=0), matrix.std(axis=0)
    scores = (matrix - middle) / sd
    away = np.sum(scores**2, axis=1)
    count = min(len(y), max(len(y) // 10, 10 * (len(names) + 1)))
    near = np.argpartition(away, count - 1)[:count]
    plane = np.column_stack([np.ones(count), scores[near]])
    found = np.linalg.lstsq(plane, y[near], rcond=None)[0]
    squares = found[1:] ** 2
    shares = squares / squares.sum() if squares.sum() > 0 else squares
    with np.errstate(divide="ignore", invalid="ignore"):
        elastic = np.where(
            (found[0] != 0) & (middle != 0), found[1:] / sd * middle / found[0], np.nan
        )
    return (
        dict(zip(names, map(float, elastic), strict=True)),
        dict(zip(names, map(float, shares), strict=True)),
    )
