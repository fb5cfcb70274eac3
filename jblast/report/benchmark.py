"""Cost against error: the figure and the table of `jblast chart`."""

import itertools
import math
import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import EngFormatter, FuncFormatter, LogLocator, NullFormatter
from matplotlib.transforms import Bbox

from jblast.fidelity.timing import machine
from jblast.files import write_text
from jblast.report.figure_files import write_figure
from jblast.report.figure_style import (
    BLUE,
    INK,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
)
from jblast.report.words import capitalised, comma_separated, markdown
from jblast.verification.benchmark.chart import (
    Benchmark,
    BenchmarkPoint,
    on_pareto_front,
    panels,
)

COLUMNS = ("method", "cost_s", "error", "on_front", "range")
HEAD = ("", "method", "cost [s]", "error", "over")
COST_GAP = 1e3
"""A method that costs more than this many times the next cheaper one is drawn at the
right edge: on a common axis the other methods would be in one spot."""
MAX_LABELLED_SPAN = 300.0
"""Largest factor spanned by an axis with labels at 1, 2 and 5; else at decades only."""
EDGE_FACTOR = 4.0
"""Position of the right edge, as a factor of the largest cost on the axis."""
SINGLE_HEIGHT = 4.6
"""Height of a single panel [inch]."""
CHARACTERS_PER_INCH = 10
"""Characters per inch of an axis label, at 10 points."""
LABEL_POSITIONS = (
    (5, 4, "left", "bottom"),
    (7, 0, "left", "center"),
    (-7, 0, "right", "center"),
    (0, 7, "center", "bottom"),
    (0, -7, "center", "top"),
    *((7, dy, "left", "center") for dy in (10, -10, 18, -18)),
    *((-7, dy, "right", "center") for dy in (10, -10, 18, -18)),
)
"""Candidate positions of a name relative to its point: offset [point], alignment."""


def chart_markdown(benchmark: Benchmark, points: Sequence[BenchmarkPoint]) -> str:
    """Return the table of every panel, the cheapest method first."""
    lines = [
        f"## {benchmark.title}",
        "",
        f"Cost: {benchmark.cost}. Error: {benchmark.error}. {machine()}. A star marks "
        "the Pareto front: no other method is better in both.",
    ]
    front = {
        # by identity: the panels below reorder the points
        id(point)
        for point, on in zip(points, on_pareto_front(points), strict=True)
        if on
    }
    for panel, within in panels(points).items():
        lines += ["", f"### {capitalised(panel)}", ""] if panel else [""]
        cheapest_first = sorted(within, key=lambda p: p.cost_s)
        rows = [_row(point, id(point) in front) for point in cheapest_first]
        lines.append(markdown(HEAD, rows, right=(2, 3)))
    return "\n".join(lines) + "\n"


def _row(point: BenchmarkPoint, is_on_front: bool) -> tuple[str, ...]:
    error = f"{point.error:.2g}" + (" (the reference)" if point.is_reference else "")
    star = "*" if is_on_front else ""
    return star, point.method, f"{point.cost_s:.2g}", error, point.range


def chart_csv(points: Sequence[BenchmarkPoint]) -> str:
    """Return all points as CSV, one row each."""
    rows = [
        (
            point.method,
            # four digits: repeated timings differ by more
            f"{point.cost_s:.4g}",
            f"{point.error:.4g}",
            str(bool(on)).lower(),
            point.range,
        )
        for point, on in zip(points, on_pareto_front(points), strict=True)
    ]
    return comma_separated([COLUMNS, *rows])


def write_chart(
    benchmark: Benchmark, points: Sequence[BenchmarkPoint], directory: Path
) -> None:
    """Write TOPIC.png, TOPIC.csv and TOPIC.md."""
    directory.mkdir(parents=True, exist_ok=True)
    write_text(directory / f"{benchmark.name}.csv", chart_csv(points))
    write_text(directory / f"{benchmark.name}.md", chart_markdown(benchmark, points))
    write_figure(chart_figure(benchmark, points), directory / f"{benchmark.name}.png")


def chart_figure(benchmark: Benchmark, points: Sequence[BenchmarkPoint]) -> Figure:
    """Draw every panel of a benchmark: cost to the right, error upwards.

    All panels have the same axes. A filled point covers the whole panel, a blue one is
    on the Pareto front, and a diamond is the reference.
    """
    parts = panels(points)
    columns = min(2, len(parts))
    rows = math.ceil(len(parts) / columns)
    height = 2.7 * rows + 1.0 if len(parts) > 1 else SINGLE_HEIGHT
    figure = new_figure(5.4 * columns if columns > 1 else 7.0, height)
    figure.suptitle(benchmark.title, fontsize=13, color=INK, fontweight="bold")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for axes in grid.flat[len(parts) :]:
        axes.set_visible(False)
    last = _last_within(points)
    drawn = [
        (axes, _panel(axes, panel, within, last))
        for axes, (panel, within) in zip(grid.flat, parts.items(), strict=False)
    ]
    _scale(grid[0, 0], benchmark, points, last)
    for axes, panel in zip(grid.flat, parts.values(), strict=False):
        for word, order in benchmark.orders.items():
            _order(axes, [p for p in panel if p.method.startswith(word)], order)
    figure.supxlabel(f"cost: {benchmark.cost}", fontsize=10, color=INK)
    error = textwrap.fill(
        f"error: {benchmark.error}", int(CHARACTERS_PER_INCH * height)
    )
    figure.supylabel(error, fontsize=10, color=INK, ma="center")
    # names are placed by the pixels they cover, which exist after a draw only
    figure.canvas.draw()
    for axes, labels in drawn:
        _name(axes, labels)
    return figure


