r"""Where the burst stands in a picture, and how much of the world a picture holds.

Cameras are level and look at the burst. A view at elevation $e$ has it at the share

$$a(e) = \tfrac12 + 0.36 \cos e$$

of its height from the top: low from the side, for what rises has to have its room, and
in the middle from above. A frame holds what reaches $\rho$ outwards and $z$ upwards if
its side is at least

$$s \ge \max\left(2 \rho, \frac{z \cos e + \rho \sin e}{a}, \frac{\rho \sin e}{1 - a}
\right)$$

for every elevation; the first frames are held a little smaller than that would make
them, for the simulation's cells would show.
"""

import math

import numpy as np
from jaxtyping import Float

LOWEST = 0.36
"""How far below the middle the burst is seen from the side, as part of the side [-]."""

ROOM = 1.04
"""Side of a picture over the least that holds the cloud [-]."""

SMALLEST = 0.4
"""Least side of a picture, as part of the greatest of the set [-]."""


def anchor_share(elevation_deg: float) -> float:
    """Return how far down a picture the burst is, from 0 at the top to 1 [-]."""
    return 0.5 + LOWEST * math.cos(math.radians(elevation_deg))


def anchor_px(elevation_deg: float, size: int) -> tuple[float, float]:
    """Return where the burst is [px]: right and down from the first pixel's middle."""
    return size / 2 - 0.5, anchor_share(elevation_deg) * size - 0.5


def picture_sides(
    reach: Float[np.ndarray, " frame"],
    top: Float[np.ndarray, " frame"],
    elevation_deg: Float[np.ndarray, " view"],
) -> Float[np.ndarray, " frame"]:
    """Return the side of each frame, alike for all views, never less than before [m].

    Args:
        reach: How far the cloud is from the axis at most [m].
        top: How high it is at most [m].
        elevation_deg: Of the views.
    """
    angle = np.radians(elevation_deg)[:, None]
    share = 0.5 + LOWEST * np.cos(angle)
    above = (top * np.cos(angle) + reach * np.sin(angle)) / share
    below = reach * np.sin(angle) / (1.0 - share)
    least = np.maximum(2.0 * reach, np.maximum(above, below).max(axis=0))
    sides = ROOM * np.maximum(least, SMALLEST * least.max())
    return np.maximum.accumulate(sides)
