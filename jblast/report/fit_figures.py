"""Figures of a fit.

Arrivals are drawn minus range over sound speed. Over two decades of range a millisecond
is invisible in an arrival. In the reduced arrival the lead of the shock over sound and
the residuals are visible.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import cycle
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, ScalarFormatter
from scipy.ndimage import gaussian_filter

from jblast.constants import LIGHT_SPEED
from jblast.inference.fitting.fit import Fit
from jblast.quantities import ADDITIVE, TIMED
from jblast.registry import law_words
from jblast.report.colours import BLUE, COLOURS, INK, MUTED, VERMILLION
from jblast.report.estimates import (
    WIDE_LOG_SD,
    Accepted,
    drawn_parameters,
    outlier_rows,
    printed_estimate,
)
from jblast.report.figures import (
    MARKERS,
    fixed_figure,
    log_ticks,
    new_figure,
    quiet,
    runs,
    titled,
)
from jblast.report.numbers import (
    Unit,
    capitalised,
    parameter_words,
    quantity_words,
    unit_for,
)
from jblast.waves.propagation import sound_speed_of

MARGIN = 1.2
"""Factor by which a band extends past its readings: further out it would dwarf them."""
MAX_NAME = 24
"""Longest sensor name that is written in full [characters]."""
DASHES = (0, (4, 3))
SHARES = (0.9, 0.5)
"""Shares of the posterior within its contours."""
BINS, SMOOTH = 30, 1.2
"""Bins of a histogram of draws in each direction, and its smoothing [bins]."""


def residuals_figure(fit: Fit) -> Figure:
    """Draw residuals [sd], one colour and marker a quantity, with lines at 2 sd.

    Radii at a time have a separate panel, against time.
    """
    quantities = list(dict.fromkeys(fit.observations.quantity))
    timed = [q for q in quantities if q in TIMED]
    others = [q for q in quantities if q not in TIMED]
    panels = [some for some in (others, timed) if some]
    figure = new_figure(7.2, 3.6 * len(panels))
    grid = figure.subplots(len(panels), 1, squeeze=False)
    for axes, some in zip(grid.flat, panels, strict=True):
        _residuals_panel(axes, fit, some)
    return figure


def _residuals_panel(axes: Axes, fit: Fit, quantities: list[str]) -> None:
    table, residual, bounds = fit.observations, fit.residual, fit.observations.bounds()
    along, unit, words = _along(fit, quantities[0], fit.origin_time)
    axes.axhspan(-2, 2, color="#f3f3f3", linewidth=0, zorder=0)
    axes.axhline(0.0, color=MUTED, linewidth=1.0)
    for level in (-2, 2):
        axes.axhline(level, color=MUTED, linewidth=1.0, linestyle=DASHES)
    here = np.isin(table.quantity, quantities)
    here &= np.isfinite(along) & np.isfinite(residual)
    for quantity, colour, marker in zip(quantities, cycle(COLOURS), cycle(MARKERS)):
        rows = here & np.isin(table.quantity, quantity)
        faint, style = to_rgba(colour, 0.25), dict[str, Any](markeredgecolor=colour)
        for some, face, label in (
            (rows & ~bounds, faint, quantity_words(quantity)),
            (rows & bounds, "white", f"{quantity_words(quantity)}, lower bound"),
        ):
            style |= {"markerfacecolor": face, "label": label}
            if some.any():
                axes.plot(along[some], residual[some], marker, **style)
    for row in outlier_rows(fit):
        if here[row]:
            at = float(along[row]), float(residual[row])
            _ringed(axes, at, table.sensor[row], INK, xytext=(11, 0), va="center")
    quiet(axes)
    axes.grid(False, axis="y")
    _scaled(axes, along[here])
    # both lines at 2 sd are in view, however good the fit
    bottom, top = axes.get_ylim()
    axes.set_ylim(min(bottom, -3.2), max(top, 3.2))
    axes.set_ylabel("residual (sd)")
    axes.set_xlabel(_with_unit(words, unit))
    titled(axes, "Measured minus law", "shaded: ± 2 sd")
    _legend(axes.figure, [axes], "outside lower center")


def _along(
    fit: Fit, quantity: str, origin_time: float | Float[np.ndarray, " row"]
) -> tuple[Float[np.ndarray, " row"], Unit, str]:
    """Return range or time since the detonation of each row, its unit and name."""
    table, words = fit.observations, "slant range"
    along = fit.distance
    if is_timed := quantity in TIMED:
        along = table.time - common_clock(fit) - origin_time
        words = "time after detonation"
    here = np.isfinite(along) & np.isin(table.quantity, quantity)
    unit = unit_for("_s" if is_timed else "_m", *along[here].tolist())
    return along / unit.size, unit, words


def _scaled(axes: Axes, along: Float[np.ndarray, " row"]) -> None:
    """Make the axis along range or time logarithmic."""
    if along.size and np.all(along > 0.0):
        axes.set_xscale("log")
        log_ticks(axes.xaxis, axes.get_xlim())


def _legend(figure: Any, panels: Iterable[Axes], place: str) -> None:
    """Name each kind of mark of some panels once."""
    named: dict[str, Any] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        named |= dict(zip(labels, handles, strict=True))
    if named:
        figure.legend(
            named.values(), named.keys(), loc=place, ncols=min(len(named), 4),
            frameon=False, fontsize=9, labelcolor=INK,
        )  # fmt: skip


def _ringed(
    axes: Axes, at: tuple[float, float], name: str, colour: str, **place: Any
) -> None:
    """Draw a ring about a point, with the name of its sensor."""
    look: dict[str, Any] = {"markersize": 13, "markeredgewidth": 1.5, "zorder": 4}
    look |= {"markerfacecolor": "none", "markeredgecolor": colour}
    axes.plot(*at, "o", label="suspected outlier", **look)
    short = name if len(name) <= MAX_NAME else name[: MAX_NAME - 1] + "…"
    # names come from logs: a "$" in one is no formula
    axes.annotate(
        short, at, textcoords="offset points", fontsize=9, color=colour,
        parse_math=False, **place,
    )  # fmt: skip


def recordings_figure(fit: Fit) -> Figure:
    """Draw one panel a quantity and charge: points with errors, law, 5-95 % band.

    The law is evaluated at the answer; its line is dashed outside its range of
    validity. Suspected outliers are ringed.
    """
    panels = list(dict.fromkeys(zip(fit.observations.quantity, fit.shot, strict=True)))
    columns = min(len(panels), 2)
    rows = -(-len(panels) // columns)
    width = 7.2 if columns == 1 else 10.5
    figure = fixed_figure(width, 4.0 * rows + 0.3, (0.95, 0.15, 0.9, 0.4))
    # gaps for labels and titles, in mean widths and heights of a panel [inch]
    gaps = {"wspace": 1.1 / (width / columns - 1.1), "hspace": 0.9 / 3.1}
    grid = list(figure.subplots(rows, columns, squeeze=False, gridspec_kw=gaps).flat)
    for axes, (quantity, shot) in zip(grid, panels, strict=False):
        _recordings_panel(axes, fit, quantity, shot)
    for axes in grid[len(panels) :]:
        axes.set_axis_off()
    _legend(figure, grid, "lower center")
    return figure


def _recordings_panel(axes: Axes, fit: Fit, quantity: str, shot: int) -> None:
    table, additive = fit.observations, quantity in ADDITIVE
    t0 = float(fit.scene.charges[shot].time_s)
    less = reduction(fit, quantity, shot)
    x, x_unit, along = _along(fit, quantity, t0)
    value = table.value
    if less.label and quantity != "arrival_difference_s":
        value = value - common_clock(fit)
    # errors of times are in seconds, those of other quantities are of ln
    low, high = value - fit.sd, value + fit.sd
    if not additive:
        low, high = value / np.exp(fit.sd), value * np.exp(fit.sd)
    taken = less.origin + x * x_unit.size * less.slowness
    y, low, high = (one - taken for one in (value, low, high))
    rows = np.isin(table.quantity, quantity) & (np.array(fit.shot) == shot)
    rows &= np.isfinite(x) & np.isfinite(y)
    y_unit = unit_for(quantity, *y[rows].tolist())
    y, low, high = (one / y_unit.size for one in (y, low, high))
    for band in fit.bands:
        if (band.quantity, band.shot) == (quantity, shot) and rows.any():
            # radii are drawn against the time since detonation, as laws have it
            start = t0 if quantity in TIMED else 0.0
            curves = (band.q05, band.answer, band.q95)
            of = less.origin + band.x * less.slowness
            drawn = [(one - of) / y_unit.size for one in curves]
            _draw_band(axes, (band.x - start) / x_unit.size, drawn, band.valid, x[rows])
    bars = np.nan_to_num(np.stack([y - low, high - y]))
    for some, shape, face, label in (
        (rows & ~table.bounds(), "o", INK, "recording ± 1 sd"),
        # a lower bound has no error bar: the value was at least this
        (rows & table.bounds(), "^", "white", "lower bound"),
    ):
        error = bars[:, some] if shape == "o" else None
        style: dict[str, Any] = {
            "color": INK,
            "elinewidth": 1.1,
            "zorder": 3,
            "markersize": 4.5,
        }
        style |= {"markerfacecolor": face, "label": label}
        if some.any():
            axes.errorbar(x[some], y[some], error, fmt=shape, **style)
    for row in outlier_rows(fit):
        if rows[row]:
            place = {"xytext": (0, 10), "ha": "center", "va": "bottom"}
            at = float(x[row]), float(y[row])
            _ringed(axes, at, table.sensor[row], VERMILLION, **place)
    quiet(axes)
    _scaled(axes, x[rows])
    if not additive:
        axes.set_yscale("log")
        log_ticks(axes.yaxis, axes.get_ylim())
    axes.set_ylabel(_with_unit(less.label or quantity_words(quantity), y_unit))
    axes.set_xlabel(_with_unit(along, x_unit))
    of = f" of {fit.scene.charges[shot].name}" if len(fit.scene.charges) > 1 else ""
    law = law_words(fit.summary.law.get(quantity, ""))
    titled(axes, capitalised(quantity_words(quantity)) + of, law)


def _draw_band(
    axes: Axes,
    x: Float[np.ndarray, " point"],
    curves: Sequence[Float[np.ndarray, " point"]],
    valid: Bool[np.ndarray, " point"],
    readings: Float[np.ndarray, " row"],
) -> None:
    """Draw the law and its band near the readings."""
    low, middle, high = curves
    within = (x >= readings.min() / MARGIN) & (x <= readings.max() * MARGIN)
    within &= np.isfinite(low + middle + high)
    for start, stop, is_valid in runs(valid):
        part = np.arange(start, stop)
        part = part[within[part]]
        shade, style, label = 0.22, "-", "law at the answer"
        if not is_valid:
            shade, style, label = 0.10, DASHES, "outside the law's range"
        look: dict[str, Any] = {"color": BLUE, "alpha": shade, "linewidth": 0}
        if part.size:
            label_of_band = "5 to 95 % of the posterior" if is_valid else None
            axes.fill_between(
                x[part], low[part], high[part], label=label_of_band, **look
            )
            axes.plot(x[part], middle[part], color=BLUE, linestyle=style, label=label)


class Reduction(NamedTuple):
    """A time linear in range, to be subtracted from arrivals.

    Attributes:
        origin: Constant part, on the common clock [s].
        slowness: Slope [s/m].
        label: Axis label of the remaining time; "" if the value is plotted.
    """

    origin: float = 0.0
    slowness: float = 0.0
    label: str = ""


def _with_unit(words: str, unit: Unit) -> str:
    return f"{words} ({unit.symbol})" if unit.symbol else words


def reduction(fit: Fit, quantity: str, shot: int) -> Reduction:
    """Return the time subtracted from a quantity; nothing if its value is plotted."""
    t0, air = float(fit.scene.charges[shot].time_s), fit.scene.air
    # if it is not identified, the sound speed at the air's temperature
    if air.sound_speed is None or "air_sound_speed_m_s" in fit.summary.unidentified:
        sound = float(sound_speed_of(replace(air, sound_speed=None)))
    else:
        sound = float(air.sound_speed)
    ground = float(fit.scene.ground.p_speed)
    through_air = f"travel time − range / {sound:.1f} m/s"
    through_ground = f"travel time − range / {ground:.0f} m/s"
    difference = f"difference − range × (1/{sound:.1f} − 1/{ground:.0f}) s/m"
    return {
        "air_arrival_s": Reduction(t0, 1 / sound, through_air),
        "ground_arrival_s": Reduction(t0, 1 / ground, through_ground),
        "arrival_difference_s": Reduction(0.0, 1 / sound - 1 / ground, difference),
        "flash_time_s": Reduction(t0, 1 / LIGHT_SPEED, "flash − origin time"),
    }.get(quantity, Reduction())


def common_clock(fit: Fit) -> Float[np.ndarray, " row"]:
    """Return the offset of each row's clock from the common clock [s]."""
    by_name = {
        # an unidentified offset is arbitrary: it would shift the points at random
        clock: 0.0
        if f"clock_offset_s.{clock}" in fit.summary.unidentified
        else float(offset)
        for clock, offset in fit.scene.clock_offsets().items()
    }
    return np.array([by_name.get(clock, 0.0) for clock in fit.observations.clocks()])


