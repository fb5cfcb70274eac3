"""Results of a study on one page."""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from jblast.files import write_bytes, write_text
from jblast.report.figure_files import Picture, picture_of
from jblast.report.figures import (
    BLUE,
    COLOURS,
    INK,
    MARKERS,
    MUTED,
    VERMILLION,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.report.pages import page
from jblast.report.study_columns import Lane, StudyAxis, StudyColumns, found_in, pooled
from jblast.report.study_results import (
    LaneShares,
    StudyReportAnswer,
    Table,
    number_table,
    sensitivity_table,
    share_table,
    shares_of,
    study_report_answer,
    summary_of,
    text_lines,
)
from jblast.study.statistics import NUMBER, YES_NO, wilson_interval

RESPONSE = (
    "Medians with the band of 90 % of the samples; shares with Wilson's 90 % interval."
)
EXCEEDANCE = "Share of samples above a value, with Wilson's 90 % interval."
CONTOURS_SHOW = (
    "Solid: half of the samples. Between the dashed lines the 90 % interval of the "
    "share contains a half. Between the values of the axes shares are interpolated."
)
CONVERGENCE = "Estimates against the number of samples, with 90 % intervals."
SHARES = "Sobol' indices with bootstrapped 90 % intervals."
HOW_SHARES = (
    "First order: share of the variance that a parameter explains alone. Total: share "
    "with its interactions. Elasticity: change of the outcome in per cent for one per "
    "cent of the parameter, by a plane through the samples nearest to the middle. Axes "
    "count as sampled evenly from their values. The unexplained part is noise without "
    "a parameter, or a step that polynomials do not represent."
)
EVEN = 0.5
MAX_PANELS = 6
"""Largest number of panels of a figure: three rows of two fit a page."""
LEVELS = np.linspace(0.0, 1.0, 11)
LABEL_WIDTH = 36
"""Characters of a line next to the colour bar, which is as high as a panel."""
MAX_CURVES = 6
"""Largest number of curves in a panel: as many as there are colours."""
NORMAL_Q95 = 1.6448536269514722
GEOMETRIC = 1.3
"""Ratio of the last to the first step from which an axis is drawn logarithmically."""


@dataclass(frozen=True)
class Section:
    """A part of the page."""

    title: str
    tables: list[Table] = field(default_factory=list)
    pictures: list[dict[str, Any]] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class StudyReport:
    """A report on a study: numbers, figures and a page.

    Attributes:
        columns: Samples or statistics of the study.
        name: Name of the store.
    """

    columns: StudyColumns
    name: str = ""

    @cached_property
    def overall(self):
        """Each outcome over all samples."""
        return [summary_of(self.columns, lane) for lane in self.columns.lanes]

    @cached_property
    def cells(self):
        """Each outcome in each cell of the axes."""
        columns = self.columns
        if not columns.axes:
            return []
        return [
            summary_of(columns, lane, mask, cell)
            for lane in columns.lanes
            for cell, mask in columns.cells()
        ]

    @cached_property
    def shares(self):
        """Sources of the scatter of the outcomes."""
        return shares_of(self.columns)

    @cached_property
    def pictures(self) -> dict[str, Picture]:
        """The figures by name; empty ones are left out."""
        drawn: dict[str, Callable[[], Figure | None]] = {
            "response": lambda: response_figure(self.columns),
            "contours": lambda: contour_figure(self.columns),
            "exceedance": lambda: exceedance_figure(self.columns),
            "sensitivity": lambda: share_figure(self.shares),
            "convergence": lambda: convergence_figure(self.columns),
        }
        made = ((name, draw()) for name, draw in drawn.items())
        return {name: picture_of(of) for name, of in made if of is not None}

    def answer(self) -> StudyReportAnswer:
        """Return the document."""
        return study_report_answer(self.columns, self.overall, self.cells, self.shares)

    def text(self) -> str:
        """Return the text for the terminal."""
        return "\n".join(text_lines(self.columns, self.overall)) + "\n"

    def page(self, made: list[str] | None = None) -> str:
        """Return the page.

        Args:
            made: Further provenance.
        """
        attributes = self.columns.attributes
        return page(
            "templates/study.html",
            title=f"Study {self.name}".strip(),
            subtitle=f"{self.columns.total:,} samples, seed {attributes.get('seed')}, "
            f"design {attributes.get('design')}",
            notes=self.columns.notes,
            sections=[one for one in self._sections() if one.tables or one.pictures],
            texts=[
                (name, text)
                for name, text in (
                    ("The study", attributes.get("study")),
                    ("Its scene", attributes.get("scene")),
                )
                if text
            ],
            made=[
                f"Study: SHA-256 {attributes.get('study_sha256')}; scene: SHA-256 "
                f"{attributes.get('scene_sha256')}",
                f"Run by jblast {attributes.get('jblast')}.",
                *(made or []),
            ],
        )

    def _sections(self) -> list[Section]:
        names = tuple(axis.name for axis in self.columns.axes)
        return [
            Section(
                "Outcomes, over all samples",
                _some(number_table(self.overall), share_table(self.overall)),
            ),
            Section(
                "Over the axes",
                [],
                self._shown("response", "Outcomes over the first axis.", RESPONSE)
                + self._shown("contours", "Shares over two axes.", CONTOURS_SHOW),
            ),
            Section(
                "Exceedance",
                [],
                self._shown("exceedance", "Exceedance curves.", EXCEEDANCE),
            ),
            Section(
                "Sensitivity",
                _some(sensitivity_table(self.shares)),
                self._shown("sensitivity", "Bars of Sobol' indices.", SHARES),
                [HOW_SHARES],
            ),
            Section(
                "Convergence",
                [],
                self._shown("convergence", "Running estimates.", CONVERGENCE),
            ),
            Section(
                "By cell of the axes",
                _some(number_table(self.cells, names), share_table(self.cells, names)),
            ),
        ]

    def _shown(self, name: str, alt: str, caption: str) -> list[dict[str, Any]]:
        picture = self.pictures.get(name)
        if picture is None:
            return []
        own = {"source": picture.source, "width": picture.width}
        return [own | {"alt": alt, "caption": caption}]


def write_report(report: StudyReport, directory: Path) -> None:
    """Write report.html, report.json and a PNG of each figure.

    Raises:
        OSError: One cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    write_text(directory / "report.json", report.answer().to_json())
    for name, picture in report.pictures.items():
        write_bytes(directory / f"{name}.png", picture.png)
    write_text(directory / "report.html", report.page())


def _some(*tables: Table | None) -> list[Table]:
    return [one for one in tables if one is not None]


def study_report(columns: StudyColumns, name: str = "") -> StudyReport:
    """Return the report on a study; its parts are computed on first use."""
    return StudyReport(columns, name)


def share_figure(shares: Sequence[LaneShares]) -> Figure | None:
    """Draw first-order and total index of each parameter, a panel for each outcome."""
    shown = list(shares)[:MAX_PANELS]
    if not shown:
        return None
    figure, grid = grid_of(len(shown))
    for axes, one in zip(grid, shown, strict=True):
        quiet(axes)
        titled(axes, one.lane.title, f"{100 * one.indices.explained:.0f} % explained")
        place = np.arange(len(one.indices.names))
        of = one.indices
        for away, words, value, ends, colour in (
            (-0.18, "first order", of.first, of.first_interval, BLUE),
            (0.18, "total", of.total, of.total_interval, VERMILLION),
        ):
            axes.barh(place + away, value, 0.34, color=colour, alpha=0.85, label=words)
            axes.hlines(place + away, *ends, color=INK, linewidth=1.2)
        axes.set_yticks(place, of.names)
        # barh counts from below; the first parameter belongs at the top
        axes.invert_yaxis()
        axes.set_xlim(0, max(1.0, float(of.total_interval[1].max()) * 1.05))
        axes.set_xlabel("share of the variance")
    handles, words = grid[0].get_legend_handles_labels()
    figure.legend(handles, words, loc="outside lower center", ncols=2, frameon=False)
    return figure


def contour_figure(columns: StudyColumns) -> Figure | None:
    """Draw each yes-or-no over the first two numeric axes, a panel for each word.

    The share is a half on the solid line. Between the dashed lines its 90 % interval
    contains a half.
    """
    lanes = [lane for lane in columns.lanes if lane.kind == "yes_no"]
    if len(columns.numeric_axes) < 2 or not lanes:
        return None
    across, up = columns.numeric_axes[:2]
    panels = _panels(columns, lanes)[:MAX_PANELS]
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
    # a long name would be cut off, as labels of colour bars are not wrapped
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
            f"{axis.shown(n)}, {lane.title}" if several else axis.shown(n),
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
    """Return share and bounds of each cell, shape (3, `up` values, `across` values)."""
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
        # Matplotlib warns about a contour level outside the values
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


def panels_of(lanes: Sequence[Lane]) -> list[list[Lane]]:
    """Return the lanes of each panel: all sensors of one outcome."""
    parts: dict[str, list[Lane]] = {}
    for lane in lanes:
        parts.setdefault(lane.name, []).append(lane)
    return list(parts.values())[:MAX_PANELS]


def grid_of(count: int) -> tuple[Figure, list[Axes]]:
    """Return a figure with `count` panels, two in a row."""
    columns = min(2, count)
    rows = -(-count // columns)
    figure = new_figure(5.2 * columns if columns > 1 else 7.0, 3.3 * rows)
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes in grid.flat[count:]:
        axes.set_visible(False)
    return figure, list(grid.flat[:count])


def scaled(axes: Axes, axis: StudyAxis, along: str = "x") -> None:
    """Label an axis of the study; make it logarithmic if its values are geometric."""
    target = axes.xaxis if along == "x" else axes.yaxis
    target.set_label_text(axis.label)
    if is_geometric(axis.values):
        (axes.set_xscale if along == "x" else axes.set_yscale)("log")
        log_ticks(target, (axis.values[0], axis.values[-1]))


def is_geometric(values: np.ndarray) -> bool:
    """Return whether values are positive with growing steps."""
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
        return [(lane, None, lane.sensor or lane.name) for lane in lanes[:MAX_CURVES]]
    count = other.values.size
    chosen = np.unique(np.linspace(0, count - 1, min(count, MAX_CURVES)).astype(int))
    return [(lanes[0], int(n), other.shown(int(n))) for n in chosen]


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
    """Draw the share of samples above each value, with Wilson's 90 % interval."""
    parts = panels_of([lane for lane in columns.lanes if lane.kind == "number"])
    parts = [p for p in parts if any(np.isfinite(above_of(one)[0]).any() for one in p)]
    if not parts:
        return None
    figure, grid = grid_of(len(parts))
    for axes, lanes in zip(grid, parts, strict=True):
        quiet(axes)
        titled(axes, lanes[0].name, "90 % intervals")
        positive = True
        for n, lane in enumerate(lanes[:MAX_CURVES]):
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
    """Return values, the share of samples above each, and the number of samples."""
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
    """Draw the estimate of each outcome against the number of samples."""
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
            rows = [_running(lane, int(end)) for end in ends]
        middle, low, high = np.array(rows).T
        axes.plot(ends, middle, color=BLUE, linewidth=1.4)
        axes.fill_between(ends, low, high, color=BLUE, alpha=0.15, linewidth=0)
        axes.axhline(middle[-1], color=MUTED, linewidth=0.8, linestyle=":")
        axes.set_xscale("log")
        axes.set_xlabel("samples")
        axes.set_ylabel("share" if lane.kind == "yes_no" else f"mean {lane.label}")
    return figure


def _running(lane: Lane, end: int) -> tuple[float, ...]:
    """Return estimate and interval of the first samples."""
    values = lane.values[:end]
    if lane.kind == "yes_no":
        flags = np.where(np.isnan(values), -1, values).astype(np.int8)
        return _ends(lane, YES_NO.finish(YES_NO.add(YES_NO.empty(), flags)))
    return _ends(lane, NUMBER.finish(NUMBER.add(NUMBER.empty(), values)))


def _ends(lane: Lane, found: Mapping[str, Any]) -> tuple[float, ...]:
    """Return an estimate and its interval."""
    if lane.kind == "yes_no":
        return tuple(float(found[name]) for name in ("share", "low", "high"))
    mean, half = float(found["mean"]), NORMAL_Q95 * float(found["standard_error"])
    return mean, mean - half, mean + half
