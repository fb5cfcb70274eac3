"""Sobol' indices as bars with their intervals."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from jblast.report.figure_style import BLUE, INK, VERMILLION, quiet, titled
from jblast.report.study.page.curve_figures import MOST_PANELS, grid_of
from jblast.report.study.page.shares import LaneShares


def share_figure(shares: Sequence[LaneShares]) -> Figure | None:
    """Draw first and total index of each number, a panel for each outcome."""
    shown = list(shares)[:MOST_PANELS]
    if not shown:
        return None
    figure, grid = grid_of(len(shown))
    for axes, one in zip(grid, shown, strict=True):
        quiet(axes)
        titled(axes, one.lane.title, f"{100 * one.indices.explained:.0f} % explained")
        place = np.arange(len(one.indices.names))
        of = one.indices
        for away, words, value, ends, colour in (
            (-0.18, "alone", of.first, of.first_interval, BLUE),
            (0.18, "with others", of.total, of.total_interval, VERMILLION),
        ):
            axes.barh(place + away, value, 0.34, color=colour, alpha=0.85, label=words)
            axes.hlines(place + away, *ends, color=INK, linewidth=1.2)
        axes.set_yticks(place, of.names)
        axes.invert_yaxis()
        axes.set_xlim(0, max(1.0, float(of.total_interval[1].max()) * 1.05))
        axes.set_xlabel("share of the variance")
    handles, words = grid[0].get_legend_handles_labels()
    figure.legend(handles, words, loc="outside lower center", ncols=2, frameon=False)
    return figure
