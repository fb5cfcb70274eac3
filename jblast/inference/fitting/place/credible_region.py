"""Where a charge may have stood, whatever shape that has: the region of most draws.

An ellipse says it where the posterior is about normal. Two clocks that disagree leave
a curve, few sensors in a row two places: there the ellipse is mostly empty, and the
region of highest density tells more. The density at a place goes as one over the
square of the distance to its k-th nearest draw (Loftsgaarden and Quesenberry, 1965),
which follows a thin curve as well as a broad heap.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from jblast.inference.fitting.place.confidence_ellipse import confidence_ellipse

NEAREST = 60
"""Draws about a place, of which the last says how dense they are: of normal draws the
area comes out 5 % too large."""
FILLED = 0.8
"""A 90 % ellipse of which the 90 % region fills less than this misleads."""
KURTOSIS = 0.5
SKEWNESS = 0.15
"""Mardia (1970): how far a normal sample of a few hundred may lie from 8, and from 0;
within them nothing more is looked at."""
SPECK = 0.01
"""A part, or a hole, of less than this share of the largest is chance."""
TRIES = 2000
GRID = 160


@dataclass(frozen=True)
class CredibleRegion:
    """Where a posterior is densest, so much that it holds a share.

    Attributes:
        share: Of the draws inside.
        parts: Its outlines, each a ring (east, north) [m], anticlockwise, the first
            place once; and the rings of the holes in it, clockwise.
    """

    share: float
    parts: tuple[
        tuple[Float[np.ndarray, "_ 2"], tuple[Float[np.ndarray, "_ 2"], ...]], ...
    ]


def credible_regions(
    east: Float[np.ndarray, " draw"],
    north: Float[np.ndarray, " draw"],
    shares: Sequence[float] = (0.5, 0.9),
) -> tuple[CredibleRegion, ...]:
    """Return regions of highest density where an ellipse would mislead, else none.

    Args:
        east: Draws of the place [m].
        north: Likewise.
        shares: Of the draws to be held, a region each.
    """
    ellipse = confidence_ellipse(east, north)
    if not ellipse.minor > 0.0:
        return ()
    turned = np.linalg.inv(ellipse.axes())
    centre = np.array([ellipse.east, ellipse.north])
    x = (np.stack([east, north], axis=-1) - centre) @ turned  # the ellipse: |x| = 1
    if _seems_normal(x):
        return ()
    sparse = _sparseness(x)
    tries = np.random.default_rng(0).uniform(-1.0, 1.0, (TRIES, 2))
    tries = tries[np.sum(tries**2, axis=1) < 1.0]
    found = sparse(x)
    if np.mean(sparse(tries) <= np.quantile(found, ellipse.share)) >= FILLED:
        return ()
    regions = []
    for share in shares:
        limit = float(np.quantile(found, share))
        inside = x[found <= limit]
        parts = _outlines(inside, sparse, limit, ellipse.axes(), centre)
        regions.append(CredibleRegion(share, parts))
    return tuple(regions)


def _seems_normal(x: Float[np.ndarray, "draw 2"]) -> bool:
    """Return whether Mardia's measures find nothing against a normal density."""
    away = x - x.mean(axis=0)
    white = away @ np.linalg.inv(np.linalg.cholesky(np.cov(away.T))).T
    kurtosis = np.mean(np.sum(white**2, axis=1) ** 2)
    # sum over i, j of (x_i . x_j)^3 is that of the squared third moments
    third = np.einsum("da,db,dc->abc", white, white, white) / len(white)
    return bool(abs(kurtosis - 8.0) < KURTOSIS and np.sum(third**2) < SKEWNESS)


def _sparseness(x: Float[np.ndarray, "draw 2"]):
    """Return a function of places: the distance to the k-th nearest draw."""
    from scipy.spatial import KDTree

    # a draw that was picked again and again says no more than once where it is
    _, times = np.unique(x, axis=0, return_counts=True)
    nearest = min(max(NEAREST, 3 * int(times.max())), len(x))
    tree = KDTree(x)
    return lambda at: tree.query(at, nearest)[0][..., -1]


def _outlines(inside, sparse, limit: float, axes, centre):
    """Return the rings about draws that are no sparser than a limit."""
    from contourpy import FillType, contour_generator

    low, high = inside.min(axis=0) - 0.3, inside.max(axis=0) + 0.3
    across, along = (np.linspace(low[k], high[k], GRID) for k in (0, 1))
    places = np.stack(np.meshgrid(across, along), axis=-1)
    field = np.log(sparse(places.reshape(-1, 2)).reshape(GRID, GRID))
    contours = contour_generator(across, along, field, fill_type=FillType.OuterOffset)
    found = []
    for points, starts in zip(*contours.filled(-np.inf, np.log(limit)), strict=True):
        rings = [points[i : j - 1] @ axes + centre for i, j in pairwise(starts)]
        found.append([_turned(ring, left=k == 0) for k, ring in enumerate(rings)])
    least = SPECK * max(_area(outer) for outer, *_ in found)
    return tuple(
        (outer, tuple(hole for hole in holes if -_area(hole) > least))
        for outer, *holes in found
        if _area(outer) > least
    )


def _turned(ring: Float[np.ndarray, "point 2"], left: bool):
    """Return a ring that runs anticlockwise (`left`), or clockwise."""
    return ring if (_area(ring) > 0.0) == left else ring[::-1]


def _area(ring: Float[np.ndarray, "point 2"]) -> float:
    """Return the area in a ring, negative where it runs clockwise."""
    x, y = (ring - ring[0]).T
    return float(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
