r"""Mean, variance and extremes of a stream, with weights.

A block is reduced in two passes, its mean and then the squares about it; two states
merge by the rule of Chan, Golub and LeVeque (1983, eq. 1.5; Welford 1962 for one),

$$m = m_a + \delta\,W_b/W, \qquad M_2 = M_{2a} + M_{2b} + \delta^2\,W_a W_b/W,$$

with $\delta = m_b - m_a$, $W$ the sum of weights and $M_2 = \sum w\,(x-m)^2$ (West 1979
for weights). The standard error of a weighted mean needs $\sum w^2 (x-m)^2$, so the
same three numbers are kept for the squared weights, too.
"""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Array, Float, Int


class Moments(NamedTuple):
    """What is known of a stream, an element for each outcome of a sample.

    Attributes:
        finite: How many values are finite.
        infinite: Values that are infinite: they count among the extremes only.
        lost: Lanes that failed, which are NaN.
        weight: Sum of the weights of the finite ones.
        mean: Their weighted mean.
        squares: Weighted sum of squares about it.
        weight_2: Sum of squared weights.
        mean_2: Mean by squared weights.
        squares_2: Sum of squares about that one, by squared weights.
        minimum: The least value, infinite where there is none.
        maximum: The greatest value.
    """

    finite: Int[Array | np.ndarray, "..."]
    infinite: Int[Array | np.ndarray, "..."]
    lost: Int[Array | np.ndarray, "..."]
    weight: Float[Array | np.ndarray, "..."]
    mean: Float[Array | np.ndarray, "..."]
    squares: Float[Array | np.ndarray, "..."]
    weight_2: Float[Array | np.ndarray, "..."]
    mean_2: Float[Array | np.ndarray, "..."]
    squares_2: Float[Array | np.ndarray, "..."]
    minimum: Float[Array | np.ndarray, "..."]
    maximum: Float[Array | np.ndarray, "..."]


def empty_moments(shape: tuple[int, ...] = ()) -> Moments:
    """Return the state of no samples, in NumPy."""
    none, zero = np.zeros(shape, np.int64), np.zeros(shape)
    far = np.full(shape, np.inf)
    return Moments(none, none, none, zero, zero, zero, zero, zero, zero, far, -far)


def moments_of(
    values: Float[Array | np.ndarray, "sample ..."],
    weights: Float[Array | np.ndarray, " sample"] | None = None,
) -> Moments:
    """Reduce one block along its first axis; pure, in JAX where the values are of it.

    Args:
        values: Of a block of samples; NaN where a lane failed.
        weights: Of each sample; one each where None.
    """
    xp = values.__array_namespace__()
    if isinstance(values, np.ndarray) and weights is None and np.isfinite(values).all():
        return plain_moments(values)
    finite, nan = xp.isfinite(values), xp.isnan(values)
    known = xp.where(finite, values, 0)
    count = xp.sum(finite, axis=0)
    if weights is None:
        one = weighted_moments(known, finite.astype(values.dtype))
        two = one
    else:
        column = weights.reshape(weights.shape + (1,) * (values.ndim - 1))
        lanes = xp.where(finite, column, 0)
        one, two = weighted_moments(known, lanes), weighted_moments(known, lanes**2)
    return Moments(
        count,
        xp.sum(~finite & ~nan, axis=0),
        xp.sum(nan, axis=0),
        *one,
        *two,
        xp.min(xp.where(nan, xp.inf, values), axis=0, initial=xp.inf),
        xp.max(xp.where(nan, -xp.inf, values), axis=0, initial=-xp.inf),
    )


def plain_moments(values: Float[np.ndarray, "sample ..."]) -> Moments:
    """Reduce one block of finite values without weights, by NumPy and in less time."""
    size, shape = values.shape[0], values.shape[1:]
    if not size:
        return empty_moments(shape)
    values = np.asarray(values, float)
    mean = values.sum(axis=0) / size
    off = values - mean
    squares = np.square(off, out=off).sum(axis=0)
    none, weight = np.zeros(shape, np.int64), np.full(shape, float(size))
    part = weight, mean, squares
    low, high = values.min(axis=0), values.max(axis=0)
    return Moments(none + size, none, none, *part, *part, low, high)


def weighted_moments(
    known: Array | np.ndarray, weights: Array | np.ndarray
) -> tuple[Any, Any, Any]:
    """Return sum of weights, mean, and squares about it, of values all finite."""
    xp = known.__array_namespace__()
    weight = xp.sum(weights, axis=0)
    mean = xp.sum(weights * known, axis=0) / xp.where(weight > 0, weight, 1)
    return weight, mean, xp.sum(weights * (known - mean[None]) ** 2, axis=0)


def merge_moments(a: Moments, b: Moments) -> Moments:
    """Merge two states; `a` stands before `b` in the order of the samples."""
    xp = a.mean.__array_namespace__()

    def merged(w_a, mean_a, squares_a, w_b, mean_b, squares_b):
        weight = w_a + w_b
        share = w_b / xp.where(weight > 0, weight, 1)
        step = mean_b - mean_a
        squares = squares_a + squares_b + step**2 * w_a * share
        return weight, mean_a + step * share, squares

    return Moments(
        a.finite + b.finite,
        a.infinite + b.infinite,
        a.lost + b.lost,
        *merged(*a[3:6], *b[3:6]),
        *merged(*a[6:9], *b[6:9]),
        xp.minimum(a.minimum, b.minimum),
        xp.maximum(a.maximum, b.maximum),
    )


def finish_moments(state: Moments) -> dict[str, np.ndarray]:
    r"""Return what a stream amounts to; NaN where too few values tell it.

    `variance` is $M_2/(W - W_2/W)$ and the squared `standard_error` of the mean
    $\sum w^2(x-m)^2/W^2 \cdot n/(n-1)$ with the effective size
    $n = W^2/W_2$ (Kish 1965); for weights of one these are $s^2$ and $s^2/n$.

    Returns:
        `count`, `infinite`, `lost`, `effective_size`, `mean`, `standard_error`,
        `variance`, `sd`, `minimum`, `maximum`; mean and what follows from it are of the
        finite values.
    """
    count, infinite, lost, weight, mean, squares, w_2, mean_2, squares_2, low, high = (
        np.asarray(part) for part in state
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        size = weight**2 / w_2
        free = np.where(size > 1 + 1e-9, weight - w_2 / weight, np.nan)
        variance = squares / free
        spread = squares_2 + w_2 * (mean_2 - mean) ** 2
        error = np.sqrt(spread / weight * 1 / free)
    some = (count + infinite) > 0
    return {
        "count": count,
        "infinite": infinite,
        "lost": lost,
        "effective_size": np.where(count > 0, size, 0.0),
        "mean": np.where(count > 0, mean, np.nan),
        "standard_error": error,
        "variance": variance,
        "sd": np.sqrt(variance),
        "minimum": np.where(some, low, np.nan),
        "maximum": np.where(some, high, np.nan),
    }
