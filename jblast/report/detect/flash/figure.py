"""What was seen, drawn: the fireball, how it grew, and what the test said."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from jblast.detect.flash.search import Flash, FlashDetections
from jblast.report.figure_style import (
    BLUE,
    INK,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
)

MOST = 4
"""Flashes that are drawn."""


def flash_figure(watched: FlashDetections, shape: tuple[int, int]) -> Figure:
    """Draw each flash, and the statistic below.

    Args:
        watched: What was seen.
        shape: Height and width of the image [px].
    """
    shown = watched.flashes[:MOST]
    figure = new_figure(10.0, 2.4 + 3.4 * len(shown))
    grid = figure.add_gridspec(
        len(shown) + 1, 2, height_ratios=[*([1.4] * len(shown)), 1.0]
    )
    for row, flash in enumerate(shown):
        _picture(figure.add_subplot(grid[row, 0]), flash, shape)
        _growth(figure.add_subplot(grid[row, 1]), flash)
    _statistic(figure.add_subplot(grid[-1, :]), watched)
    return figure


def _picture(axes: Axes, flash: Flash, shape: tuple[int, int]) -> None:
    height, width = shape
    extent = (-0.5, width - 0.5, height - 0.5, -0.5)
    if flash.picture is None:
        axes.set_facecolor("#cccccc")
    else:
        shown = np.clip(flash.picture, 0.0, 1.0) ** 0.45
        axes.imshow(shown, cmap="gray", vmin=0.0, vmax=1.0, extent=extent)
    grown = flash.growth
    last = flash.silhouettes[min(15, len(flash.silhouettes) - 1)]
    axes.add_patch(
        Circle((last.x_px, grown.y_px), last.radius_px, fill=False, ec=VERMILLION)
    )
    axes.plot(grown.x_px, grown.y_px, "+", color=BLUE, ms=12, mew=1.6)
    axes.set(xlim=extent[:2], ylim=extent[2:], aspect="equal", xlabel="x [px]")
    axes.set_ylabel("y [px]")
    titled(axes, f"{1e3 * (last.time_s - grown.time_s):.0f} ms after first light")


def _growth(axes: Axes, flash: Flash) -> None:
    grown = flash.growth
    time = np.array([one.time_s for one in flash.silhouettes])
    radius = np.array([one.radius_px for one in flash.silhouettes])
    cut = np.array([one.cut for one in flash.silhouettes])
    since = 1e3 * (time - grown.time_s)
    axes.plot(since[~cut], radius[~cut], "o", color=INK, ms=3)
    if cut.any():
        axes.plot(since[cut], radius[cut], "o", mfc="none", mec=MUTED, ms=3)
    if grown.radius_px is not None and grown.growth_s is not None:
        fine = np.linspace(0.0, since.max(), 200)
        law = -grown.radius_px * np.expm1(-1e-3 * fine / grown.growth_s)
        axes.plot(fine, law, color=BLUE, linewidth=1.2)
    axes.set(xlabel="since first light [ms]", ylabel="radius [px]", ylim=(0, None))
    quiet(axes)
    note = "open: cut by an edge" if cut.any() else ""
    titled(
        axes, f"first light {grown.time_s:.5f} s ± {1e3 * grown.sigma_s:.2g} ms", note
    )


def _statistic(axes: Axes, watched: FlashDetections) -> None:
    axes.plot(watched.times, watched.statistic, color=BLUE, linewidth=1.0)
    axes.axhline(watched.threshold, color=INK, linewidth=0.9, linestyle="--")
    for flash in watched.flashes:
        axes.axvline(flash.growth.time_s, color=VERMILLION, linewidth=0.9, zorder=0)
    axes.set(xlabel="time [s]", ylabel="statistic", ylim=(0, None))
    quiet(axes)
    count = len(watched.flashes)
    title = f"{count} seen" if count else "nothing seen"
    titled(axes, title, f"dashed: threshold, {watched.threshold:.1f}")
