"""The frames about an alarm, measured: the silhouettes of a fireball.

What the scene shows without it is the median of the frames before; a pixel shines by as
much as it is on the way from there to the light of the fireball itself.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from jblast.detect.flash.silhouette import Silhouette, silhouette

Frames = Float[np.ndarray, "frame height width"]
BEFORE = 8
"""Frames that tell the scene without it, at most."""
BRIGHT = 0.5
"""Quantile of the light of what became bright that is the fireball's own."""


def silhouettes(
    times: Float[np.ndarray, " frame"],
    light: Frames,
    begun: int,
    seed: Bool[np.ndarray, "height width"],
) -> tuple[list[Silhouette], float]:
    """Return the silhouettes of a fireball, and the last instant without it [s].

    Args:
        times: Of the frames [s].
        light: Linear light, full scale 1.
        begun: Number of the frame that shows it first, or one nearby.
        seed: Where pixels were lit.
    """
    quiet = max(begun - 2, 1)
    behind = np.median(light[max(quiet - BEFORE, 0) : quiet], axis=0)
    rise = light[quiet:] - behind
    peak = float(np.quantile(rise.max(axis=0)[seed], BRIGHT)) if seed.any() else 0.0
    if peak <= 0.0:
        return [], float(times[quiet - 1])
    full = behind + peak
    shares = np.clip(rise / np.maximum(full - behind, 1e-6), 0.0, 1.0)
    return joined(times[quiet:], shares, seed, float(times[quiet - 1]))


def joined(
    times: Float[np.ndarray, " frame"],
    shares: Frames,
    seed: Bool[np.ndarray, "height width"],
    before: float,
) -> tuple[list[Silhouette], float]:
    """Return the silhouettes from the first frame that has one, without a gap.

    Args:
        times: Of the frames [s].
        shares: How much of each pixel shines.
        seed: Where it is.
        before: The instant before the first of them [s].
    """
    seen: list[Silhouette] = []
    for time, share in zip(times, shares, strict=True):
        one = silhouette(float(time), share, seed)
        if one is None:
            if len(seen) >= 3:
                break  # it is over, or hidden
            seen, before = [], float(time)
        else:
            seen.append(one)
    return seen, before


def seed_of(
    lit: Sequence[Bool[np.ndarray, "height width"]], box: tuple[int, int, int, int]
) -> Bool[np.ndarray, "height width"]:
    """Return where pixels were lit in a tile.

    Args:
        lit: Of each frame since the evidence began.
        box: The tile: left, top, right, bottom [px].
    """
    left, top, right, bottom = box
    out = np.zeros_like(lit[0])
    inside = np.logical_or.reduce([one[top:bottom, left:right] for one in lit])
    out[top:bottom, left:right] = inside
    return out
