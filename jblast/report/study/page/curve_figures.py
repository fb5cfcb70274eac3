"""Curves of a study: over an axis, past a value, and as samples come in."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.report.figure_style import (
    BLUE,
    COLOURS,
    MARKERS,
    MUTED,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.report.study.page.columns import Lane, StudyAxis, StudyColumns
from jblast.report.study.page.lane_states import found_in, pooled
from jblast.report.study.page.summaries import summary_of
from jblast.study.statistics import NUMBER, YES_NO, wilson_interval

MOST_PANELS = 6
MOST_CURVES = 6
NORMAL_Q95 = 1.6448536269514722
GEOMETRIC = 1.3
"""Steps of an axis that grow by this factor, first to last, are logarithmic."""


def panels_of(lanes: Sequence[Lane]) -> list[list[Lane]]:
    """Return the lanes of each panel: sensors of one outcome stand together."""
    parts: dict[str, list[Lane]] = {}
    for lane in lanes:
        parts.setdefault(lane.name, []).append(lane)
    return list(parts.values())[:MOST_PANELS]


def grid_of(count: int) -> tuple[Figure, list[Axes]]:
    """Return a figure of so many panels, two in a row."""
    columns = min(2, count)
    rows = -(-count // columns)
    figure = new_figure(5.2 * columns if columns > 1 else 7.0, 3.3 * rows)
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes in grid.flat[count:]:
        axes.set_visible(False)
    return figure, list(grid.flat[:count])


def scaled(axes: Axes, axis: StudyAxis, along: str = "x") -> None:
    """Name an axis of the study, and make it logarithmic where its values grow so."""
    target = axes.xaxis if along == "x" else axes.yaxis
    target.set_label_text(axis.label)
    if is_geometric(axis.values):
        (axes.set_xscale if along == "x" else axes.set_yscale)("log")
        log_ticks(target, (axis.values[0], axis.values[-1]))


def is_geometric(values: np.ndarray) -> bool:
    """Return whether positive values have steps that grow."""
    steps = np.diff(values)
    return bool(values[0] > 0 and len(steps) > 1 and steps[-1] > GEOMETRIC * steps[0])


def response_figure(columns: StudyColumns) -> Figure | None:
    """Draw each outcome over the first numeric axis, a curve for each of the next.

    A number has its median and the band of 90 % of its samples; yes or no its share
    with Wilson's 90 % interval.
    """
    if not columns.numeric_axes:
        return None
    across = columns.numeric_axes[0]
    others = [a for a in columns.axes if a is not across and a.values.size > 1]
    other = others[0] if others else None
    parts = panels_of(columns.lanes)
    figure, grid = grid_of(len(parts))
    for axes, lanes in zip(grid, parts, strict=True):
        quiet(axes)
        curves = _curves(lanes, other)
        titled(
            axes,
            lanes[0].name,
            "90 % of samples" if lanes[0].kind == "number" else "90 % intervals",
        )
        for n, (lane, place, words) in enumerate(curves):
            _response(axes, columns, lane, across, other, place, words, n)
        scaled(axes, across)
        axes.set_ylabel(lanes[0].label if lanes[0].kind == "number" else "share")
        if len(curves) > 1:
            title = other.label if other is not None and len(lanes) == 1 else None
            axes.legend(fontsize=8, frameon=False, title=title, title_fontsize=8)
    return figure


def _curves(
    lanes: list[Lane], other: StudyAxis | None
) -> list[tuple[Lane, int | None, str]]:
    """Return lanes and values of another axis that have a curve each."""
    if len(lanes) > 1 or other is None:
        return [(lane, None, lane.sensor or lane.name) for lane in lanes[:MOST_CURVES]]
    count = other.values.size
    chosen = np.unique(np.linspace(0, count - 1, min(count, MOST_CURVES)).astype(int))
    return [(lanes[0], int(n), other.said(int(n))) for n in chosen]


def _response(axes, columns, lane, across, other, place, words, n) -> None:
    middle, low, high = [], [], []
    for at in range(across.values.size):
        mask = across.at == at
        if place is not None:
            mask &= other.at == place
        found = summary_of(columns, lane, mask).found
        names = (
            ("q50", "q05", "q95") if lane.kind == "number" else ("share", "low", "high")
        )
        for values, name in zip((middle, low, high), names, strict=True):
            values.append(found[name])
    colour = COLOURS[n % len(COLOURS)]
    axes.plot(
        across.values,
        middle,
        color=colour,
        marker=MARKERS[n % len(MARKERS)],
        markersize=4,
        linewidth=1.4,
        label=words,
    )
    axes.fill_between(across.values, low, high, color=colour, alpha=0.15, linewidth=0)


def exceedance_figure(columns: StudyColumns) -> Figure | None:
    """Draw how often each number is above a value, with Wilson's 90 % interval."""
    parts = panels_of([lane for lane in columns.lanes if lane.kind == "number"])
    parts = [p for p in parts if any(np.isfinite(above_of(one)[0]).any() for one in p)]
    if not parts or columns.weights is not None:
        return None
    figure, grid = grid_of(len(parts))
    for axes, lanes in zip(grid, parts, strict=True):
        quiet(axes)
        titled(axes, lanes[0].name, "90 % intervals")
        positive = True
        for n, lane in enumerate(lanes[:MOST_CURVES]):
            at, above, count = above_of(lane)
            if not at.size:
                continue
            positive &= bool(at[0] > 0)
            low, high = wilson_interval(above, np.full(at.size, float(count)))
            colour = COLOURS[n % len(COLOURS)]
            seen = above > 0
            axes.plot(
                at[seen],
                above[seen],
                color=colour,
                linewidth=1.4,
                label=lane.sensor or lane.name,
            )
            axes.fill_between(
                at,
                np.maximum(low, 0.3 / count),
                high,
                color=colour,
                alpha=0.15,
                linewidth=0,
            )
        axes.set_yscale("log")
        if positive and axes.dataLim.x1 > 20 * axes.dataLim.x0 > 0:
            axes.set_xscale("log")
        axes.set_xlabel(lanes[0].label)
        axes.set_ylabel("share of samples above")
        if len(lanes) > 1:
            axes.legend(fontsize=8, frameon=False)
    return figure


