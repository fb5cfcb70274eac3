r"""How often: the share of samples of which an outcome is true, and its interval.

Wilson's interval (1927) of a share $p$ of $n$ samples,

$$\frac{p + z^2/2n \pm z\sqrt{p(1-p)/n + z^2/4n^2}}{1 + z^2/n}.$$

With weights that are ratios of densities, prior over proposal, $p = \sum w y / n$ is
unbiased, and $n$ is the number of samples of the prior whose share would have the same
standard error; without weights that is the number there are.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Array, ArrayLike, Float, Int

LEVEL = 0.90
"""What an interval holds, unless asked otherwise."""
UNKNOWN = -1
"""Of an outcome that is yes or no: its lane failed."""


class ShareState(NamedTuple):
    """What a stream of yes and no is reduced to, an element for each outcome.

    Attributes:
        known: Lanes that did not fail.
        yes: Those of which it is true.
        lost: Lanes that failed, `UNKNOWN`.
        weight: Sum of weights of those known.
        weight_2: Sum of their squares.
        yes_weight: Sum of weights of which it is true.
        yes_weight_2: Sum of their squares.
    """

    known: Int[Array | np.ndarray, "..."]
    yes: Int[Array | np.ndarray, "..."]
    lost: Int[Array | np.ndarray, "..."]
    weight: Float[Array | np.ndarray, "..."]
    weight_2: Float[Array | np.ndarray, "..."]
    yes_weight: Float[Array | np.ndarray, "..."]
    yes_weight_2: Float[Array | np.ndarray, "..."]


def empty_share(
    shape: tuple[int, ...] = (), origin: object = 0.0, weighted: bool = False
) -> ShareState:
    """Return the state of no samples; `origin` and `weighted` change nothing."""
    none, zero = np.zeros(shape, np.int64), np.zeros(shape)
    return ShareState(none, none, none, zero, zero, zero, zero)


def share_of(
    values: Array | np.ndarray,
    weights: Float[Array | np.ndarray, " sample"] | None = None,
    like: ShareState | None = None,
) -> ShareState:
    """Reduce one block along its first axis; pure, in JAX where the values are of it.

    Args:
        values: Of whole numbers or flags: above zero is yes, below is a lost lane.
        weights: Ratio of densities of each sample; one each where None.
        like: Changes nothing.
    """
    xp = values.__array_namespace__()
    lost = xp.zeros(values.shape, bool) if values.dtype == bool else values < 0
    yes = values if values.dtype == bool else values > 0
    count, true = xp.sum(~lost, axis=0), xp.sum(yes, axis=0)
    if weights is None:
        weight, yes_weight = count.astype(float), true.astype(float)
        sums = weight, weight, yes_weight, yes_weight
    else:
        column = weights.reshape(weights.shape + (1,) * (values.ndim - 1))
        known, hit = xp.where(lost, 0, column), xp.where(yes, column, 0)
        sums = tuple(xp.sum(one, axis=0) for one in (known, known**2, hit, hit**2))
    return ShareState(count, true, xp.sum(lost, axis=0), *sums)


def merge_shares(a: ShareState, b: ShareState) -> ShareState:
    """Add two states up."""
    return ShareState(*(one + other for one, other in zip(a, b, strict=True)))


def wilson_interval(
    share: Float[ArrayLike, "..."],
    count: Float[ArrayLike, "..."] | Int[ArrayLike, "..."],
    level: float = LEVEL,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the interval of a share; from 0 to 1 where nothing was counted.

    Args:
        share: That was found, from 0 to 1.
        count: Samples it was found of; not whole where they are equivalent ones.
        level: What the interval holds.
    """
    from scipy.special import ndtri

    share, count = np.asarray(share, float), np.asarray(count, float)
    z = ndtri(0.5 + level / 2)
    some = count > 0
    number = np.where(some, count, 1.0)
    found = np.where(some, share, 0.5)
    middle = found + z**2 / (2 * number)
    half = z * np.sqrt(found * (1 - found) / number + z**2 / (4 * number**2))
    scale = 1 + z**2 / number
    low, high = (middle - half) / scale, (middle + half) / scale
    # what rounding leaves of the two ends that are exact
    low = np.where(some & (found > 0), np.maximum(low, 0.0), 0.0)
    high = np.where(some & (found < 1), np.minimum(high, 1.0), 1.0)
    return low, high


def finish_share(state: ShareState, level: float = LEVEL) -> dict[str, np.ndarray]:
    """Return what a stream amounts to.

    Returns:
        `count`, `yes`, `lost`, `effective_size` $W^2/W_2$, `equivalent_size` that the
        interval is of, `share`, `standard_error`, `low` and `high`; share and error are
        NaN where nothing is known.
    """
    count, yes, lost, weight, weight_2, hit, hit_2 = (
        np.asarray(part) for part in state
    )
    number = np.maximum(count, 1)
    share = hit / number
    variance = np.maximum(hit_2 / number - share**2, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.where(weight_2 > 0, weight**2 / weight_2, 0.0)
        equal = share * (1 - share) * number / variance
    plain = ~np.isfinite(equal) | (equal <= 0)
    equal = np.where(plain, size, equal)
    low, high = wilson_interval(np.clip(share, 0.0, 1.0), equal, level)
    known = count > 0
    return {
        "count": count,
        "yes": yes,
        "lost": lost,
        "effective_size": size,
        "equivalent_size": equal,
        "share": np.where(known, share, np.nan),
        "standard_error": np.where(known, np.sqrt(variance / number), np.nan),
        "low": low,
        "high": high,
    }
