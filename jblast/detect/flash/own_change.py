"""What changes at a pixel and not all round it: light that falls on a wall is smooth.

A lamp, lightning and a fireball's own flash light what stands about them; that light is
smooth over tens of pixels, where the edge of a fireball is sharp.
"""

import numpy as np
from jaxtyping import Float

SIDE = 17
"""Of the square that counts as round about [px]."""
MOST = 0.3
"""Changes of the logarithm are clipped to this before their mean is taken."""
FROM = 0.1
"""Where no more than `FEW` changes are as large, nothing is done."""
FEW = 20

Image = Float[np.ndarray, "height width"]


def own_change(change: Image) -> Image:
    """Return a change without the mean of what is round about.

    Args:
        change: Of the logarithm of light.
    """
    if np.count_nonzero(change > FROM) <= FEW:
        return change
    clipped = np.clip(change, np.float32(-MOST), np.float32(MOST))
    return change - _mean(_mean(clipped, 0), 1)


def _mean(image: Image, axis: int) -> Image:
    """Return the mean of `SIDE` neighbours along an axis, of fewer at the edges."""
    size = image.shape[axis]
    sums = np.insert(np.cumsum(image, axis=axis, dtype=np.float64), 0, 0.0, axis=axis)
    at = np.arange(size)
    first, last = np.maximum(at - SIDE // 2, 0), np.minimum(at + SIDE // 2 + 1, size)
    count = np.expand_dims(last - first, 1 - axis).astype(np.float32)
    total = np.take(sums, last, axis) - np.take(sums, first, axis)
    return total.astype(np.float32) / count
