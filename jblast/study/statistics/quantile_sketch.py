r"""Quantiles of a stream, from counts in bins whose edges are known beforehand.

The bins are those of a binary number itself: its sign, its exponent and the first
`BITS` digits of its fraction, as in HdrHistogram (Tene) and the log-linear histograms
of Hartmann and Schlossnagle (2020, arXiv:2001.06561). So a bin is found by a shift, no
logarithm, alike on every device, and its width is at most $2^{-7}$ of its value: the
middle is within `RELATIVE_ERROR`, 0.4 %, of all that it holds, from 9e-13 to 1.1e12 in
size. As DDSketch (Masson, Rim and Lee 2019) does, merging adds counts, which is
exact in any order; t-digest and KLL keep error in rank instead, and merge by chance.

Values that lie close together far from zero, as arrivals do, would share a bin: what is
counted is their distance from an `origin`, which `origin_of` finds from a first block.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Float, Int

BITS = 7
LEAST, MOST = -40, 40
"""Exponents of two between which sizes are told apart."""
SIDE = (MOST - LEAST) << BITS
BINS = 2 * SIDE + 1
"""Bins: below zero, the one about zero, above; the outermost hold what is beyond."""
RELATIVE_ERROR = 2.0 ** -(BITS + 1)
LAYOUTS = {"float64": (np.int64, 52, 1023), "float32": (np.int32, 23, 127)}
"""Of a binary number: the integer of its bits, digits of its fraction, bias."""


class QuantileSketch(NamedTuple):
    """Counts of a stream, an element for each outcome of a sample.

    Attributes:
        counts: Of values in each bin, or the weights of them.
        origin: What the bins are counted from, in the unit of the values.
    """

    counts: Array | np.ndarray
    origin: Float[Array | np.ndarray, "..."]


def empty_sketch(
    shape: tuple[int, ...] = (),
    origin: Float[np.ndarray, "..."] | float = 0.0,
    weighted: bool = False,
) -> QuantileSketch:
    """Return the state of no samples, in NumPy."""
    kind = float if weighted else np.int64
    origins = np.broadcast_to(np.asarray(origin, float), shape)
    return QuantileSketch(np.zeros((*shape, BINS), kind), origins)


def origin_of(
    values: Float[np.ndarray, "sample ..."],
) -> Float[np.ndarray, "..."]:
    """Return where bins should be counted from: zero, or a median far from it.

    The median is taken where nine tenths of a first block lie within a factor of two,
    of one sign.
    """
    values = np.asarray(values, float)
    known = np.where(np.isfinite(values), values, np.nan)
    flat = known.reshape(known.shape[0], -1)
    found = np.zeros(flat.shape[1])
    for lane, column in enumerate(flat.T):
        column = column[~np.isnan(column)]
        if column.size:
            low, middle, high = np.quantile(column, [0.05, 0.5, 0.95])
            if 0 < low < high < 2 * low or 2 * high < low < high < 0 or low == high:
                found[lane] = middle
    return found.reshape(known.shape[1:])


def bin_of(offset: Float[Array | np.ndarray, "..."]) -> Int[Array | np.ndarray, "..."]:
    """Return the bin of a distance from the origin; that of NaN means nothing."""
    xp = offset.__array_namespace__()
    kind, digits, bias = LAYOUTS[str(offset.dtype)]
    size = xp.abs(offset).view(kind) >> (digits - BITS)
    place = xp.clip(size - ((bias + LEAST) << BITS), -1, SIDE - 1) + 1
    return SIDE + xp.where(offset < 0, -place, place)


def sketch_of(
    values: Float[Array | np.ndarray, "sample ..."],
    weights: Float[Array | np.ndarray, " sample"] | None = None,
    origin: Float[Array | np.ndarray, "..."] | float = 0.0,
) -> QuantileSketch:
    """Count one block along its first axis; pure, in JAX where the values are of it."""
    xp = values.__array_namespace__()
    shape, lanes = values.shape[1:], int(np.prod(values.shape[1:], dtype=int))
    origins = xp.broadcast_to(xp.asarray(origin, dtype=values.dtype), shape)
    if isinstance(values, np.ndarray):
        flat = counted(values, weights, np.asarray(origins))
    else:
        bins = bin_of(values - origins[None]).reshape(-1, lanes)
        known = ~xp.isnan(values).reshape(bins.shape)
        share = 1 if weights is None else weights[:, None]
        added = xp.where(known, share, 0)
        flat = xp.zeros(lanes * BINS, added.dtype)
        flat = flat.at[bins + BINS * xp.arange(lanes)[None]].add(added)
    return QuantileSketch(flat.reshape(*shape, BINS), origins)


def counted(
    values: Float[np.ndarray, "sample ..."],
    weights: Float[Array | np.ndarray, " sample"] | None,
    origin: Float[np.ndarray, "..."],
) -> Float[np.ndarray, " bin"] | Int[np.ndarray, " bin"]:
    """Return the counts of all lanes, one behind the other, by NumPy.

    Each lane is counted by itself, so that its bins stay in the cache.
    """
    rows = values.reshape(values.shape[0], origin.size)
    given = None if weights is None else np.asarray(weights)
    found = []
    for lane, own in zip(rows.T, origin.reshape(-1), strict=True):
        offset = np.ascontiguousarray(lane - own if own else lane)
        known, shares = ~np.isnan(offset), given
        if not known.all():
            offset = offset[known]
            shares = None if given is None else given[known]
        found.append(np.bincount(counted_bin(offset), shares, minlength=BINS))
    return np.concatenate(found) if found else np.zeros(0, np.int64)


def counted_bin(offset: Float[np.ndarray, " sample"]) -> Int[np.ndarray, " sample"]:
    """Return `bin_of` in fewer passes, where nothing is negative."""
    if offset.dtype != float or not offset.size or offset.min() < 0:
        return np.asarray(bin_of(offset))
    bins = np.asarray(offset.view(np.int64) >> (52 - BITS))
    bins -= ((1023 + LEAST) << BITS) - 1
    np.clip(bins, 0, SIDE, out=bins)
    bins += SIDE
    return bins


def merge_sketches(a: QuantileSketch, b: QuantileSketch) -> QuantileSketch:
    """Add two states up.

    Raises:
        ValueError: Their bins are counted from different origins.
    """
    here = isinstance(a.origin, np.ndarray) and isinstance(b.origin, np.ndarray)
    if here and not np.array_equal(a.origin, b.origin):
        raise ValueError(
            "expected sketches of one origin to merge, got two that differ"
        )
    return QuantileSketch(a.counts + b.counts, a.origin)


def bin_edges() -> Float[np.ndarray, " edge"]:
    """Return the `BINS` + 1 edges of the bins, as distances from the origin."""
    place = np.arange(SIDE)
    size = 2.0 ** (LEAST + (place >> BITS)) * (1 + (place % 2**BITS) / 2**BITS)
    positive = np.append(size, np.inf)
    return np.concatenate([-positive[::-1], positive])


def sketch_quantiles(
    sketch: QuantileSketch,
    shares: Float[np.ndarray, " quantile"],
    minimum: Float[np.ndarray, "..."],
    maximum: Float[np.ndarray, "..."],
) -> Float[np.ndarray, "quantile ..."]:
    """Return quantiles: the rank's place within its bin, were it filled evenly.

    Args:
        sketch: Of the stream.
        shares: Of the stream that lies below, from 0 to 1.
        minimum: The stream's least value, which no quantile goes below.
        maximum: Its greatest.

    Returns:
        Each within the bin of the true one; NaN where there is no value.
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
        low = np.clip(origin + edges[held], least, most)
        high = np.clip(origin + edges[held + 1], least, most)
        upto = np.cumsum(own[held])
        rank = np.clip(np.asarray(shares) * upto[-1], 0, upto[-1])
        at = np.minimum(np.searchsorted(upto, rank), held.size - 1)
        before = upto[at] - own[held][at]
        within = (rank - before) / own[held][at]
        even = np.isfinite(low[at]) & np.isfinite(high[at])
        width = np.where(even, high[at], 0) - np.where(even, low[at], 0)
        inner = np.where(even, low[at] + within * width, high[at])
        beyond = np.where(np.isinf(high[at]), high[at], low[at])
        found[:, lane] = np.where(even, inner, beyond)
    return found.reshape(len(shares), *counts.shape[:-1])
