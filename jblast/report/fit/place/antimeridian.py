"""Areas in degrees, cut where longitudes jump from 180 to -180 (RFC 7946, 3.1.9)."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

Ring = Float[np.ndarray, "_ 2"]
"""Longitude and latitude [degree] of corners, the first one once."""
Polygon = tuple[Ring, ...]
"""An outline, anticlockwise, and its holes, clockwise."""


def without_crossing(rings: Sequence[Ring]) -> list[Polygon]:
    """Return an area as one polygon, or as two on either side of the 180th meridian.

    Args:
        rings: Its outline and holes, longitudes -180 to 180; none goes around a pole.
    """
    start = rings[0][0, 0]
    turned = [_continuous(ring, start) for ring in rings]
    low, high = turned[0][:, 0].min(), turned[0][:, 0].max()
    if low >= -180.0 and high <= 180.0:
        return [tuple(turned)]
    cut = 180.0 if high > 180.0 else -180.0
    found = []
    for side in (1.0, -1.0):
        shift = -np.sign(cut) * 360.0 if side * np.sign(cut) < 0.0 else 0.0
        kept = [_clipped(ring, cut, side) for ring in turned]
        parts = [ring + np.array([shift, 0.0]) for ring in kept if len(ring) > 2]
        if len(kept[0]) > 2:
            found.append(tuple(parts))
    return found


def _continuous(ring: Ring, start: float) -> Ring:
    """Return a ring without jumps of a turn, its first longitude nearest to one."""
    lon = np.rad2deg(np.unwrap(np.deg2rad(ring[:, 0])))
    near = 360.0 * np.round((start - lon[0]) / 360.0)
    # only what had jumped is changed: a turn there and back costs rounding
    lon = np.where(np.abs(lon - ring[:, 0]) < 1.0, ring[:, 0], lon) + near
    return np.stack([lon, ring[:, 1]], axis=-1)


def _clipped(ring: Ring, cut: float, side: float) -> Ring:
    """Return what of a ring lies below a longitude (side 1), or above it (-1).

    By Sutherland and Hodgman (1974): corners on the side, and where edges pass.
    """
    found = []
    for one, other in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        inside, then = (side * (cut - p[0]) >= 0.0 for p in (one, other))
        if inside:
            found.append(one)
        if inside != then:
            part = (cut - one[0]) / (other[0] - one[0])
            found.append(np.array([cut, one[1] + part * (other[1] - one[1])]))
    return np.array(found).reshape(-1, 2)
