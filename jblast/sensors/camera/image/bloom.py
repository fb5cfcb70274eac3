"""Bloom: a part of the light of every pixel is spread over those around it.

What a lens scatters, as three round Gaussians of equal parts. Nothing is lost: light
that would leave the picture is turned back at its edge, in place of what comes in there
from outside. Spread before the end at white, so that much of the sun or of a fire shows
around it. The widths are declared, not measured.
"""

import math

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError

WIDTHS = (0.004, 0.016, 0.064)
"""Standard deviations, over the longer side of the picture [-]."""


def bloom(
    frames: Float[np.ndarray, "*time height width 3"], part: float
) -> Float[np.ndarray, "*time height width 3"]:
    """Return frames of which a part of the light is spread.

    Args:
        frames: Linear light, not clipped.
        part: How much of the light is spread, 0 to 1; of 0 they are the same.

    Raises:
        InputError: The part is below 0 or above 1.
    """
    if not 0.0 <= part <= 1.0:
        raise InputError(f"bloom: expected a part from 0 to 1, got {part!r}")
    if part == 0.0:
        return frames
    height, width = frames.shape[-3:-1]
    spread = np.zeros_like(frames)
    for relative in WIDTHS:
        sigma = relative * max(height, width)
        rows, columns = (_spreading(size, sigma) for size in (height, width))
        wide = np.einsum(
            "ij,...jkc->...ikc", rows.astype(frames.dtype), frames, optimize=True
        )
        spread += np.einsum(
            "ij,...kjc->...kic", columns.astype(frames.dtype), wide, optimize=True
        )
    weight = frames.dtype.type(part / len(WIDTHS))
    return (1 - frames.dtype.type(part)) * frames + weight * spread


def _spreading(size: int, sigma: float) -> Float[np.ndarray, "size size"]:
    """Return the matrix that spreads a line of pixels; its columns sum to one."""
    steps = np.arange(size)
    reach = math.ceil(4 * sigma)
    tap = np.arange(-reach, reach + 1)
    weight = np.exp(-0.5 * np.square(tap / sigma))
    weight /= weight.sum()
    # past an edge it comes back: pixels stand as in a mirror, and again in another
    landed = (steps[:, None] + tap) % (2 * size)
    landed = np.where(landed < size, landed, 2 * size - 1 - landed)
    matrix = np.zeros((size, size))
    np.add.at(matrix, (landed, steps[:, None]), np.broadcast_to(weight, landed.shape))
    return matrix
