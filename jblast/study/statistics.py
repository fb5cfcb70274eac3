r"""Statistics of a stream: additive in blocks, merged in the order of the samples.

Moments. A block is reduced in two passes, its mean and then the squares about it; two
states are merged by the rule of Chan, Golub and LeVeque (1983, eq. 1.5; Welford 1962
for one),

$$m = m_a + \delta\,n_b/n, \qquad M_2 = M_{2a} + M_{2b} + \delta^2\,n_a n_b/n,$$

with $\delta = m_b - m_a$ and $M_2 = \sum (x-m)^2$.

Quantiles are computed from counts in fixed bins. The bins are those of a binary number
itself: its sign, its exponent and the first `BITS` digits of its fraction, as in
HdrHistogram (Tene) and the log-linear histograms of Hartmann and Schlossnagle (2020,
arXiv:2001.06561). A bin is found by a shift, without a logarithm, alike on every
device, and its width is at most $2^{-7}$ of its value: the middle is within
`RELATIVE_ERROR`, 0.4 %, of all values in it, from 9e-13 to 1.1e12 in size. As in
DDSketch (Masson, Rim and Lee 2019), merging adds counts, which is exact in any order;
t-digest and KLL bound the error in rank instead, and their merges depend on chance.
Values that lie close together far from zero, such as arrivals, would share a bin.
Therefore the distance from an `origin` is counted, which `origin_of` finds from a first
block.

Shares. The interval of a share $p$ of $n$ samples is Wilson's (1927),

$$\frac{p + z^2/2n \pm z\sqrt{p(1-p)/n + z^2/4n^2}}{1 + z^2/n}.$$
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np
from jaxtyping import Array, ArrayLike, Float, Int

# A state is a NamedTuple of arrays, of one class for each kind.
AnyState = Any
LEVEL = 0.90
"""Default probability of an interval."""
UNKNOWN = -1
"""Value of a yes-or-no outcome whose sample failed."""
BLOCK = 8192
"""Samples reduced together. Streams that are cut at multiples of it end in the same
state to the last bit, because sums are then rounded in the same order."""
SLAB = 16 * BLOCK
"""Values counted together: counts are exact in any order, so that the size is free."""
QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
"""Default quantiles: the median, and the bounds of 50 %, 90 % and 98 % of samples."""
State = TypeVar("State")
BITS = 7
"""Binary digits of the fraction that select a bin: 128 bins to a factor of two."""
MIN_EXPONENT, MAX_EXPONENT = -40, 40
"""Exponents of two of the bins, 9e-13 to 1.1e12: beyond any quantity of a study in
SI."""
SIDE = (MAX_EXPONENT - MIN_EXPONENT) << BITS
"""Number of bins of one sign."""
BINS = 2 * SIDE + 1
"""Number of bins: negative, around zero, positive; the outermost are unbounded."""
# half a bin, relative to its lower bound
RELATIVE_ERROR = 2.0 ** -(BITS + 1)
LAYOUTS = {"float64": (np.int64, 52, 1023), "float32": (np.int32, 23, 127)}
"""Layout of floats (IEEE 754): integer type, digits of the fraction, exponent bias."""


@dataclass(frozen=True)
class Accumulator:
    """Reduction of a stream of one kind to a state of fixed size.

    Attributes:
        empty: State without samples, from the shape of an outcome and the origin of its
            bins.
        of: State of one block, from values and a state with the origin; a pure
            function, in JAX if the values are JAX arrays.
        merge: State of two consecutive states.
        finish: Statistics of a state, in NumPy.
        in_slabs: Faster equivalent of `merge` and `of`.
    """

    empty: Callable[..., AnyState]
    of: Callable[..., AnyState]
    merge: Callable[[AnyState, AnyState], AnyState]
    finish: Callable[..., dict[str, np.ndarray]]
    in_slabs: Callable[[AnyState, np.ndarray], AnyState] | None = None

    def add(self, state: AnyState, values: Array | np.ndarray) -> AnyState:
        """Return the state with more samples, in NumPy, block after block.

        Args:
            state: State so far.
            values: Samples along the first axis; NaN (yes or no: -1) of a failed one.
        """
        array = np.asarray(values)
        if self.in_slabs is not None:
            return self.in_slabs(state, array)
        for part in blocks(array.shape[0]):
            state = self.merge(state, self.of(array[part], state))
        return state


class Moments(NamedTuple):
    """Moments of a stream, one element for each outcome of a sample.

    Attributes:
        finite: Number of finite values.
        infinite: Number of infinite values, which count for the extremes only.
        lost: Number of failed samples (NaN).
        mean: Mean of the finite values.
        squares: Sum of squares about the mean.
        minimum: Smallest value, infinite without values.
        maximum: Largest value, minus infinity without values.
    """

    finite: Int[Array | np.ndarray, "..."]
    infinite: Int[Array | np.ndarray, "..."]
    lost: Int[Array | np.ndarray, "..."]
    mean: Float[Array | np.ndarray, "..."]
    squares: Float[Array | np.ndarray, "..."]
    minimum: Float[Array | np.ndarray, "..."]
    maximum: Float[Array | np.ndarray, "..."]


class QuantileSketch(NamedTuple):
    """Histogram of a stream, one element for each outcome of a sample.

    Attributes:
        counts: Number of values in each bin.
        origin: Origin of the bins, in the unit of the values.
    """

    counts: Array | np.ndarray
    origin: Float[Array | np.ndarray, "..."]


class NumberState(NamedTuple):
    """State of a stream of numbers."""

    moments: Moments
    sketch: QuantileSketch


def empty_number(
    shape: tuple[int, ...] = (),
    origin: Float[np.ndarray, "..."] | float = 0.0,
) -> NumberState:
    """Return the state without samples; `origin` is that of `origin_of`."""
    return NumberState(empty_moments(shape), empty_sketch(shape, origin))


def finish_number(
    state: NumberState, quantiles: tuple[float, ...] = QUANTILES
) -> dict[str, np.ndarray]:
    """Return `finish_moments` with `quantiles`, whose first axis is the quantile."""
    found = finish_moments(state.moments)
    found["quantiles"] = sketch_quantiles(
        state.sketch, np.asarray(quantiles), found["minimum"], found["maximum"]
    )
    return found


def merge_numbers(a: NumberState, b: NumberState) -> NumberState:
    """Return the state of two states, `a` before `b` in the order of the samples."""
    return NumberState(
        merge_moments(a.moments, b.moments), merge_sketches(a.sketch, b.sketch)
    )


def number_of(
    values: Float[Array | np.ndarray, "sample ..."],
    like: NumberState | None = None,
) -> NumberState:
    """Return the state of one block, with the origin of the state `like`."""
    origin = 0.0 if like is None else like.sketch.origin
    return NumberState(moments_of(values), sketch_of(values, origin))


def numbers_in_slabs(
    state: NumberState, values: Float[np.ndarray, "sample ..."]
) -> NumberState:
    """Return the state with more samples.

    Moments are reduced by blocks, and counts by slabs of blocks.
    """
    moments, sketch = state
    for part in blocks(len(values)):
        moments = merge_moments(moments, moments_of(values[part]))
    for part in blocks(len(values), SLAB):
        sketch = merge_sketches(sketch, sketch_of(values[part], sketch.origin))
    return NumberState(moments, sketch)


NUMBER = Accumulator(
    empty_number, number_of, merge_numbers, finish_number, numbers_in_slabs
)


class ShareState(NamedTuple):
    """State of a stream of yes and no, one element for each outcome.

    Attributes:
        known: Number of samples that did not fail.
        yes: Number of samples with the outcome.
        lost: Number of failed samples (`UNKNOWN`).
    """

    known: Int[Array | np.ndarray, "..."]
    yes: Int[Array | np.ndarray, "..."]
    lost: Int[Array | np.ndarray, "..."]


def empty_share(shape: tuple[int, ...] = (), origin: object = 0.0) -> ShareState:
    """Return the state without samples; `origin` has no effect."""
    none = np.zeros(shape, np.int64)
    return ShareState(none, none, none)


def finish_share(state: ShareState, level: float = LEVEL) -> dict[str, np.ndarray]:
    """Return the statistics of a stream of yes and no.

    Returns:
        `count`, `yes`, `lost`, `share`, `standard_error`, `low` and `high`; share and
        error are NaN without known samples.
    """
    count, yes, lost = (np.asarray(part) for part in state)
    number = np.maximum(count, 1)
    share = yes / number
    low, high = wilson_interval(share, count, level)
    known = count > 0
    return {
        "count": count,
        "yes": yes,
        "lost": lost,
        "share": np.where(known, share, np.nan),
        "standard_error": np.where(
            known, np.sqrt(share * (1 - share) / number), np.nan
        ),
        "low": low,
        "high": high,
    }


def merge_shares(a: ShareState, b: ShareState) -> ShareState:
    """Return the sum of two states."""
    return ShareState(*(one + other for one, other in zip(a, b, strict=True)))


def share_of(values: Array | np.ndarray, like: ShareState | None = None) -> ShareState:
    """Return the state of one block along its first axis, in JAX or NumPy.

    Args:
        values: Integers or flags: positive is yes, negative a failed sample.
        like: Without effect.
    """
    xp = values.__array_namespace__()
    lost = xp.zeros(values.shape, bool) if values.dtype == bool else values < 0
    yes = values if values.dtype == bool else values > 0
    return ShareState(*(xp.sum(one, axis=0) for one in (~lost, yes, lost)))


YES_NO = Accumulator(empty_share, share_of, merge_shares, finish_share)
ACCUMULATORS = {"number": NUMBER, "yes_no": YES_NO}
"""Accumulator by `kind` of an outcome."""


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


def blocks(count: int, size: int = BLOCK) -> list[slice]:
    """Return the slices of `size` samples that cover a count."""
    return [slice(at, min(at + size, count)) for at in range(0, count, size)]


def fold(
    state: State, others: list[State], merge: Callable[[State, State], State]
) -> State:
    """Return the state of all states, merged in their order."""
    for other in others:
        state = merge(state, other)
    return state


def empty_sketch(
    shape: tuple[int, ...] = (),
    origin: Float[np.ndarray, "..."] | float = 0.0,
) -> QuantileSketch:
    """Return the histogram without samples, in NumPy."""
    # integer counts are exact in any order of merging
    origins = np.broadcast_to(np.asarray(origin, float), shape)
    return QuantileSketch(np.zeros((*shape, BINS), np.int64), origins)


def origin_of(
    values: Float[np.ndarray, "sample ..."],
) -> Float[np.ndarray, "..."]:
    """Return the origin of the bins: zero, or the median of a first block.

    It is the median if 90 % of the block have one sign and lie within a factor of two.
    """
    values = np.asarray(values, float)
    known = np.where(np.isfinite(values), values, np.nan)
    flat = known.reshape(known.shape[0], -1)
    found = np.zeros(flat.shape[1])
    for lane, column in enumerate(flat.T):
        column = column[~np.isnan(column)]
        if column.size:
            low, middle, high = np.quantile(column, [0.05, 0.5, 0.95])
            # bins are fine enough unless the values are far from zero compared with
            # their spread
            if 0 < low < high < 2 * low or 2 * high < low < high < 0 or low == high:
                found[lane] = middle
    return found.reshape(known.shape[1:])


def bin_of(offset: Float[Array | np.ndarray, "..."]) -> Int[Array | np.ndarray, "..."]:
    """Return the bin of a distance from the origin; the bin of NaN is meaningless."""
    xp = offset.__array_namespace__()
    kind, digits, bias = LAYOUTS[str(offset.dtype)]
    # exponent and first digits of a binary number form a nearly logarithmic scale: a
    # shift replaces the logarithm, and is the same on every device
    size = xp.abs(offset).view(kind) >> (digits - BITS)
    # below 2^MIN_EXPONENT both signs share the middle bin, place 0
    place = xp.clip(size - ((bias + MIN_EXPONENT) << BITS), -1, SIDE - 1) + 1
    return SIDE + xp.where(offset < 0, -place, place)


def sketch_of(
    values: Float[Array | np.ndarray, "sample ..."],
    origin: Float[Array | np.ndarray, "..."] | float = 0.0,
) -> QuantileSketch:
    """Return the histogram of one block along its first axis, in JAX or NumPy."""
    xp = values.__array_namespace__()
    shape, lanes = values.shape[1:], int(np.prod(values.shape[1:], dtype=int))
    origins = xp.broadcast_to(xp.asarray(origin, dtype=values.dtype), shape)
    if isinstance(values, np.ndarray):
        flat = counted(values, np.asarray(origins))
    else:
        bins = bin_of(values - origins[None]).reshape(-1, lanes)
        known = ~xp.isnan(values).reshape(bins.shape)
        added = xp.where(known, 1, 0)
        flat = xp.zeros(lanes * BINS, added.dtype)
        # one scatter over all lanes, whose bins follow one another
        flat = flat.at[bins + BINS * xp.arange(lanes)[None]].add(added)
    return QuantileSketch(flat.reshape(*shape, BINS), origins)


def counted(
    values: Float[np.ndarray, "sample ..."],
    origin: Float[np.ndarray, "..."],
) -> Int[np.ndarray, " bin"]:
    """Return the concatenated counts of all lanes, in NumPy.

    Each lane is counted separately, so that its bins stay in the cache.
    """
    rows = values.reshape(values.shape[0], origin.size)
    found = []
    for lane, own in zip(rows.T, origin.reshape(-1), strict=True):
        # `counted_bin` views the values as integers, which needs contiguous memory
        offset = np.ascontiguousarray(lane - own if own else lane)
        known = ~np.isnan(offset)
        if not known.all():
            offset = offset[known]
        found.append(np.bincount(counted_bin(offset), minlength=BINS))
    return np.concatenate(found) if found else np.zeros(0, np.int64)


def counted_bin(offset: Float[np.ndarray, " sample"]) -> Int[np.ndarray, " sample"]:
    """Return `bin_of`, in fewer passes over the memory if no value is negative."""
    if offset.dtype != float or not offset.size or offset.min() < 0:
        return np.asarray(bin_of(offset))
    # the sign bit is 0, except of -0.0: the clip moves that to the middle bin
    bins = np.asarray(offset.view(np.int64) >> (52 - BITS))
    bins -= ((1023 + MIN_EXPONENT) << BITS) - 1
    np.clip(bins, 0, SIDE, out=bins)
    bins += SIDE
    return bins


def merge_sketches(a: QuantileSketch, b: QuantileSketch) -> QuantileSketch:
    """Return the sum of two states.

    Raises:
        ValueError: Their bins have different origins.
    """
    # traced origins have no values to compare
    here = isinstance(a.origin, np.ndarray) and isinstance(b.origin, np.ndarray)
    if here and not np.array_equal(a.origin, b.origin):
        raise ValueError(
            f"expected sketches of one origin to merge, got {a.origin} and {b.origin}"
        )
    return QuantileSketch(a.counts + b.counts, a.origin)


def bin_edges() -> Float[np.ndarray, " edge"]:
    """Return the `BINS` + 1 edges of the bins, as distances from the origin."""
    place = np.arange(SIDE)
    size = 2.0 ** (MIN_EXPONENT + (place >> BITS)) * (1 + (place % 2**BITS) / 2**BITS)
    positive = np.append(size, np.inf)
    return np.concatenate([-positive[::-1], positive])


def sketch_quantiles(
    sketch: QuantileSketch,
    shares: Float[np.ndarray, " quantile"],
    minimum: Float[np.ndarray, "..."],
    maximum: Float[np.ndarray, "..."],
) -> Float[np.ndarray, "quantile ..."]:
    """Return quantiles, by linear interpolation within a bin.

    Args:
        sketch: Histogram of the stream.
        shares: Probabilities of the quantiles, 0 to 1.
        minimum: Smallest value of the stream, the lower limit of quantiles.
        maximum: Largest value of the stream, their upper limit.

    Returns:
        Quantiles, each in the bin of the exact one; NaN without values.
    """
    counts = np.asarray(sketch.counts)
    lanes = counts.reshape(-1, BINS)
    edges = bin_edges()
    found = np.full((len(shares), lanes.shape[0]), np.nan)
    parts = (np.asarray(one).reshape(-1) for one in (sketch.origin, minimum, maximum))
    for lane, (own, origin, least, most) in enumerate(zip(lanes, *parts, strict=True)):
        held = np.flatnonzero(own)
        if not held.size:
            continue
        # the extremes are exact: they bound the first and last bin, and the unbounded
        # ones
        low = np.clip(origin + edges[held], least, most)
        high = np.clip(origin + edges[held + 1], least, most)
        upto = np.cumsum(own[held])
        rank = np.clip(np.asarray(shares) * upto[-1], 0, upto[-1])
        at = np.searchsorted(upto, rank)
        before = upto[at] - own[held][at]
        within = (rank - before) / own[held][at]
        even = np.isfinite(low[at]) & np.isfinite(high[at])
        # zeros in place of infinite bounds, whose difference would be NaN with a
        # warning
        width = np.where(even, high[at], 0) - np.where(even, low[at], 0)
        inner = np.where(even, low[at] + within * width, high[at])
        beyond = np.where(np.isinf(high[at]), high[at], low[at])
        found[:, lane] = np.where(even, inner, beyond)
    return found.reshape(len(shares), *counts.shape[:-1])


def empty_moments(shape: tuple[int, ...] = ()) -> Moments:
    """Return the moments without samples, in NumPy."""
    none, zero = np.zeros(shape, np.int64), np.zeros(shape)
    far = np.full(shape, np.inf)
    return Moments(none, none, none, zero, zero, far, -far)


def moments_of(values: Float[Array | np.ndarray, "sample ..."]) -> Moments:
    """Return the moments of one block along its first axis, in JAX or NumPy.

    Args:
        values: Samples; NaN for failed ones.
    """
    xp = values.__array_namespace__()
    # the usual case on the host: no masks, and fewer passes over the values
    if isinstance(values, np.ndarray) and np.isfinite(values).all():
        return plain_moments(values)
    finite, nan = xp.isfinite(values), xp.isnan(values)
    known, count = xp.where(finite, values, 0), xp.sum(finite, axis=0)
    mean = xp.sum(known, axis=0) / xp.maximum(count, 1).astype(values.dtype)
    return Moments(
        count,
        xp.sum(~finite & ~nan, axis=0),
        xp.sum(nan, axis=0),
        mean,
        xp.sum(xp.where(finite, known - mean[None], 0) ** 2, axis=0),
        xp.min(xp.where(nan, xp.inf, values), axis=0, initial=xp.inf),
        xp.max(xp.where(nan, -xp.inf, values), axis=0, initial=-xp.inf),
    )


def plain_moments(values: Float[np.ndarray, "sample ..."]) -> Moments:
    """Return the moments of finite values, faster and in NumPy."""
    size, shape = values.shape[0], values.shape[1:]
    if not size:
        return empty_moments(shape)
    values = np.asarray(values, float)
    mean = values.sum(axis=0) / size
    off = values - mean
    # in place: no further array of the size of the block
    squares = np.square(off, out=off).sum(axis=0)
    none = np.zeros(shape, np.int64)
    low, high = values.min(axis=0), values.max(axis=0)
    return Moments(none + size, none, none, mean, squares, low, high)


def merge_moments(a: Moments, b: Moments) -> Moments:
    """Return the state of two states, `a` before `b` in the order of the samples."""
    xp = a.mean.__array_namespace__()
    one, other = (x.finite.astype(x.mean.dtype) for x in (a, b))
    # the maximum guards the division for two empty states
    share = other / xp.maximum(one + other, 1)
    step = b.mean - a.mean
    return Moments(
        a.finite + b.finite,
        a.infinite + b.infinite,
        a.lost + b.lost,
        a.mean + step * share,
        # Chan, Golub and LeVeque (1983): sums of squares about zero would cancel
        a.squares + b.squares + step**2 * one * share,
        xp.minimum(a.minimum, b.minimum),
        xp.maximum(a.maximum, b.maximum),
    )


def finish_moments(state: Moments) -> dict[str, np.ndarray]:
    r"""Return the statistics of a stream; NaN for those that need more values.

    `variance` is $M_2/(n-1)$; the squared `standard_error` of the mean is the variance
    over $n$.

    Returns:
        `count`, `infinite`, `lost`, `mean`, `standard_error`, `variance`, `sd`,
        `minimum`, `maximum`. The statistics from mean to sd are of the finite values.
    """
    count, infinite, lost, mean, squares, low, high = (np.asarray(x) for x in state)
    # a single value has no variance
    free = np.where(count > 1, count - 1.0, np.nan)
    variance = squares / free
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