class _Drawn(NamedTuple):
    """Draws of a parameter in its printed unit, with the edges of their bins."""

    draws: Float[np.ndarray, " draw"]
    edges: Float[np.ndarray, " edge"]
    scale: str
    label: str
    title: str
    value: float
    accepted: float | None


def _drawn(fit: Fit, name: str, accepted: Accepted) -> _Drawn:
    estimate = fit.summary.estimates[name]
    unit = unit_for(name, estimate.value)
    draws = np.asarray(fit.draws[name], float) / unit.size
    is_wide = estimate.log_sd > WIDE_LOG_SD and np.all(draws > 0.0)
    # the outermost draws of a long tail would squeeze the others into a few bins
    first, last = np.quantile(draws, [0.001, 0.999])
    # bins of equal width on a logarithmic axis
    edges = (np.geomspace if is_wide else np.linspace)(first, last, BINS + 1)
    printed = printed_estimate(name, estimate)
    known = accepted[name][0] / unit.size if name in accepted else None
    return _Drawn(
        draws,
        edges,
        "log" if is_wide else "linear",
        _with_unit(parameter_words(name), unit),
        f"{printed.value}\n{printed.interval}",
        estimate.value / unit.size,
        known,
    )


def corner_figure(fit: Fit, accepted: Accepted | None = None) -> Figure:
    """Draw the posterior of every identified parameter, alone and in pairs.

    Accepted values are lines.
    """
    every = [_drawn(fit, name, accepted or {}) for name in drawn_parameters(fit)]
    count = len(every)
    side = max(2.3 * count + 0.6, 4.0)
    figure = fixed_figure(side, side, (0.95, 0.15, 0.65, 0.5))
    gaps = {"wspace": 0.05, "hspace": 0.05}
    grid = figure.subplots(count, count, squeeze=False, gridspec_kw=gaps)
    for (i, j), axes in np.ndenumerate(grid):
        up, along = every[i], every[j]
        if j > i:
            axes.set_axis_off()
            continue
        if i == j:
            _marginal(axes, along)
        else:
            _joint(axes, along, up)
            _corner_axis(axes, "y", up)
        _corner_axis(axes, "x", along)
        axes.tick_params(labelbottom=i == count - 1, labelleft=j == 0, labelsize=8.5)
        axes.spines[:].set_color(MUTED)
        if i == count - 1:
            axes.set_xlabel(along.label)
        if j == 0 < i:
            axes.set_ylabel(up.label)
            axes.yaxis.set_label_coords(-0.28, 0.5)
    return figure