def above_of(lane: Lane) -> tuple[np.ndarray, np.ndarray, int]:
    """Return values, the share of samples above each, and of how many that is."""
    if lane.state is not None:
        found = found_in("number", lane.state, slice(None), quantiles=())
        ends = float(found["minimum"]), float(found["maximum"])
        values, counts = pooled(lane.state.sketch, *ends)
        count = max(1, int(counts.sum()))
        above = 1 - np.cumsum(counts) / count
        some = np.unique(np.linspace(0, len(values) - 1, 600).astype(int))
        return (values[some], above[some], count) if len(values) else (values, above, 1)
    known = np.sort(lane.values[~np.isnan(lane.values)])
    finite = known[np.isfinite(known)]
    if not finite.size:
        return finite, finite, 1
    last = finite.size - 1
    tail = last - np.geomspace(1, last + 1, 200).astype(int) + 1
    at = np.unique([*np.linspace(0, last, 200).astype(int), *tail])
    return finite[at], 1 - (at + 1) / known.size, known.size


def convergence_figure(columns: StudyColumns) -> Figure | None:
    """Draw the estimate of each outcome as samples come in, in their order."""
    lanes = [part[0] for part in panels_of(columns.lanes)]
    if columns.counted is None:
        lanes = [lane for lane in lanes if np.isfinite(lane.values).sum() > 1]
    elif len(columns.course) < 2:
        return None
    if not lanes:
        return None
    figure, grid = grid_of(len(lanes))
    ends = np.array([end for end, _ in columns.course])
    if columns.counted is None:
        first = min(10, columns.samples)
        ends = np.unique(np.geomspace(first, columns.samples, 40).astype(int))
    for axes, lane in zip(grid, lanes, strict=True):
        quiet(axes)
        titled(axes, lane.title, "90 % intervals")
        rows = [_ends(lane, known[lane.title]) for _, known in columns.course]
        if columns.counted is None:
            rows = [_running(columns, lane, int(end)) for end in ends]
        middle, low, high = np.array(rows).T
        axes.plot(ends, middle, color=BLUE, linewidth=1.4)
        axes.fill_between(ends, low, high, color=BLUE, alpha=0.15, linewidth=0)
        axes.axhline(middle[-1], color=MUTED, linewidth=0.8, linestyle=":")
        axes.set_xscale("log")
        axes.set_xlabel("samples")
        axes.set_ylabel("share" if lane.kind == "yes_no" else f"mean {lane.label}")
    return figure


def _running(columns: StudyColumns, lane: Lane, end: int) -> tuple[float, ...]:
    """Return estimate and interval of the first samples."""
    weights = None if columns.weights is None else columns.weights[:end]
    values = lane.values[:end]
    if lane.kind == "yes_no":
        flags = np.where(np.isnan(values), -1, values).astype(np.int8)
        return _ends(lane, YES_NO.finish(YES_NO.add(YES_NO.empty(), flags, weights)))
    state = NUMBER.empty(weighted=weights is not None)
    return _ends(lane, NUMBER.finish(NUMBER.add(state, values, weights)))


def _ends(lane: Lane, found: Mapping[str, Any]) -> tuple[float, ...]:
    """Return an estimate and its interval."""
    if lane.kind == "yes_no":
        return tuple(float(found[name]) for name in ("share", "low", "high"))
    mean, half = float(found["mean"]), NORMAL_Q95 * float(found["standard_error"])
    return mean, mean - half, mean + half
