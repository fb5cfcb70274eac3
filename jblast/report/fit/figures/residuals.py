"""The residuals against range: what the law leaves over, in standard deviations."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.inference.fitting.result import Fit
from jblast.quantities import TIMED
from jblast.report.figure_style import (
    COLOURS,
    INK,
    MARKERS,
    MUTED,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.report.fit.figures.reduced_time import common_clock
from jblast.report.fit.rows import outlier_rows
from jblast.report.numbers import unit_for
from jblast.report.words import quantity_words


def residuals_figure(fit: Fit) -> Figure:
    """Draw residuals in sds, one colour and marker a quantity, with lines at 2 sd.

    Radii at a time have a panel of their own, against time.
    """
    quantities = list(dict.fromkeys(fit.observations.quantity))
    ranged = [q for q in quantities if q not in TIMED]
    timed = [q for q in quantities if q in TIMED]
    panels = [panel for panel in (ranged, timed) if panel]
    figure = new_figure(7.2, 3.6 * len(panels))
    for i, panel in enumerate(panels):
        _panel(figure.add_subplot(len(panels), 1, i + 1), fit, panel, quantities)
    return figure


def _panel(axes: Axes, fit: Fit, panel: list[str], quantities: list[str]) -> None:
    table = fit.observations
    against_time = panel[0] in TIMED
    along = fit.distance
    if against_time:
        along = table.time - common_clock(fit) - fit.origin_time
    here = np.array([q in panel for q in table.quantity])
    here &= np.isfinite(along) & np.isfinite(fit.residual)
    unit = unit_for("_s" if against_time else "_m", *map(float, along[here]))
    axes.axhspan(-2, 2, color="#f3f3f3", linewidth=0, zorder=0)
    axes.axhline(0.0, color=MUTED, linewidth=1.0)
    for level in (-2, 2):
        axes.axhline(level, color=MUTED, linewidth=1.0, linestyle=(0, (4, 3)))
    for quantity in panel:
        i = quantities.index(quantity)
        rows = here & np.array([q == quantity for q in table.quantity])
        colour, bounds = COLOURS[i % len(COLOURS)], table.bounds()
        axes.plot(
            along[rows & ~bounds] / unit.size,
            fit.residual[rows & ~bounds],
            linestyle="none",
            marker=MARKERS[i % len(MARKERS)],
            color=colour,
            markersize=6,
            markeredgecolor="white",
            markeredgewidth=0.6,
            label=quantity_words(quantity),
        )
        axes.plot(
            along[rows & bounds] / unit.size,
            fit.residual[rows & bounds],
            linestyle="none",
            marker="^",
            markersize=7,
            markerfacecolor="white",
            markeredgecolor=colour,
        )
    for row in outlier_rows(fit):
        if here[row]:
            x, y = float(along[row]) / unit.size, float(fit.residual[row])
            _name(axes, x, y, table.sensor[row])
    quiet(axes)
    axes.grid(False, axis="y")
    if np.any(here) and np.all(along[here] > 0.0):
        axes.set_xscale("log")
        log_ticks(axes.xaxis, axes.get_xlim())
    bottom, top = axes.get_ylim()
    axes.set_ylim(min(bottom, -3.2), max(top, 3.2))
    axes.set_ylabel("residual (sd)")
    words = "time after detonation" if against_time else "slant range"
    axes.set_xlabel(f"{words} ({unit.symbol})")
    open_ones = "; open: lower bounds, at 0 where the law keeps them"
    has_bounds = bool(np.any(table.bounds() & here))
    titled(axes, "Measured minus law", f"shaded: ± 2 sd{open_ones * has_bounds}")
    if not np.any(here):
        axes.text(0.5, 0.6, "no residuals", transform=axes.transAxes, ha="center")
    elif len(quantities) > 1:
        axes.legend(
            loc="upper center",
            bbox_to_anchor=(0.5, -0.18),
            ncols=min(len(panel), 4),
            frameon=False,
            fontsize=9,
            labelcolor=INK,
            handletextpad=0.2,
        )


def _name(axes: Axes, x: float, y: float, name: str) -> None:
    axes.plot(
        x, y, "o", markersize=13, markerfacecolor="none", markeredgecolor=INK
    )  # fmt: skip
    axes.annotate(
        name if len(name) <= 24 else name[:23] + "…",
        (x, y),
        xytext=(11, 0),
        textcoords="offset points",
        va="center",
        fontsize=9,
        color=INK,
        parse_math=False,
    )
