"""Intervals, arcs of a bearing and regions of a place from weighted draws."""

import math
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

ENDS = (0.05, 0.5, 0.95)
"""Quantiles of an estimate."""
LEVEL = 0.9
"""Share of the draws in the arcs and in the regions."""
MANY = 1000.0
"""Effective draws from which on a region is smoothed by 1.5 of its cells."""
ARC_BINS, REGION_BINS = 1440, 80
"""Cells of a turn, and along each axis of a region."""
BESIDE = 6.0
"""Standard deviations of a core within which draws belong to it: the tail of a
Student-t included."""
COMPACT = math.log(3.0)
"""Length of the longest axis of a place, in asinh of the range: far away its range is
then known within a factor of 3."""
SMALLEST_ARC, SMALLEST_REGION = 0.01, 0.03
"""Smallest shares that are reported: fewer than ten of a thousand draws."""


def quantiles(
    x: Float[np.ndarray, " draw"],
    weights: Float[np.ndarray, " draw"],
    shares: tuple[float, ...] = ENDS,
) -> Float[np.ndarray, " share"]:
    """Return quantiles of weighted draws."""
    order = np.argsort(x)
    below = np.cumsum(weights[order])
    return np.interp(shares, below - 0.5 * weights[order], x[order])


class Arc(NamedTuple):
    """An arc of bearings, clockwise.

    Attributes:
        first: Its beginning [degrees].
        last: Its end [degrees]; smaller than `first` if it crosses north.
        share: Share of the draws.
    """

    first: float
    last: float
    share: float

    @property
    def size(self) -> float:
        """Its size [degrees]."""
        return (self.last - self.first) % 360 or 360.0


def arcs(
    bearing: Float[np.ndarray, " draw"], weights: Float[np.ndarray, " draw"]
) -> tuple[Arc, ...]:
    """Return the arcs of highest density, that with the largest share first.

    The density is smoothed by a share of the spread of its narrowest part. Arcs with a
    gap below half of the smaller one are one: a source on the axis of a line.

    Args:
        bearing: Bearings [rad].
        weights: Their weights; the sum is 1.
    """
    degrees = np.degrees(bearing) % 360
    density = np.histogram(degrees, ARC_BINS, (0, 360), weights=weights)[0]
    smooth = ndimage.gaussian_filter1d(density, 5.0, mode="wrap")
    for _ in range(3):
        top = smooth.argmax() * 360 / ARC_BINS
        off = (degrees - top + 180) % 360 - 180
        near = np.abs(off) < 45
        sd = math.sqrt(np.average(off[near] ** 2, weights=weights[near] + 1e-300))
        # Silverman's rule
        width = 0.9 * sd * np.sum(weights**2) ** 0.2 * ARC_BINS / 360
        smooth = ndimage.gaussian_filter1d(density, max(0.5, width), mode="wrap")
    inside = _highest(smooth)
    if inside.all():
        return (Arc(0.0, 360.0, 1.0),)
    turn = int(np.flatnonzero(~inside)[0])
    label, count = _labelled(np.roll(inside, -turn))
    smooth = np.roll(smooth, -turn)
    found = []
    for j in range(1, count + 1):
        at = np.flatnonzero(label == j) + turn
        first, last = (x * 360 / ARC_BINS % 360 for x in (at[0], at[-1] + 1))
        found.append(Arc(first, last, float(smooth[label == j].sum() / smooth.sum())))
    found = [arc for arc in found if arc.share > SMALLEST_ARC]
    while len(found) > 1:
        gap, one, other = min(
            ((b.first - a.last) % 360 / min(a.size, b.size), i, j)
            for i, a in enumerate(found)
            for j, b in enumerate(found)
            if i != j
        )
        if gap > 0.5:
            break
        a, b = found[one], found[other]
        rest = [arc for k, arc in enumerate(found) if k not in (one, other)]
        found = [*rest, Arc(a.first, b.last, a.share + b.share)]
    return tuple(sorted(found, key=lambda arc: -arc.share))


