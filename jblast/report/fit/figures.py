"""Figures of a fit.

Arrivals are drawn minus range over sound speed. Over two decades of range a millisecond
is invisible in an arrival. In the reduced arrival the lead of the shock over sound and
the residuals are visible.
"""

import sys
import textwrap
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from types import ModuleType
from typing import Any, cast

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

from jblast.constants import LIGHT_SPEED
from jblast.inference.fitting.fit import Band, Fit
from jblast.inference.posterior.parameters import Estimate
from jblast.quantities import ADDITIVE, TIMED
from jblast.report.estimates import (
    WIDE_LOG_SD,
    Accepted,
    outlier_rows,
    printed_estimate,
)
from jblast.report.figures import (
    BLUE,
    COLOURS,
    DPI,
    INK,
    MARKERS,
    MUTED,
    VERMILLION,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.report.words import (
    Unit,
    capitalised,
    finite,
    joined,
    law_words,
    parameter_words,
    quantity_words,
    unit_for,
)
from jblast.waves.propagation import sound_speed_of

LEFT, RIGHT, ABOVE, BELOW, LINE = 0.95, 0.15, 0.4, 0.8, 0.15
"""Margins of a panel for tick labels, title and key, and one line of the key [inch]."""
BAND_MARGIN = 1.2
"""Factor by which the band of a time extends past its readings: further out it would
dwarf them."""
OFFSET_FROM = 1e5
"""Tick labels from this number on are too long to stand next to each other in full."""
MAX_NAME = 24
"""Longest sensor name that is written in full [characters]."""


def residuals_figure(fit: Fit) -> Figure:
    """Draw residuals [sd], one colour and marker a quantity, with lines at 2 sd.

    Radii at a time have a separate panel, against time.
    """
    quantities = list(dict.fromkeys(fit.observations.quantity))
    ranged = [q for q in quantities if q not in TIMED]
    timed = [q for q in quantities if q in TIMED]
    panels = [panel for panel in (ranged, timed) if panel]
    figure = new_figure(7.2, 3.6 * len(panels))
    for i, panel in enumerate(panels):
        _residuals_panel(
            figure.add_subplot(len(panels), 1, i + 1), fit, panel, quantities
        )
    return figure


def _residuals_panel(
    axes: Axes, fit: Fit, panel: list[str], quantities: list[str]
) -> None:
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
    # At residuals near 0 marks lie on one another: each shows the ones below it, and
    # later ones are smaller.
    sizes = np.linspace(6 + min(1.5 * (len(panel) - 1), 5), 6, len(panel))
    for quantity, size in zip(panel, sizes, strict=True):
        i = quantities.index(quantity)
        rows = here & np.array([q == quantity for q in table.quantity])
        colour, bounds = COLOURS[i % len(COLOURS)], table.bounds()
        axes.plot(
            along[rows & ~bounds] / unit.size,
            fit.residual[rows & ~bounds],
            linestyle="none",
            marker=MARKERS[i % len(MARKERS)],
            markerfacecolor=to_rgba(colour, 0.25),
            markersize=size,
            markeredgecolor=colour,
            markeredgewidth=1.2,
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
            at = float(along[row]) / unit.size, float(fit.residual[row])
            _ringed(axes, at, table.sensor[row], INK, xytext=(11, 0), va="center")
    quiet(axes)
    axes.grid(False, axis="y")
    if np.any(here) and np.all(along[here] > 0.0):
        axes.set_xscale("log")
        log_ticks(axes.xaxis, axes.get_xlim())
    bottom, top = axes.get_ylim()
    # both lines at 2 sd are in view, however good the fit
    axes.set_ylim(min(bottom, -3.2), max(top, 3.2))
    axes.set_ylabel("residual (sd)")
    words = "time after detonation" if against_time else "slant range"
    axes.set_xlabel(f"{words} ({unit.symbol})")
    open_ones = "; open: lower bounds, at 0 if satisfied"
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


def _ringed(
    axes: Axes,
    at: tuple[float, float],
    name: str,
    colour: str,
    ring: Mapping[str, Any] | None = None,
    **place: Any,
) -> None:
    """Draw a ring about a point, with the name of its sensor."""
    look = {"markersize": 13, "markerfacecolor": "none", "markeredgecolor": colour}
    axes.plot(*at, "o", **(look | dict(ring or {})))
    # names come from logs: a "$" in one is no formula
    axes.annotate(
        name if len(name) <= MAX_NAME else name[: MAX_NAME - 1] + "…",
        at,
        textcoords="offset points",
        fontsize=9,
        color=colour,
        parse_math=False,
        **place,
    )


def recordings_figure(fit: Fit) -> Figure:
    """Draw one panel a quantity and charge: points with errors, law, 5-95 % band.

    The law is evaluated at the answer; its line is dashed outside its range of
    validity. Suspected outliers are ringed.
    """
    panels = list(dict.fromkeys(zip(fit.observations.quantity, fit.shot, strict=True)))
    columns = min(len(panels), 2)
    rows = -(-len(panels) // columns)
    key = _recordings_key(fit, columns)
    width, height = 7.2 if columns == 1 else 10.5, 4.0 * rows + 0.3
    foot = BELOW + LINE * key.count("\n")
    # the grid is computed here: constrained layout takes as long as drawing
    figure = Figure(figsize=(width, height), dpi=DPI)
    grid = figure.subplots(rows, columns, squeeze=False)
    figure.subplots_adjust(
        left=LEFT / width,
        right=1 - RIGHT / width,
        bottom=foot / height,
        top=1 - ABOVE / height,
        wspace=_gap(columns, width - LEFT - RIGHT, LEFT + RIGHT),
        hspace=_gap(rows, height - foot - ABOVE, BELOW + ABOVE - 2 * LINE),
    )
    for axes, (quantity, shot) in zip(grid.flat, panels, strict=False):
        _recordings_panel(axes, fit, quantity, shot)
    for axes in list(grid.flat)[len(panels) :]:
        axes.set_axis_off()
    figure.supxlabel(key, fontsize=9, color=MUTED)
    return figure


def _gap(panels: int, room: float, gap: float) -> float:
    """Return the gap between panels as a share of a panel, for `subplots_adjust`."""
    return gap * panels / (room - gap * (panels - 1))


def _recordings_panel(axes: Axes, fit: Fit, quantity: str, shot: int) -> None:
    table = fit.observations
    rows = np.flatnonzero(
        np.isin(table.quantity, quantity) & (np.array(fit.shot) == shot)
    )
    band = next(
        (b for b in fit.bands if (b.quantity, b.shot) == (quantity, shot)), None
    )
    against_time = quantity in TIMED
    less = reduction(fit, quantity, shot)
    clock = common_clock(fit)[rows]
    t0 = float(fit.scene.charges[shot].time_s)
    if against_time:
        x, value = table.time[rows] - clock - t0, table.value[rows]
        # radii are drawn against the time since detonation, as laws have it
        band_x = None if band is None else band.x - t0
    else:
        offset = clock if less and quantity != "arrival_difference_s" else 0.0
        x, value = fit.distance[rows], table.value[rows] - offset
        band_x = None if band is None else band.x
    low, high = _error_bars(quantity, value, fit.sd[rows])
    y, low, high = (_shown(less, v, x) for v in (value, low, high))
    additive = quantity in ADDITIVE
    x_unit = unit_for("_s" if against_time else "_m", *_finite(x))
    y_unit = unit_for(quantity, *_finite(y))
    if band is not None and band_x is not None:
        beside = np.isfinite(band_x)
        if additive and _finite(x):
            beside &= (band_x >= np.nanmin(x) / BAND_MARGIN) & (
                band_x <= np.nanmax(x) * BAND_MARGIN
            )
        _draw_band(axes, band, band_x, beside, less, x_unit, y_unit)
    x, y, low, high = (
        x / x_unit.size,
        y / y_unit.size,
        low / y_unit.size,
        high / y_unit.size,
    )
    drawn = np.isfinite(x) & np.isfinite(y)
    bars = np.nan_to_num(np.stack([y - low, high - y])[:, drawn])
    style = {"markersize": 4.5, "color": INK, "elinewidth": 1.1, "zorder": 3}
    bound = table.bounds()[rows][drawn]
    for some, fmt in ((~bound, "o"), (bound, "^")):
        of = {"yerr": bars[:, some], "fmt": fmt} | style
        # a lower bound has no error bar: the value was at least this
        if fmt == "^":
            of |= {"yerr": None, "markerfacecolor": "white", "markersize": 7}
        if some.any():
            axes.errorbar(x[drawn][some], y[drawn][some], **of)
    _ring(axes, fit, rows, x, y)
    quiet(axes)
    _scales(axes, x[drawn], logarithmic=not additive)
    if additive and np.any(drawn):
        _frame(axes, [low[drawn], high[drawn]])
    label = less.label if less else quantity_words(quantity)
    axes.set_ylabel(_with_unit(label, y_unit))
    along = "time after detonation" if against_time else "slant range"
    axes.set_xlabel(_with_unit(along, x_unit))
    law = fit.summary.law.get(quantity, "")
    of = f" of {fit.scene.charges[shot].name}" if fit.scene.others else ""
    titled(axes, capitalised(quantity_words(quantity)) + of, law_words(law))


def _error_bars(
    quantity: str, value: Float[np.ndarray, " n"], sd: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    # errors of times are in seconds, those of other quantities are of ln
    if quantity in ADDITIVE:
        return value - sd, value + sd
    return value * np.exp(-sd), value * np.exp(sd)


@dataclass(frozen=True)
class Reduction:
    """A time linear in range, to be subtracted from arrivals.

    Attributes:
        origin: Constant part, on the common clock [s].
        slowness: Slope [s/m].
        label: Axis label of the remaining time.
    """

    origin: float
    slowness: float
    label: str

    def __call__(
        self, time: Float[np.ndarray, " n"], distance: Float[np.ndarray, " n"]
    ) -> Float[np.ndarray, " n"]:
        """Return times minus this time."""
        return time - self.origin - distance * self.slowness


def _shown(
    less: Reduction | None, value: Float[np.ndarray, " n"], x: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    return value if less is None else less(value, x)


def _finite(values: Float[np.ndarray, " n"]) -> list[float]:
    return [float(v) for v in values if np.isfinite(v)]


def _with_unit(words: str, unit: Unit) -> str:
    return f"{words} ({unit.symbol})" if unit.symbol else words


def _draw_band(
    axes: Axes,
    band: Band,
    x: Float[np.ndarray, " point"],
    beside: Bool[np.ndarray, " point"],
    less: Reduction | None,
    x_unit: Unit,
    y_unit: Unit,
) -> None:
    low, middle, high = (
        _shown(less, q, x) / y_unit.size for q in (band.q05, band.answer, band.q95)
    )
    x = x / x_unit.size
    finite = np.isfinite(low + middle + high) & beside
    if less is None:
        finite &= (low > 0.0) & (x > 0.0)
    for start, stop, valid in runs(band.valid):
        part = np.arange(start, stop)
        part = part[finite[part]]
        # extrapolated parts are fainter and dashed
        shade, line = (0.22, "-") if valid else (0.10, (0, (4, 2.5)))
        axes.fill_between(
            x[part], low[part], high[part], color=BLUE, alpha=shade, linewidth=0
        )
        axes.plot(x[part], middle[part], color=BLUE, linewidth=1.6, linestyle=line)


def runs(flags: Bool[np.ndarray, " n"]) -> list[tuple[int, int, bool]]:
    """Split flags into segments (start, stop, flag) that share their end points."""
    edges = np.flatnonzero(np.diff(flags.astype(int))) + 1
    bounds = [0, *(int(e) for e in edges), len(flags)]
    return [
        (start, min(stop + 1, len(flags)), bool(flags[start]))
        for start, stop in pairwise(bounds)
        if stop > start
    ]


def _ring(
    axes: Axes,
    fit: Fit,
    rows: np.ndarray,
    x: Float[np.ndarray, " n"],
    y: Float[np.ndarray, " n"],
) -> None:
    suspected = outlier_rows(fit)
    for i, row in enumerate(rows):
        if int(row) not in suspected or not np.isfinite(x[i] + y[i]):
            continue
        ring, name = {"markeredgewidth": 1.6, "zorder": 4}, fit.observations.sensor[row]
        place = {"xytext": (0, 10), "ha": "center", "va": "bottom"}
        _ringed(axes, (x[i], y[i]), name, VERMILLION, ring, **place)


def _scales(axes: Axes, x: Float[np.ndarray, " n"], logarithmic: bool) -> None:
    if len(x) and np.all(x > 0.0):
        axes.set_xscale("log")
        log_ticks(axes.xaxis, axes.get_xlim())
    if logarithmic:
        axes.set_yscale("log")
        log_ticks(axes.yaxis, axes.get_ylim())


def _frame(axes: Axes, readings: list[Float[np.ndarray, " n"]]) -> None:
    """Set the limits so that readings, law and its whole band are visible."""
    seen = list(readings)
    seen += [np.asarray(line.get_ydata(), float) for line in axes.get_lines()]
    for drawn in axes.collections:
        if isinstance(drawn, PolyCollection):
            seen += [np.asarray(p.vertices)[:, 1] for p in drawn.get_paths()]
    every = np.concatenate(seen)
    every = every[np.isfinite(every)]
    # a single reading has no extent
    margin = 0.08 * max(np.ptp(every), 1e-9)
    axes.set_ylim(every.min() - margin, every.max() + margin)


def _recordings_key(fit: Fit, columns: int) -> str:
    """Return the key of the marks, in a few lines."""
    key = ["points: recordings ± 1 sd"]
    if fit.bands:
        key += ["line: the law at the answer", "band: 5 to 95 % of the posterior"]
    if any(not np.all(band.valid) for band in fit.bands):
        key.append("dashed: outside the law's range")
    if fit.bands and (
        float(fit.scene.air.wind_east),
        float(fit.scene.air.wind_north),
    ) != (0.0, 0.0):
        key.append("band: in still air")
    if fit.observations.bounds().any():
        key.append("open triangles: lower bounds")
    if outlier_rows(fit):
        key.append("ringed: suspected outlier")
    a_line = 3 if columns == 1 else 5
    lines = [key[i : i + a_line] for i in range(0, len(key), a_line)]
    return "\n".join("   ·   ".join(line) for line in lines)


def axis_sound_speed(fit: Fit) -> float:
    """Return the speed of sound at the answer [m/s], for reduced arrivals.

    If it is not identified, the sound speed at the air's temperature is returned.
    """
    air = fit.scene.air
    if air.sound_speed is not None and (
        "air_sound_speed_m_s" not in fit.summary.unidentified
    ):
        return float(air.sound_speed)
    return float(sound_speed_of(replace(air, sound_speed=None)))


def reduction(fit: Fit, quantity: str, shot: int) -> Reduction | None:
    """Return the time subtracted from a quantity; None if its value is plotted."""
    t0 = float(fit.scene.charges[shot].time_s)
    air = axis_sound_speed(fit)
    ground = float(fit.scene.ground.p_speed)
    if quantity == "air_arrival_s":
        return Reduction(t0, 1 / air, f"travel time − range / {air:.1f} m/s")
    if quantity == "ground_arrival_s":
        return Reduction(t0, 1 / ground, f"travel time − range / {ground:.0f} m/s")
    if quantity == "arrival_difference_s":
        label = f"difference − range × (1/{air:.1f} − 1/{ground:.0f}) s/m"
        return Reduction(0.0, 1 / air - 1 / ground, label)
    if quantity == "flash_time_s":
        return Reduction(t0, 1 / LIGHT_SPEED, "flash − origin time")
    return None


def common_clock(fit: Fit) -> Float[np.ndarray, " row"]:
    """Return the offset of each row's clock from the common clock [s]."""
    offsets = fit.scene.clock_offsets()
    values = [
        # an unidentified offset is arbitrary: it would shift the points at random
        0.0 if f"clock_offset_s.{clock}" in fit.summary.unidentified else offset
        for clock, offset in offsets.items()
    ]
    by_name = dict(zip(offsets, map(float, values), strict=True))
    return np.array([by_name.get(clock, 0.0) for clock in fit.observations.clocks()])


def drawn_parameters(fit: Fit) -> list[str]:
    """Return the parameters whose draws can be plotted: finite, not all equal."""
    return [
        name
        for name in fit.summary.free
        if name in fit.draws
        and fit.summary.estimates[name].identified
        and len(fit.draws[name]) > 1
        and bool(np.all(np.isfinite(fit.draws[name])))
        # corner raises an error if all draws of a parameter are equal
        and np.ptp(fit.draws[name]) > 0.0
    ]


def absent_note(fit: Fit) -> str:
    """Return a sentence on free parameters missing from the corner plot, or ""."""
    absent = [n for n in fit.summary.free if n not in drawn_parameters(fit)]
    if not absent:
        return ""
    words = joined([parameter_words(name) for name in absent])
    return f"Not shown, as not identified: {words}."


def corner_figure(fit: Fit, accepted: Accepted | None = None) -> Figure | None:
    """Draw the posterior of every identified parameter; None if there is none.

    One parameter gives a histogram, more give a corner plot. Accepted values are lines.
    """
    names = drawn_parameters(fit)
    if not names:
        return None
    units = {n: _unit(fit, n) for n in names}
    draws = {n: np.asarray(fit.draws[n], float) / units[n].size for n in names}
    truths = {
        n: float(accepted[n][0]) / units[n].size
        for n in names
        if accepted and n in accepted
    }
    if len(names) == 1:
        figure = _histogram(fit, names[0], draws[names[0]], units[names[0]], truths)
    else:
        figure = _corner(fit, names, draws, units, truths)
    _corner_key(figure, len(names), bool(truths), absent_note(fit))
    return figure


def _corner_key(figure: Figure, count: int, has_truths: bool, note: str) -> None:
    key = ["blue line: value" if count == 1 else "contours: 50 and 90 %"]
    key += ["shaded: 90 % interval"] + [
        "orange: accepted value, if in view"
    ] * has_truths
    # a histogram has no empty corner: its key is below
    if count == 1:
        lines = ["   ·   ".join(key), *textwrap.wrap(note, 90)]
        figure.supxlabel("\n".join(lines), fontsize=9, color=MUTED)
        return
    # the key stands in the empty upper right, which is narrow for two parameters
    lines = key + textwrap.wrap(note, 26 if count == 2 else 40)
    place = {"ha": "right", "va": "top", "fontsize": 9, "color": MUTED}
    figure.text(0.98, 0.98, "\n".join(lines), **place)


def _unit(fit: Fit, name: str) -> Unit:
    return unit_for(name, finite(fit.summary.estimates[name].value))


def _label(name: str, unit: Unit) -> str:
    words = parameter_words(name)
    return f"{words} ({unit.symbol})" if unit.symbol else words


def _wide(fit: Fit, name: str) -> bool:
    log_sd = finite(fit.summary.estimates[name].log_sd)
    return (log_sd or 0.0) > WIDE_LOG_SD and bool(np.all(fit.draws[name] > 0.0))


def _histogram(
    fit: Fit,
    name: str,
    draws: Float[np.ndarray, " draw"],
    unit: Unit,
    truths: dict[str, float],
) -> Figure:
    figure = new_figure(7.2, 3.6)
    axes = figure.subplots()
    # the outermost draws of a long tail would squeeze the bars into a few
    first, last = (float(q) for q in np.quantile(draws, [0.001, 0.999]))
    # bars of equal width on a logarithmic axis
    spaced = np.geomspace if _wide(fit, name) else np.linspace
    axes.hist(draws, list(spaced(first, last, 41)), color=BLUE, alpha=0.35)
    estimate = fit.summary.estimates[name]
    _shade_interval(axes, estimate, unit)
    axes.axvline(estimate.value / unit.size, color=BLUE, linewidth=1.6)
    for truth in truths.values():
        axes.axvline(truth, color=VERMILLION, linewidth=1.6)
    quiet(axes)
    axes.grid(False)
    axes.spines["left"].set_visible(False)
    axes.set_yticks([])
    if _wide(fit, name):
        axes.set_xscale("log")
        log_ticks(axes.xaxis, axes.get_xlim())
    axes.set_xlabel(_label(name, unit))
    printed = printed_estimate(name, estimate)
    title = f"{capitalised(parameter_words(name))} {printed.value}"
    titled(axes, title, f"90 %: {printed.interval}")
    return figure


def _corner(
    fit: Fit,
    names: list[str],
    draws: dict[str, Float[np.ndarray, " draw"]],
    units: dict[str, Unit],
    truths: dict[str, float],
) -> Figure:
    corner = _corner_package()
    count = len(names)
    side = max(2.3 * count + 0.6, 5.4)
    figure = Figure(figsize=(side, side), dpi=DPI)
    scales = ["log" if _wide(fit, n) else "linear" for n in names]
    with warnings.catch_warnings():
        # corner warns of few draws, whose contours are rough but not wrong
        warnings.filterwarnings("ignore", message="Too few points")
        corner.corner(
            np.stack([draws[n] for n in names], axis=1),
            fig=figure,
            labels=[_label(n, units[n]) for n in names],
            color=BLUE,
            bins=30,
            smooth=1.0,
            levels=(0.5, 0.9),
            plot_datapoints=False,
            plot_density=False,
            fill_contours=True,
            contourf_kwargs={"colors": ["white", "#cfe3f0", "#8dbfdf"]},
            smooth1d=1.0,
            axes_scale=scales,  # pyright: ignore[reportArgumentType]  a list will do
            max_n_ticks=3,
            label_kwargs={"fontsize": 10, "color": INK},
        )
    grid = np.array(figure.axes).reshape(count, count)
    for i, name in enumerate(names):
        estimate = fit.summary.estimates[name]
        _shade_interval(grid[i, i], estimate, units[name])
        printed = printed_estimate(name, estimate)
        title = f"{printed.value}\n{printed.interval}"
        grid[i, i].set_title(title, fontsize=9, color=INK)
        if name in truths:
            _accepted_lines(grid, i, truths[name])
        if scales[i] == "log":
            log_ticks(grid[-1, i].xaxis, grid[-1, i].get_xlim())
            if i:
                log_ticks(grid[i, 0].yaxis, grid[i, 0].get_ylim())
    # after the scales are set, which replace formatters of ticks
    for axes in figure.axes:
        _in_full(axes.xaxis)
        _in_full(axes.yaxis)
        axes.tick_params(labelsize=8.5, color=MUTED, labelrotation=0)
        axes.xaxis.set_label_coords(0.5, -0.17)
        axes.yaxis.set_label_coords(-0.28, 0.5)
        axes.spines[:].set_color(MUTED)
    figure.subplots_adjust(
        left=0.95 / side, right=1 - 0.15 / side, bottom=0.65 / side, top=1 - 0.5 / side
    )
    return figure


def _in_full(axis: Axis) -> None:
    """Write tick labels in full: an offset text would overlap the panel above."""
    formatter = axis.get_major_formatter()
    short = np.abs(axis.get_view_interval()).max() < OFFSET_FROM
    if short and isinstance(formatter, ScalarFormatter):
        formatter.set_useOffset(False)


def _corner_package():
    """Import corner without ArviZ, which is optional for it.

    The draws are arrays here, and importing ArviZ takes longer than drawing all the
    figures. Later imports of corner elsewhere are complete.
    """
    if "corner" in sys.modules or "arviz" in sys.modules:
        import corner

        return corner
    sys.modules["corner.arviz_corner"] = cast(ModuleType, None)
    import corner

    for name in [name for name in sys.modules if name.partition(".")[0] == "corner"]:
        del sys.modules[name]
    return corner


def _accepted_lines(grid: np.ndarray, i: int, truth: float) -> None:
    """Draw an accepted value through its column and its row, where it is in view."""
    low, high = grid[i, i].get_xlim()
    if not low <= truth <= high:
        return
    for axes in grid[i:, i]:
        axes.axvline(truth, color=VERMILLION, linewidth=1.5)
    for axes in grid[i, :i]:
        axes.axhline(truth, color=VERMILLION, linewidth=1.5)


def _shade_interval(axes: Axes, estimate: Estimate, unit: Unit) -> None:
    low, high = finite(estimate.q05), finite(estimate.q95)
    if low is not None and high is not None:
        axes.axvspan(low / unit.size, high / unit.size, color=BLUE, alpha=0.10, lw=0)
