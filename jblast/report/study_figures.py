"""Figures of a study: response, contours, exceedance, sensitivity and convergence."""

import textwrap
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from jblast.report.colours import BLUE, COLOURS, INK, MUTED, VERMILLION
from jblast.report.figures import MARKERS, log_ticks, new_figure, quiet, titled
from jblast.study.columns import ALL, Lane, StudyAxis, StudyColumns, Which
from jblast.study.sensitivity import Shares, rest_name
from jblast.study.statistics import wilson_interval

MAX_PANELS = 6
"""Largest number of panels of a figure: three rows of two fit a page."""
MAX_CURVES = len(COLOURS)
LABEL_WIDTH = 36
"""Characters of a line next to a panel, which is as high."""
NORMAL_Q95 = 1.6448536269514722
GEOMETRIC = 1.3
"""Ratio of the last to the first step from which an axis is drawn logarithmically."""
ESTIMATE = {"number": ("q50", "q05", "q95"), "yes_no": ("share", "low", "high")}
Part = TypeVar("Part")
Limits = Sequence[tuple[str, float, str]]
"""Quantity, value and words of each threshold."""


def panels(
    parts: Iterable[Part], draw: Callable[[Axes, Part], object], height: float = 3.3
) -> Figure:
    """Return a figure with a panel for each of the first parts, two in a row."""
    parts = list(parts)[:MAX_PANELS]
    across = min(2, len(parts))
    rows = -(-len(parts) // across)
    figure = new_figure(5.2 * across if across > 1 else 7.0, height * rows)
    grid = figure.subplots(rows, across, squeeze=False)
    for n, axes in enumerate(grid.flat):
        axes.set_visible(n < len(parts))
        quiet(axes)
    for axes, part in zip(grid.flat, parts, strict=False):
        draw(axes, part)
    return figure


def by_outcome(lanes: Iterable[Lane]) -> list[list[Lane]]:
    """Return the lanes of each outcome: all its sensors."""
    parts: dict[str, list[Lane]] = {}
    for lane in lanes:
        parts.setdefault(lane.name, []).append(lane)
    return list(parts.values())


def label(of: Lane | StudyAxis) -> str:
    """Return description and unit, for an axis of a plot."""
    unit = "" if of.units in ("", "1") else f" [{of.units}]"
    words = of.long_name.partition(",")[0] if isinstance(of, Lane) else of.name
    return textwrap.fill(f"{words}{unit}", LABEL_WIDTH)


def band(axes: Axes, x: Any, middle: Any, low: Any, high: Any, n: int, words: str = ""):
    """Draw a curve with its band, the `n`th of a panel."""
    axes.plot(x, middle, color=COLOURS[n], linewidth=1.4, label=words)
    axes.fill_between(x, low, high, color=COLOURS[n], alpha=0.15, linewidth=0)


def threshold_lines(
    axes: Axes, line: Callable[..., Any], lane: Lane, limits: Limits
) -> None:
    """Draw the thresholds of a quantity, and name them in the legend."""
    for n, (_, value, words) in enumerate(one for one in limits if one[0] == lane.name):
        style = ("--", ":", "-.")[n % 3]
        line(value, color=INK, linewidth=0.9, linestyle=style, label=words)
    if len(axes.get_legend_handles_labels()[0]) > 1:
        axes.legend(fontsize=8, frameon=False)


def scaled(axes: Axes, axis: StudyAxis, along: str = "x") -> None:
    """Label an axis of the study; make it logarithmic if its values are geometric."""
    target = axes.xaxis if along == "x" else axes.yaxis
    target.set_label_text(label(axis))
    steps = np.diff(axis.values)
    if axis.values[0] > 0 and steps.size > 1 and steps[-1] > GEOMETRIC * steps[0]:
        (axes.set_xscale if along == "x" else axes.set_yscale)("log")
        log_ticks(target, (axis.values[0], axis.values[-1]))


def response_figure(columns: StudyColumns, limits: Limits = ()) -> Figure:
    """Draw each outcome over the first numeric axis.

    There is a curve for each sensor, or for each value of another axis. A number has
    its median and the band of 90 % of its samples; yes or no its share with Wilson's
    90 % interval.
    """
    across = columns.numeric_axes[0]
    others = [a for a in columns.axes if a is not across and a.values.size > 1]

    def draw(axes: Axes, lanes: list[Lane]) -> None:
        for n, (lane, own, words) in enumerate(_curves(lanes, others)):
            masks = ((across.at == place) & own for place in range(across.values.size))
            found = [lane.statistics(mask) for mask in masks]
            rows = [[one[key] for key in ESTIMATE[lane.kind]] for one in found]
            middle, low, high = np.array(rows).T
            band(axes, across.values, middle, low, high, n, words)
            axes.lines[-1].set(marker=MARKERS[n], markersize=4)
        number = lanes[0].kind == "number"
        titled(axes, lanes[0].name, "90 % of samples" if number else "90 % intervals")
        scaled(axes, across)
        axes.set_ylabel(label(lanes[0]) if number else "share")
        threshold_lines(axes, axes.axhline, lanes[0], limits)

    return panels(by_outcome(columns.lanes), draw)


def _curves(
    lanes: list[Lane], others: list[StudyAxis]
) -> list[tuple[Lane, np.ndarray | bool, str]]:
    """Return lanes and elements of a panel that have a curve each."""
    if len(lanes) > 1 or not others:
        return [(one, True, one.sensor or one.name) for one in lanes[:MAX_CURVES]]
    other = others[0]
    count = min(other.values.size, MAX_CURVES)
    chosen = np.unique(np.linspace(0, other.values.size - 1, count).astype(int))
    words = other.name if not other.words else ""
    return [
        (lanes[0], other.at == n, f"{words} {other.shown(int(n))}".strip())
        for n in chosen
    ]


def contours_figure(columns: StudyColumns) -> Figure:
    """Draw each yes-or-no over the first two numeric axes, a panel for each word.

    The share is a half on the solid line. Between the dashed lines its 90 % interval
    contains a half.
    """
    across, up = columns.numeric_axes[:2]
    lanes = [lane for lane in columns.lanes if lane.kind == "yes_no"]
    words = columns.word_axes[:1]
    parts: list[tuple[Lane, Which, str]] = [(one, ALL, one.title) for one in lanes]
    if words:
        axis, several = words[0], len(lanes) > 1
        parts = [
            (one, axis.at == n, axis.shown(n) + (f", {one.title}" if several else ""))
            for one in lanes
            for n in range(axis.values.size)
        ]
    drawn = []

    def draw(axes: Axes, part: tuple[Lane, Which, str]) -> None:
        shares = shares_on_grid(part[0], part[1], across, up)
        x, y = across.values, up.values
        levels = np.linspace(0.0, 1.0, 11)
        drawn.append(axes.contourf(x, y, shares[0], levels, cmap="Blues", alpha=0.9))
        styles = ((1.8, "solid"), (1.0, "dashed"), (1.0, "dashed"))
        for values, (wide, style) in zip(shares, styles, strict=True):
            # Matplotlib warns about a contour level outside the values
            if np.nanmin(values) < 0.5 < np.nanmax(values):
                line = {"colors": INK, "linewidths": wide, "linestyles": style}
                axes.contour(x, y, values, [0.5], **line)
        low, high = np.nanmin(shares[0]), np.nanmax(shares[0])
        side = "above 50 %" if low >= 0.5 else "below 50 %" if high <= 0.5 else ""
        titled(axes, part[2], side)
        scaled(axes, across)
        scaled(axes, up, "y")

    figure = panels(parts, draw, 4.2)
    bar = figure.colorbar(drawn[0], ax=figure.axes, shrink=0.85)
    of = f": {lanes[0].long_name or lanes[0].name}" if len(lanes) == 1 else " of yes"
    # a long name would be cut off, as labels of colour bars are not wrapped
    bar.set_label(textwrap.fill(f"share{of}", LABEL_WIDTH), color=INK)
    handles = [
        Line2D([], [], color=INK, linewidth=1.8, label="50 %"),
        Line2D([], [], color=INK, linewidth=1.0, linestyle="--", label="90 % interval"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
    return figure


def shares_on_grid(
    lane: Lane, mask: Which, across: StudyAxis, up: StudyAxis
) -> np.ndarray:
    """Return share and bounds of each cell, shape (3, `up` values, `across` values)."""
    chosen = np.zeros(across.at.size, bool)
    chosen[mask] = True
    found = np.full((3, up.values.size, across.values.size), np.nan)
    for j, i in np.ndindex(*found.shape[1:]):
        own = chosen & (across.at == i) & (up.at == j)
        if own.any():
            of = lane.statistics(own)
            found[:, j, i] = [of[key] for key in ESTIMATE["yes_no"]]
    return found


def exceedance_figure(columns: StudyColumns, limits: Limits = ()) -> Figure:
    """Draw the share of samples above each value, with Wilson's 90 % interval."""

    def draw(axes: Axes, lanes: list[Lane]) -> None:
        for n, lane in enumerate(lanes[:MAX_CURVES]):
            at, above, count = exceedance(lane)
            low, high = wilson_interval(above, np.full(at.size, float(count)))
            # on a logarithmic axis zero is cut off instead of dropped to the bottom
            least, seen = (
                np.maximum(low, 0.3 / count),
                np.where(above > 0, above, np.nan),
            )
            band(axes, at, seen, least, high, n, lane.sensor or lane.name)
        titled(axes, lanes[0].name, "90 % intervals")
        axes.set_yscale("log")
        if axes.dataLim.x1 > 20 * axes.dataLim.x0 > 0:
            axes.set_xscale("log")
        axes.set_xlabel(label(lanes[0]))
        axes.set_ylabel("share of samples above")
        threshold_lines(axes, axes.axvline, lanes[0], limits)

    return panels(by_outcome(n for n in columns.lanes if n.kind == "number"), draw)


def exceedance(lane: Lane) -> tuple[np.ndarray, np.ndarray, int]:
    """Return finite values, share of samples above each, and number of samples."""
    values = lane.distribution()
    count = max(1, values.size)
    above = 1 - np.arange(1, values.size + 1) / count
    finite = np.flatnonzero(np.isfinite(values))
    if not finite.size:
        return np.zeros(0), np.zeros(0), 1
    # evenly spaced values, and more of them in the upper tail
    tail = finite[-1] - np.geomspace(1, finite.size, 200).astype(int) + 1
    even = np.linspace(finite[0], finite[-1], 400).astype(int)
    some = np.unique([*even, *tail])
    return values[some], above[some], count


def sensitivity_figure(columns: StudyColumns, shares: Sequence[Shares]) -> Figure:
    """Draw first-order and total index of each parameter, and the remainder."""

    def draw(axes: Axes, one: Shares) -> None:
        place = np.arange(len(one.numbers))
        most = 1.0
        for away, index, words, colour in (
            (-0.18, "first", "first order", BLUE),
            (0.18, "total", "total", VERMILLION),
        ):
            value = [getattr(number, index) for number in one.numbers]
            ends = np.array([getattr(n, f"{index}_interval") for n in one.numbers]).T
            axes.barh(place + away, value, 0.34, color=colour, alpha=0.85, label=words)
            axes.hlines(place + away, *ends, color=INK, linewidth=1.2)
            most = max(most, 1.05 * ends.max())
        axes.barh(len(place), one.rest, 0.34, color=MUTED, label="not explained")
        names = [number.name for number in one.numbers]
        axes.set_yticks(np.arange(len(names) + 1), [*names, rest_name(columns, one)])
        # barh counts from below; the first parameter belongs at the top
        axes.invert_yaxis()
        axes.set_xlim(0, most)
        axes.set_xlabel("share of the variance")
        titled(axes, one.title, f"{100 * one.explained:.0f} % explained")

    figure = panels(shares, draw)
    handles, words = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, words, loc="outside lower center", ncols=3, frameon=False)
    return figure


def convergence_figure(columns: StudyColumns) -> Figure:
    """Draw the estimate of each outcome at its first sensor over the samples."""

    def draw(axes: Axes, lane: Lane) -> None:
        course = lane.course()
        if lane.kind == "yes_no":
            rows = [[found[key] for key in ESTIMATE["yes_no"]] for found in course]
        else:
            pairs = [
                (one["mean"], NORMAL_Q95 * one["standard_error"]) for one in course
            ]
            rows = [(mean, mean - half, mean + half) for mean, half in pairs]
        middle, low, high = np.array(rows).T
        band(axes, [int(state.samples) for state in lane.after], middle, low, high, 0)
        axes.axhline(rows[-1][0], color=MUTED, linewidth=0.8, linestyle=":")
        titled(axes, lane.title, "90 % intervals")
        axes.set_xscale("log")
        axes.set_xlabel("samples")
        number = lane.kind == "number"
        axes.set_ylabel(f"mean {label(lane)}" if number else "share")

    return panels([part[0] for part in by_outcome(columns.lanes)], draw)