class Region(NamedTuple):
    """A connected part of the region of highest density, and the draws about it.

    Attributes:
        share: Share of the draws.
        inside: True for its draws.
        is_place: True if it is compact.
    """

    share: float
    inside: Bool[np.ndarray, " draw"]
    is_place: bool


def regions(
    v: Float[np.ndarray, "draw 2"], weights: Float[np.ndarray, " draw"]
) -> tuple[Region, ...]:
    """Return the parts of a place, the largest share first; the last is elsewhere.

    The cores are the connected parts of the region of highest density. A draw belongs
    to the core from which it is the fewest standard deviations away, if these are fewer
    than `BESIDE`; the others are elsewhere.
    """
    ends = np.array([quantiles(x, weights, (0.002, 0.998)) for x in v.T])
    margin = 0.1 * np.ptp(ends, axis=1) + 1e-9
    low, high = ends[:, 0] - margin, ends[:, 1] + margin
    span = np.stack([low, high], 1).tolist()
    counts = np.histogram2d(*v.T, bins=REGION_BINS, range=span, weights=weights)[0]
    # few draws would leave a ridge in pieces
    effective = 1 / np.sum(weights**2)
    smooth = ndimage.gaussian_filter(counts, 1.5 * max(MANY / effective, 1) ** 0.25)
    label, count = _labelled(_highest(smooth), np.ones((3, 3)))
    held = ndimage.sum_labels(smooth, label, np.arange(1, count + 1)) / smooth.sum()
    cell = ((v - low) / (high - low) * REGION_BINS).astype(int)
    core = label[tuple(cell.clip(0, REGION_BINS - 1).T)]
    large = [j + 1 for j in np.flatnonzero(held > SMALLEST_REGION)]
    apart = np.stack([_distance(v, weights, core == j) for j in large])
    nearest = np.where(apart.min(0) < BESIDE**2, apart.argmin(0), len(large))
    parts = [(nearest == k, k < len(large)) for k in range(len(large) + 1)]
    found = []
    for inside, has_core in parts:
        share = float(weights[inside].sum())
        if share > SMALLEST_REGION:
            size = extent(v[inside], weights[inside] / share)
            found.append(Region(share, inside, has_core and size < COMPACT))
    return tuple(sorted(found, key=lambda one: -one.share))


def _distance(v, weights, core) -> Float[np.ndarray, " draw"]:
    """Return the squared distance of each draw from a core [variances]."""
    if not core.any():
        return np.full(len(v), np.inf)
    own = weights[core] / weights[core].sum()
    middle = own @ v[core]
    away = v[core] - middle
    covariance = (away * own[:, None]).T @ away
    # a core of few draws is at least as wide as the cells
    covariance += 1e-6 * (np.trace(covariance) + 1e-12) * np.eye(2)
    return np.einsum("ij,jk,ik->i", v - middle, np.linalg.inv(covariance), v - middle)


def extent(
    v: Float[np.ndarray, "draw 2"], weights: Float[np.ndarray, " draw"]
) -> float:
    """Return the length of the 90 % interval along the longest axis of a place."""
    away = v - weights @ v
    axes = np.linalg.eigh((away * weights[:, None]).T @ away)[1]
    along = [np.ptp(quantiles(x, weights, (0.05, 0.95))) for x in (away @ axes).T]
    return float(max(along))


def _labelled(inside: np.ndarray, structure: Any = None) -> tuple[np.ndarray, int]:
    """Return the connected parts of a mask by number, and how many there are."""
    found: Any = ndimage.label(inside, structure)
    return found


def _highest(density: np.ndarray) -> Bool[np.ndarray, "..."]:
    """Return the cells of highest density that hold `LEVEL` of all."""
    flat = density.ravel()
    order = np.argsort(-flat)
    held = np.searchsorted(np.cumsum(flat[order]), LEVEL * flat.sum()) + 1
    inside = np.zeros(flat.size, bool)
    inside[order[:held]] = True
    return inside.reshape(density.shape)