def _last_within(points: Sequence[BenchmarkPoint]) -> float:
    """Return the cost past which methods are drawn at the right edge."""
    costs = np.sort([point.cost_s for point in points])
    gaps = np.flatnonzero(costs[1:] > COST_GAP * costs[:-1])
    return float(costs[gaps[0]] if gaps.size else costs[-1])


def _scale(
    axes: Axes, benchmark: Benchmark, points: Sequence[BenchmarkPoint], last: float
) -> None:
    """Set the axes that all panels share: whole decades, in seconds and per cent."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    first = min(point.cost_s for point in points)
    far = any(point.cost_s > last for point in points)
    axes.set_xlim(first / 1.6, last * (EDGE_FACTOR * 1.2 if far else 2.5))
    errors = [point.error for point in points]
    axes.set_ylim(min(errors) / 2.2, max(errors) * 2.2)
    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        subs = (1.0, 2.0, 5.0) if high / low < MAX_LABELLED_SPAN else (1.0,)
        axis.set_major_locator(LogLocator(subs=subs))
    axes.xaxis.set_major_formatter(EngFormatter(unit="s"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())
    shown = (
        (lambda y, _: f"{100 * y:g} %") if benchmark.relative else lambda y, _: f"{y:g}"
    )
    axes.yaxis.set_major_formatter(FuncFormatter(shown))


def _panel(
    axes: Axes, panel: str, points: Sequence[BenchmarkPoint], last: float
) -> list[tuple[float, float, str, str]]:
    """Draw the points of a panel; return position, name and colour of each."""
    quiet(axes)
    titled(axes, capitalised(panel))
    labels, front = [], []
    for point, best in zip(points, on_pareto_front(points), strict=True):
        far = point.cost_s > last
        # its cost stands in the name, as the axis does not have it
        x = last * EDGE_FACTOR if far else point.cost_s
        colour = VERMILLION if point.is_reference else BLUE if best else MUTED
        axes.plot(
            x,
            point.error,
            marker="D" if point.is_reference else ">" if far else "o",
            color=colour,
            markerfacecolor=colour if point.whole else "white",
            markersize=6,
            linestyle="none",
            zorder=3,
        )
        if point.is_reference:
            axes.axhline(point.error, color=VERMILLION, linewidth=0.8, linestyle=":")
        if best:
            front.append((x, point.error))
        name = f"{point.method}, {point.cost_s:.1g} s" if far else point.method
        labels.append((x, point.error, name, colour))
    if front:
        x, y = zip(*sorted(front), strict=True)
        axes.step(x, y, where="post", color=BLUE, linewidth=1.2, zorder=1)
    return labels


def _order(axes: Axes, points: Sequence[BenchmarkPoint], order: int) -> None:
    """Draw the theoretical decrease of a method's error through its last point."""
    if not points:
        return
    last = points[-1]
    cost = np.array(axes.get_xlim())
    error = last.error * (cost / last.cost_s) ** -float(order)
    axes.plot(cost, error, color=MUTED, linewidth=0.9, linestyle="--", zorder=0)
    low, high = axes.get_ylim()
    # the label stands 3 % above the lower end of the panel, on the line
    x = last.cost_s * (last.error / (low * (high / low) ** 0.03)) ** (1 / order)
    axes.annotate(
        f"order {order}",
        (min(x, cost[1]), max(low, error[1])),
        xytext=(-3, 3),
        textcoords="offset points",
        ha="right",
        va="bottom",
        fontsize=8,
        color=MUTED,
        path_effects=[withStroke(linewidth=2.5, foreground="white")],
    )


def _front(axes: Axes) -> list[Bbox]:
    """Return boxes along the Pareto front, which names should not cover."""
    boxes = []
    for line in axes.lines:
        if line.get_drawstyle() == "steps-post":
            corners = axes.transData.transform(line.get_xydata())
            for (x, y), (right, down) in itertools.pairwise(corners):
                boxes.append(Bbox.from_extents(x, y - 1, right, y + 1))
                boxes.append(Bbox.from_extents(right - 1, down, right + 1, y))
    return boxes


def _name(axes: Axes, labels: Sequence[tuple]) -> None:
    """Write each name next to its point, at the position where it covers least."""
    place = axes.transData.transform
    taken = [
        Bbox.from_bounds(x - 5, y - 5, 10, 10)
        for x, y in (place((label[0], label[1])) for label in labels)
    ]
    taken += _front(axes)
    inside = axes.get_window_extent().frozen()
    # from the right: names near the right edge have the fewest free positions
    for x, y, name, colour in sorted(labels, key=lambda label: -label[0]):
        best, least, kept = None, math.inf, taken[0]
        for dx, dy, across, along in LABEL_POSITIONS:
            text = axes.annotate(
                name,
                (x, y),
                xytext=(dx, dy),
                textcoords="offset points",
                ha=across,
                va=along,
                fontsize=8,
                color=INK if colour == MUTED else colour,
                path_effects=[withStroke(linewidth=2.5, foreground="white")],
            )
            box = text.get_window_extent()
            covered = sum(_overlap(box, other) for other in taken)
            # the part of a name outside the panel counts as covered
            covered += box.width * box.height - _overlap(box, inside)
            if covered < least:
                if best is not None:
                    best.remove()
                best, least, kept = text, covered, box
            else:
                text.remove()
            if least == 0.0:
                break
        taken.append(kept)


def _overlap(one: Bbox, other: Bbox) -> float:
    shared = Bbox.intersection(one, other)
    return 0.0 if shared is None else shared.width * shared.height
