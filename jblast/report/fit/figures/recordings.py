"""The recordings against range, with what the posterior says between them."""

from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from jblast.inference.fitting.result import Band, Fit
from jblast.quantities import ADDITIVE, TIMED
from jblast.report.figure_style import (
    BLUE,
    DPI,
    INK,
    MUTED,
    VERMILLION,
    log_ticks,
    quiet,
    titled,
)
from jblast.report.fit.figures.reduced_time import Reduction, common_clock, reduction
from jblast.report.fit.rows import outlier_rows
from jblast.report.numbers import Unit, unit_for
from jblast.report.words import capitalised, law_words, quantity_words

LEFT, RIGHT, ABOVE, BELOW, LINE = 0.95, 0.15, 0.4, 0.8, 0.15
"""What stands about a panel: numbers, names, the key and a line of it [inch]."""
BESIDE = 1.2
"""The band of a time goes this much further than its readings, as a factor."""


def recordings_figure(fit: Fit) -> Figure:
    """Draw one panel a quantity and charge: points with errors, law, 5-95 % band.

    The law is that at the answer, where the points stand too; its line is dashed where
    it does not hold. Suspected outliers are ringed.
    """
    panels = list(dict.fromkeys(zip(fit.observations.quantity, fit.shot, strict=True)))
    columns = min(len(panels), 2)
    rows = -(-len(panels) // columns)
    key = _key(fit, columns)
    width, height = 7.2 if columns == 1 else 10.5, 4.0 * rows + 0.3
    foot = BELOW + LINE * key.count("\n")
    # a grid that is known needs no constrained layout, which takes as long as drawing
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
        _panel(axes, fit, quantity, shot)
    for axes in list(grid.flat)[len(panels) :]:
        axes.set_axis_off()
    figure.supxlabel(key, fontsize=9, color=MUTED)
    return figure


def _gap(panels: int, room: float, gap: float) -> float:
    """Return a gap between panels in their size, as a grid is told of it."""
    return gap * panels / (room - gap * (panels - 1))


def _panel(axes: Axes, fit: Fit, quantity: str, shot: int) -> None:
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
        if additive and _finite(x):  # further off it would dwarf the readings
            beside &= (band_x >= np.nanmin(x) / BESIDE) & (
                band_x <= np.nanmax(x) * BESIDE
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
        if fmt == "^":  # whatever it was, it was no less
            of |= {"yerr": None, "markerfacecolor": "white", "markersize": 7}
        if some.any():
            axes.errorbar(x[drawn][some], y[drawn][some], **of)
    _ring(axes, fit, rows, x, y)
    quiet(axes)
    _scales(axes, x[drawn], logarithmic=not additive)
    if additive and np.any(drawn):
        _frame(axes, [low[drawn], high[drawn]])
    what = less.label if less else quantity_words(quantity)
    axes.set_ylabel(_with_unit(what, y_unit))
    along = "time after detonation" if against_time else "slant range"
    axes.set_xlabel(_with_unit(along, x_unit))
    law = fit.summary.law.get(quantity, "")
    of = f" of {fit.scene.charges[shot].name}" if fit.scene.others else ""
    titled(axes, capitalised(quantity_words(quantity)) + of, law_words(law))


def _error_bars(
    quantity: str, value: Float[np.ndarray, " n"], sd: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    if quantity in ADDITIVE:
        return value - sd, value + sd
    return value * np.exp(-sd), value * np.exp(sd)


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
        shade, line = (0.22, "-") if valid else (0.10, (0, (4, 2.5)))
        axes.fill_between(
            x[part], low[part], high[part], color=BLUE, alpha=shade, linewidth=0
        )
        axes.plot(x[part], middle[part], color=BLUE, linewidth=1.6, linestyle=line)


def runs(flags: Bool[np.ndarray, " n"]) -> list[tuple[int, int, bool]]:
    """Split flags into stretches (start, stop, flag) that share their end points."""
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
        axes.plot(
            x[i], y[i], "o", markersize=13, markerfacecolor="none",
            markeredgecolor=VERMILLION, markeredgewidth=1.6, zorder=4,
        )  # fmt: skip
        name = fit.observations.sensor[row]
        axes.annotate(
            name if len(name) <= 24 else name[:23] + "…",
            (x[i], y[i]),
            xytext=(0, 10),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=9,
            color=VERMILLION,
            parse_math=False,
        )


def _scales(axes: Axes, x: Float[np.ndarray, " n"], logarithmic: bool) -> None:
    if len(x) and np.all(x > 0.0):
        axes.set_xscale("log")
        log_ticks(axes.xaxis, axes.get_xlim())
    if logarithmic:
        axes.set_yscale("log")
        log_ticks(axes.yaxis, axes.get_ylim())


def _frame(axes: Axes, readings: list[Float[np.ndarray, " n"]]) -> None:
    """Frame the readings, the law and the whole of its band."""
    seen = list(readings)
    seen += [np.asarray(line.get_ydata(), float) for line in axes.get_lines()]
    for drawn in axes.collections:
        if isinstance(drawn, PolyCollection):
            seen += [np.asarray(p.vertices)[:, 1] for p in drawn.get_paths()]
    every = np.concatenate(seen)
    every = every[np.isfinite(every)]
    margin = 0.08 * max(np.ptp(every), 1e-9)
    axes.set_ylim(every.min() - margin, every.max() + margin)


def _key(fit: Fit, columns: int) -> str:
    """Return what the marks mean, in a few lines."""
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
