"""Where yes and no are even, over two axes, and how surely."""

import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from jblast.report.figure_style import INK, MUTED, new_figure, quiet, titled
from jblast.report.study.page.columns import Lane, StudyAxis, StudyColumns
from jblast.report.study.page.curve_figures import scaled
from jblast.report.study.page.summaries import summary_of

EVEN = 0.5
MOST_PANELS = 6
LEVELS = np.linspace(0.0, 1.0, 11)
LABEL_WIDTH = 36
"""Letters of a line beside the bar of colours, which is as high as a panel."""


def contour_figure(columns: StudyColumns) -> Figure | None:
    """Draw each yes-or-no over the first two numeric axes, a panel for each word.

    The solid line is where the share is a half; between the dashed ones the 90 %
    interval of the share holds a half.
    """
    lanes = [lane for lane in columns.lanes if lane.kind == "yes_no"]
    if len(columns.numeric_axes) < 2 or not lanes:
        return None
    across, up = columns.numeric_axes[:2]
    panels = _panels(columns, lanes)[:MOST_PANELS]
    side = min(3, len(panels))
    rows = -(-len(panels) // side)
    figure = new_figure(max(7.0, 4.3 * side), 4.0 * rows + 0.4)
    grid = figure.subplots(rows, side, squeeze=False, sharex=True, sharey=True)
    for axes in grid.flat[len(panels) :]:
        axes.set_visible(False)
    drawn = None
    for axes, (lane, mask, words) in zip(grid.flat, panels, strict=False):
        quiet(axes)
        titled(axes, words)
        drawn = _panel(axes, columns, lane, mask, across, up)
        scaled(axes, across)
        scaled(axes, up, "y")
        axes.label_outer()
    assert drawn is not None, "there is a panel"
    bar = figure.colorbar(drawn, ax=list(grid.flat[: len(panels)]), shrink=0.85)
    of = f": {lanes[0].long_name or lanes[0].name}" if len(lanes) == 1 else " of yes"
    bar.set_label(textwrap.fill(f"share{of}", LABEL_WIDTH), color=INK)
    bar.outline.set_visible(False)
    handles = [
        Line2D([], [], color=INK, linewidth=1.8, label="50 %"),
        Line2D([], [], color=INK, linewidth=1.0, linestyle="--", label="90 % interval"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
    return figure


def _panels(
    columns: StudyColumns, lanes: Sequence[Lane]
) -> list[tuple[Lane, np.ndarray, str]]:
    """Return lanes and samples of each panel, and its title."""
    words = columns.word_axes
    everything = np.ones(columns.samples, bool)
    if not words:
        return [(lane, everything, lane.title) for lane in lanes]
    axis = words[0]
    several = len(lanes) > 1
    return [
        (
            lane,
            axis.at == n,
            f"{axis.said(n)}, {lane.title}" if several else axis.said(n),
        )
        for lane in lanes
        for n in range(axis.values.size)
    ]


def shares_on_grid(
    columns: StudyColumns,
    lane: Lane,
    mask: np.ndarray,
    across: StudyAxis,
    up: StudyAxis,
) -> np.ndarray:
    """Return share, low and high of each cell: by name, by `up`, by `across`."""
    found = np.full((3, up.values.size, across.values.size), np.nan)
    for i in range(across.values.size):
        for j in range(up.values.size):
            own = mask & (across.at == i) & (up.at == j)
            if own.any():
                of = summary_of(columns, lane, own).found
                found[:, j, i] = of["share"], of["low"], of["high"]
    return found


def _panel(
    axes: Axes,
    columns: StudyColumns,
    lane: Lane,
    mask: np.ndarray,
    across: StudyAxis,
    up: StudyAxis,
):
    shares = shares_on_grid(columns, lane, mask, across, up)
    x, y = across.values, up.values
    drawn = axes.contourf(x, y, shares[0], LEVELS, cmap="Blues", alpha=0.9)
    for values, width, style in (
        (shares[0], 1.8, "solid"),
        (shares[1], 1.0, "dashed"),
        (shares[2], 1.0, "dashed"),
    ):
        if np.nanmin(values) < EVEN < np.nanmax(values):
            axes.contour(
                x, y, values, [EVEN], colors=INK, linewidths=width, linestyles=style
            )
    if not np.nanmin(shares[0]) < EVEN < np.nanmax(shares[0]):
        which = "above" if np.nanmin(shares[0]) >= EVEN else "below"
        axes.annotate(
            f"{which} 50 % everywhere",
            (0.03, 0.03),
            xycoords="axes fraction",
            fontsize=8,
            color=MUTED,
        )
    return drawn
