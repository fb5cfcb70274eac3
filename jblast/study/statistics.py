r"""Statistics of a study: moments, which are additive, and intervals of shares.

A slab of samples is reduced in two passes, its mean and then the squares about it; two
parts are merged by the rule of Chan, Golub and LeVeque (1983, eq. 1.5; Welford 1962 for
one sample),

$$m = m_a + \delta\,n_b/n, \qquad M_2 = M_{2a} + M_{2b} + \delta^2\,n_a n_b/n,$$

with $\delta = m_b - m_a$ and $M_2 = \sum (x-m)^2$. A yes-or-no outcome is a number, 1
or 0, whose mean is the share.

The interval of a share $p$ of $n$ samples is Wilson's (1927),

$$\frac{p + z^2/2n \pm z\sqrt{p(1-p)/n + z^2/4n^2}}{1 + z^2/n}.$$
"""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float, Int

LEVEL = 0.90
"""Default probability of an interval."""
NO_ANSWER = -1
"""Value of a yes-or-no outcome of a failed sample; a number is NaN."""


class Moments(NamedTuple):
    """Moments of samples, one element for each case and sensor.

    Attributes:
        count: Number of finite values.
        infinite: Number of infinite values, which count for the extremes only.
        lost: Number of failed samples.
        mean: Mean of the finite values.
        squares: Sum of squares about the mean.
        minimum: Smallest value, infinite without values.
        maximum: Largest value, minus infinity without values.
    """

    count: Array | np.ndarray  # type: ignore  of a tuple, not used
    infinite: Array | np.ndarray
    lost: Array | np.ndarray
    mean: Array | np.ndarray
    squares: Array | np.ndarray
    minimum: Array | np.ndarray
    maximum: Array | np.ndarray

    @property
    def samples(self) -> Any:
        """Number of samples, failed ones included."""
        return self.count + self.infinite + self.lost


def moments(
    values: Array | np.ndarray, valid: Bool[Array | np.ndarray, " sample"] | None = None
) -> Moments:
    """Return the moments of samples along the first axis, in JAX or NumPy.

    Args:
        values: Numbers, NaN for failed samples; or yes (1), no (0) and failed (-1).
        valid: Samples to count; None for all.
    """
    xp = values.__array_namespace__()
    if values.dtype == xp.int8:
        values = xp.where(values == NO_ANSWER, xp.nan, values.astype(float))
    here = xp.ones(values.shape[:1], bool) if valid is None else valid
    here = here.reshape(-1, *(1,) * (values.ndim - 1))
    finite, known = xp.isfinite(values) & here, ~xp.isnan(values) & here
    # floats, which are exact to 2^53
    samples = xp.sum(here, axis=0, dtype=values.dtype)
    count = xp.sum(finite, axis=0, dtype=values.dtype)
    answered = xp.sum(known, axis=0, dtype=values.dtype)
    mean = xp.sum(xp.where(finite, values, 0.0), axis=0) / xp.maximum(count, 1.0)
    return Moments(
        count,
        answered - count,
        samples - answered,
        mean,
        xp.sum(xp.where(finite, values - mean[None], 0.0) ** 2, axis=0),
        xp.min(xp.where(known, values, xp.inf), axis=0, initial=xp.inf),
        xp.max(xp.where(known, values, -xp.inf), axis=0, initial=-xp.inf),
    )


def merged_moments(a: Moments, b: Moments) -> Moments:
    """Return the moments of two parts, `a` before `b` in the order of the samples."""
    xp = a.mean.__array_namespace__()
    # the maximum guards the division for two empty parts
    share = b.count / xp.maximum(a.count + b.count, 1.0)
    step = b.mean - a.mean
    return Moments(
        a.count + b.count,
        a.infinite + b.infinite,
        a.lost + b.lost,
        a.mean + step * share,
        # sums of squares about zero would cancel
        a.squares + b.squares + step**2 * a.count * share,
        xp.minimum(a.minimum, b.minimum),
        xp.maximum(a.maximum, b.maximum),
    )


