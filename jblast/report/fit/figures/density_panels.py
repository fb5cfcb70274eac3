"""Panels of a corner plot: one number's draws as a curve, two numbers' as contours."""

from itertools import pairwise

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

from jblast.report.figure_style import BLUE

BINS = 30
SHARES = (0.9, 0.5)
"""Of the draws, inside the contours."""
FILLS = ("#cfe3f0", "#8dbfdf")
KERNEL = np.exp(-0.5 * np.arange(-4.0, 5.0) ** 2)
"""Histograms are smoothed by a normal density, one bin its standard deviation."""


def edges_of(
    draws: Float[np.ndarray, " draw"], log: bool
) -> Float[np.ndarray, " edge"]:
    """Return the edges of bins over all draws, even in ln where `log`."""
    spaced = np.geomspace if log else np.linspace
    return spaced(draws.min(), draws.max(), BINS + 1)


def draw_curve(
    axes: Axes, draws: Float[np.ndarray, " draw"], edges: Float[np.ndarray, " edge"]
) -> None:
    """Draw how dense draws are in bins.

    Args:
        axes: Where to.
        draws: Of one number.
        edges: Of the bins.
    """
    counts = _smoothed(np.histogram(draws, edges)[0].astype(float))
    axes.plot(_middles(edges), counts, color=BLUE, linewidth=1.4)
    axes.set_ylim(0.0, 1.1 * counts.max())


def draw_contours(
    axes: Axes,
    across: Float[np.ndarray, " draw"],
    along: Float[np.ndarray, " draw"],
    edges: tuple[Float[np.ndarray, " edge"], Float[np.ndarray, " edge"]],
) -> None:
    """Draw the contours that hold 50 and 90 % of the draws of two numbers.

    Args:
        axes: Where to.
        across: Draws of the number on the horizontal axis.
        along: Of the other.
        edges: Of the bins of either.
    """
    counts = _smoothed(_smoothed(np.histogram2d(across, along, edges)[0]).T)
    falling = np.sort(counts.ravel())[::-1]
    held = np.cumsum(falling) / falling.sum()
    levels = [falling[np.searchsorted(held, share)] for share in SHARES]
    levels.append(1.01 * counts.max())
    if any(low >= high for low, high in pairwise(levels)):
        return  # too few draws to tell contours apart
    # bins beyond the draws are empty, so that contours close
    padded = np.pad(counts, 1)
    grid = [_beyond(_middles(edge)) for edge in edges]
    axes.contourf(*grid, padded, levels=levels, colors=FILLS)
    axes.contour(*grid, padded, levels=levels[:-1], colors=BLUE, linewidths=1.2)


def _smoothed(counts: np.ndarray) -> np.ndarray:
    """Smooth along the last axis, mirrored at its ends."""
    half = len(KERNEL) // 2
    wide = np.pad(counts, [(0, 0)] * (counts.ndim - 1) + [(half, half)], "symmetric")
    windows = np.lib.stride_tricks.sliding_window_view(wide, len(KERNEL), axis=-1)
    return windows @ (KERNEL / KERNEL.sum())


def _middles(edges: Float[np.ndarray, " edge"]) -> Float[np.ndarray, " bin"]:
    return 0.5 * (edges[1:] + edges[:-1])


def _beyond(middles: Float[np.ndarray, " bin"]) -> Float[np.ndarray, " wider"]:
    """Return places of bins with one more on either side."""
    first, last = 2 * middles[0] - middles[1], 2 * middles[-1] - middles[-2]
    return np.array([first, *middles, last])