def _marginal(axes: Axes, one: _Drawn) -> None:
    """Draw the histogram of a parameter with its value and its interval."""
    counts = gaussian_filter(np.histogram(one.draws, one.edges)[0] * 1.0, SMOOTH)
    axes.stairs(counts, one.edges, color=BLUE, linewidth=1.2)
    axes.stairs(counts, one.edges, color=BLUE, fill=True, alpha=0.2)
    axes.axvspan(*np.quantile(one.draws, [0.05, 0.95]), color=BLUE, alpha=0.10, lw=0)
    axes.axvline(one.value, color=BLUE, linewidth=1.6)
    axes.set_yticks([])
    axes.set_title(one.title, fontsize=9, color=INK)
    if one.accepted is not None:
        axes.axvline(one.accepted, color=VERMILLION, linewidth=1.5)


def _joint(axes: Axes, along: _Drawn, up: _Drawn) -> None:
    """Draw the regions of the densest bins that have `SHARES` of the draws."""
    counts, *_ = np.histogram2d(along.draws, up.draws, [along.edges, up.edges])
    density = gaussian_filter(counts, SMOOTH)
    falling = np.sort(density, axis=None)[::-1]
    within = np.cumsum(falling) / falling.sum()
    levels = [float(falling[np.searchsorted(within, share)]) for share in SHARES]
    # few draws may leave one level for both shares
    if levels[0] < levels[1] < falling[0]:
        x, y = (0.5 * (one.edges[:-1] + one.edges[1:]) for one in (along, up))
        fills = [*levels, float(falling[0])]
        axes.contourf(x, y, density.T, fills, colors=["#cfe3f0", "#8dbfdf"])
        axes.contour(x, y, density.T, levels, colors=BLUE, linewidths=1.0)
    else:
        axes.plot(along.draws, up.draws, ".", color=BLUE, markersize=2)
    for line, one in ((axes.axvline, along), (axes.axhline, up)):
        if one.accepted is not None:
            line(one.accepted, color=VERMILLION, linewidth=1.5)


def _corner_axis(axes: Axes, name: str, one: _Drawn) -> None:
    """Set limits, scale and few tick labels, in full."""
    limits = float(one.edges[0]), float(one.edges[-1])
    axes.set(**{f"{name}scale": one.scale, f"{name}lim": limits})
    axis = axes.xaxis if name == "x" else axes.yaxis
    if one.scale == "log":
        log_ticks(axis, limits)
    else:
        axis.set_major_locator(MaxNLocator(3))
        # an offset text would overlap the panel above
        axis.set_major_formatter(ScalarFormatter(useOffset=False))
