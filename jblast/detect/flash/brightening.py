"""Which pixels have just become bright, and which have fallen dark again.

A pixel's changes are gathered over some milliseconds. It is lit when that sum passes a
threshold, of the logarithm of light and of its own noise; what it was before stands
for a while in a memory, so that a lamp that flickers lights it once. What each pixel's
noise is, edges of a texture before a moving camera and lamps of the mains among it, is
learnt as the mean size of its changes.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

GATHERED = 0.6
"""Share of the sum of changes that is left after a frame."""
BRIGHTER = 0.25
"""Change of the logarithm of light that lights a pixel, at least."""
NOISES = 6.0
"""And so many times the mean size of its changes."""
LEARNT = 100.0
"""Frames over which the noise is learnt; at first the mean of all there were."""
FIRST = 2.0
"""So many frames the first guess counts as, the median of the first change."""
REMEMBERED = 60
"""Frames for which a pixel that was lit does not count again."""

Image = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]


class Brightened(NamedTuple):
    """What a frame changed.

    Attributes:
        lit: Pixels that became bright, and had not of late.
        fallen: Pixels that were bright and fell. What was not and darkens, as soot
            does before a wall, is no part of it.
        bright: Pixels that are lit now, or were a moment ago, and did not fall since.
    """

    lit: Mask
    fallen: Mask
    bright: Mask


class Brightening:
    """Follows each pixel from frame to frame."""

    def __init__(self, shape: tuple[int, int]):
        """Get ready for images of a shape."""
        self._sum = np.zeros(shape, np.float32)
        self._noise = np.zeros(shape, np.float32)
        self._left = np.zeros(shape, np.int16)
        self._bright = np.zeros(shape, bool)
        self._frames = 0

    def push(self, change: Image) -> Brightened:
        """Take in what a frame changed; return what it lit.

        Args:
            change: Of the logarithm of light, without that of the camera's motion.
        """
        size = np.abs(change)
        if not self._frames:
            self._noise += max(1.4 * float(np.median(size)), 1e-3)
        self._frames += 1
        total = self._sum
        total *= np.float32(GATHERED)
        total += change
        least = np.maximum(np.float32(NOISES) * self._noise, np.float32(BRIGHTER))
        up, down = total > least, total < -least
        lit = up & (self._left == 0)
        fallen = down & self._bright
        self._left -= self._left > 0
        self._left[up] = REMEMBERED
        self._bright |= up
        self._bright &= ~down
        self._bright &= self._left > 0
        # what just became bright teaches nothing of the noise
        size[self._left > 0] = 0.0
        np.minimum(size, 3.0 * self._noise + 0.02, out=size)
        learnt = np.float32(1.0 / min(self._frames + FIRST, LEARNT))
        self._noise += learnt * np.where(self._left > 0, 0.0, size - self._noise)
        return Brightened(lit, fallen, self._bright)
