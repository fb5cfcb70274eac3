"""A picked record drawn: samples, fitted pulse, residual, and what was picked."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.inference.picks import RecordPick
from jblast.report.figure_style import (
    BLUE,
    COLOURS,
    DPI,
    INK,
    MUTED,
    VERMILLION,
    quiet,
    titled,
)
from jblast.report.numbers import Unit, unit_for
from jblast.report.picks.curves import Curve, curves
from jblast.report.picks.text import estimate_words

MOST = 24
"""Records of one picture."""
COLUMNS = 2
NEAR = 1e-3
"""A sample within this share of where a record clips is clipped."""
UNSCALED = Unit("sample", 1.0)


def records_figure(names: Sequence[str], picks: Sequence[RecordPick]) -> Figure:
    """Draw picks, each record above its residual, two beside each other.

    Args:
        names: What to call each.
        picks: They keep their samples; the first `MOST` are drawn.
    """
    shown = picks[:MOST]
    rows = -(-len(shown) // COLUMNS)
    columns = min(COLUMNS, len(shown))
    width, height = 5.4 * columns, 0.5 + 2.9 * rows
    # a grid that is known needs no constrained layout, which would take seconds
    figure = Figure(figsize=(width, height), dpi=DPI)
    outer = figure.add_gridspec(
        rows,
        columns,
        left=0.75 / width,
        right=1 - 0.15 / width,
        bottom=0.6 / height,
        top=1 - 0.35 / height,
        wspace=0.2,
        hspace=0.24,
    )
    made = zip(names, shown, curves(shown), strict=False)
    for nth, (name, one, curve) in enumerate(made):
        row, column = divmod(nth, columns)
        inner = outer[row, column].subgridspec(2, 1, height_ratios=[2.6, 1], hspace=0.1)
        above, below = (figure.add_subplot(part) for part in inner)
        _draw(above, below, name, one, curve)
        if nth + columns >= len(shown):
            below.set_xlabel("time [s]")
    if len(picks) > MOST:
        figure.supxlabel(f"{len(picks) - MOST} more are not drawn", fontsize=9)
    return figure


def _draw(above: Axes, below: Axes, name: str, one: RecordPick, curve: Curve) -> None:
    """Draw one record."""
    unit, alone = UNSCALED, "onset_alone" in one.notes
    if one.record.calibrated:
        largest = np.abs([curve.low, curve.high]).max()
        size = largest if alone else one.pick.peak_overpressure_pa
        unit = unit_for("peak_overpressure_pa", float(size))
    low, high, fitted = (x / unit.size for x in (curve.low, curve.high, curve.fitted))
    residual = (curve.samples - curve.fitted) / unit.size
    for axes in (above, below):
        quiet(axes)
        axes.set_xlim(curve.time[0], curve.time[-1])
        axes.axhline(0.0, color=MUTED, linewidth=0.7)
    above.fill_between(curve.time, low, high, color="#9a9a9a", linewidth=0.8)
    above.plot(curve.time, fitted, color=BLUE, linewidth=1.4)
    arrival = float(one.pick.air_arrival_s)
    end = arrival + float(one.pick.positive_duration_s)
    above.axvline(arrival, color=VERMILLION, linewidth=1.0, zorder=0)
    above.axvline(end, color=VERMILLION, linewidth=1.0, linestyle=":", zorder=0)
    for later in np.asarray(one.pick.later_arrivals_s):
        if np.isfinite(later):
            above.axvline(later, color=COLOURS[4], linewidth=1.0, zorder=0)
    clipped = float(one.pick.clipped_at_pa)
    if np.isfinite(clipped):
        level = (clipped - float(one.pick.baseline_pa)) / unit.size
        above.axhline(level, color=INK, linewidth=0.8, linestyle="--")
        residual[high >= (1.0 - NEAR) * level] = np.nan  # only bounds the pressure
    below.plot(curve.time, residual, color=INK, linewidth=0.7)
    largest = float(np.abs(residual[np.isfinite(residual)]).max(initial=0.0))
    below.set_ylim(-1.15 * largest or -1.0, 1.15 * largest or 1.0)
    above.tick_params(labelbottom=False)
    above.set_ylabel(f"[{unit.symbol}]")
    above.yaxis.set_label_coords(-0.095, 0.5)
    words = [estimate_words(one, "peak_overpressure_pa") or "uncalibrated"]
    words.append(estimate_words(one, "positive_duration_s"))
    note = "onset alone" if alone else ", ".join(filter(None, words))
    titled(above, name, note, y=1.0)