def over_cases(state: Moments, which: Bool[np.ndarray, " case"] | slice) -> Moments:
    """Return the moments of some cases together, which are the first axis."""
    parts = [Moments(*one) for one in zip(*(x[which] for x in state), strict=True)]
    whole = moments(np.zeros((0, *np.shape(state.mean)[1:])))
    for part in parts:
        whole = merged_moments(whole, part)
    return whole


def standard_error(state: Moments) -> Float[np.ndarray, "..."]:
    """Return the standard error of the mean; infinite for fewer than two values."""
    count = np.asarray(state.count, float)
    variance = state.squares / np.maximum(count - 1, 1) / np.maximum(count, 1)
    return np.where(count > 1, np.sqrt(variance), np.inf)


def share_error(state: Moments) -> Float[np.ndarray, "..."]:
    """Return the standard error of a share with one yes and one no added.

    Without them a share of 0 or 1 would have an error of zero from the first slab on.
    """
    count = np.asarray(state.count, float) + 2
    share = (state.mean * state.count + 1) / count
    return np.asarray(np.sqrt(share * (1 - share) / count))


def finish_share(state: Moments, level: float = LEVEL) -> dict[str, Any]:
    """Return the statistics of a yes-or-no outcome.

    Returns:
        `count`, `yes`, `lost`, `share`, `standard_error`, `low` and `high`; share and
        error are NaN without known samples.
    """
    count, known = np.asarray(state.count).astype(int), np.asarray(state.count) > 0
    share = np.where(known, state.mean, np.nan)
    low, high = wilson_interval(np.asarray(state.mean), count, level)
    return {
        "count": count,
        "yes": np.rint(state.mean * state.count).astype(int),
        "lost": np.asarray(state.lost).astype(int),
        "share": share,
        "standard_error": np.sqrt(share * (1 - share) / np.maximum(count, 1)),
        "low": low,
        "high": high,
    }


def finish_moments(state: Moments) -> dict[str, Any]:
    r"""Return the statistics of a number; NaN for those that need more values.

    `variance` is $M_2/(n-1)$; the squared `standard_error` of the mean is the variance
    over $n$.

    Returns:
        `count`, `infinite`, `lost`, `mean`, `standard_error`, `variance`, `sd`,
        `minimum`, `maximum`. The statistics from mean to sd are of the finite values.
    """
    count, infinite, lost = (np.asarray(x).astype(int) for x in state[:3])
    mean, squares, low, high = (np.asarray(x) for x in state[3:])
    # a single value has no variance
    variance = squares / np.where(count > 1, count - 1.0, np.nan)
    some = (count + infinite) > 0
    return {
        "count": count,
        "infinite": infinite,
        "lost": lost,
        "mean": np.where(count > 0, mean, np.nan),
        "standard_error": np.sqrt(variance / np.maximum(count, 1)),
        "variance": variance,
        "sd": np.sqrt(variance),
        "minimum": np.where(some, low, np.nan),
        "maximum": np.where(some, high, np.nan),
    }


def wilson_interval(
    share: Float[ArrayLike, "..."],
    count: Float[ArrayLike, "..."] | Int[ArrayLike, "..."],
    level: float = LEVEL,
) -> tuple[np.ndarray, np.ndarray]:
    """Return Wilson's interval of a share; 0 to 1 without samples.

    Args:
        share: Estimated share, 0 to 1.
        count: Number of samples.
        level: Probability of the interval.
    """
    from scipy.special import ndtri

    share, count = np.asarray(share, float), np.asarray(count, float)
    z = ndtri(0.5 + level / 2)
    some = count > 0
    number = np.where(some, count, 1.0)
    found = np.where(some, share, 0.5)
    # Wilson's interval (1927) stays within 0 and 1, and has a width even if no sample
    # has the outcome, unlike the normal interval
    middle = found + z**2 / (2 * number)
    half = z * np.sqrt(found * (1 - found) / number + z**2 / (4 * number**2))
    scale = 1 + z**2 / number
    low, high = (middle - half) / scale, (middle + half) / scale
    # at a share of 0 or 1 one bound is exact: set it, as rounding would miss it
    low = np.where(some & (found > 0), np.maximum(low, 0.0), 0.0)
    high = np.where(some & (found < 1), np.minimum(high, 1.0), 1.0)
    return low, high
