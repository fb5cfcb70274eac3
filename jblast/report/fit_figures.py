"""Figures of a fit.

Arrivals are drawn minus range over sound speed. Over two decades of range a millisecond
is invisible in an arrival. In the reduced arrival the lead of the shock over sound and
the residuals are visible.
"""

import textwrap
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, ScalarFormatter
from scipy.ndimage import gaussian_filter

from jblast.constants import LIGHT_SPEED
from jblast.inference.fitting.fit import Band, Fit
from jblast.quantities import ADDITIVE, TIMED
from jblast.registry import law_words
from jblast.report.estimates import (
    WIDE_LOG_SD,
    Accepted,
    absent_note,
    drawn_parameters,
    outlier_rows,
    printed_estimate,
)
from jblast.report.figures import (
    BLUE,
    COLOURS,
    INK,
    MARKERS,
    MUTED,
    VERMILLION,
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
    finite,
    parameter_words,
    quantity_words,
    unit_for,
)
from jblast.waves.propagation import sound_speed_of

BAND_MARGIN = 1.2
"""Factor by which the band of a time extends past its readings: further out it would
dwarf them."""
OFFSET_FROM = 1e5
"""Tick labels from this number on are too long to stand next to each other in full."""
MAX_NAME = 24
"""Longest sensor name that is written in full [characters]."""
SHARES = (0.9, 0.5)
"""Shares of the posterior within its contours."""
BINS, SMOOTH = 30, 1.2
"""Bins of a histogram of draws in each direction, and its smoothing [bins]."""


def residuals_figure(fit: Fit) -> Figure:
    """Draw residuals [sd], one colour and marker a quantity, with lines at 2 sd.

    Radii at a time have a separate panel, against time.
    """
    quantities = list(dict.fromkeys(fit.observations.quantity))
    parts = (
        [q for q in quantities if q not in TIMED],
        [q for q in quantities if q in TIMED],
    )
    panels = [part for part in parts if part]
    figure = new_figure(7.2, 3.6 * len(panels))
    for i, panel in enumerate(panels, start=1):
        axes = figure.add_subplot(len(panels), 1, i)
        _residuals_panel(axes, fit, panel, quantities)
    return figure


def _residuals_panel(
    axes: Axes, fit: Fit, panel: list[str], quantities: list[str]
) -> None:
    table, bounds, along = fit.observations, fit.observations.bounds(), fit.distance
    against_time = panel[0] in TIMED
    if against_time:
        along = table.time - common_clock(fit) - fit.origin_time
    here = np.isin(table.quantity, panel)
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
        rows, colour = here & np.isin(table.quantity, quantity), COLOURS[i % 6]
        marker = MARKERS[i % len(MARKERS)]
        for some, face, shape, label in (
            (rows & ~bounds, to_rgba(colour, 0.25), marker, quantity_words(quantity)),
            (rows & bounds, "white", "^", None),
        ):
            axes.plot(
                along[some] / unit.size, fit.residual[some], shape, label=label,
                markerfacecolor=face, markersize=size, markeredgecolor=colour,
            )  # fmt: skip
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
    axes.set_xlabel(_with_unit(words, unit))
    open_ones = "; open: lower bounds, at 0 if satisfied"
    has_bounds = bool(np.any(bounds & here))
    titled(axes, "Measured minus law", f"shaded: ± 2 sd{open_ones * has_bounds}")
    if not np.any(here):
        axes.text(0.5, 0.6, "no residuals", transform=axes.transAxes, ha="center")
    elif len(quantities) > 1:
        axes.legend(
            loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=min(len(panel), 4),
            frameon=False, fontsize=9, labelcolor=INK, handletextpad=0.2,
        )  # fmt: skip


def _ringed(
    axes: Axes, at: tuple[float, float], name: str, colour: str, **place: Any
) -> None:
    """Draw a ring about a point, with the name of its sensor."""
    look: dict[str, Any] = {"markersize": 13, "markeredgewidth": 1.5, "zorder": 4}
    axes.plot(*at, "o", markerfacecolor="none", markeredgecolor=colour, **look)
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
    key = _recordings_key(fit, columns)
    width, foot = 7.2 if columns == 1 else 10.5, 0.8 + 0.15 * key.count("\n")
    figure = fixed_figure(width, 4.0 * rows + 0.3, (0.95, 0.15, foot, 0.4))
    # gaps for labels and titles, in mean widths and heights of a panel [inch]
    gaps = {"wspace": 1.1 / (width / columns - 1.1), "hspace": 0.9 / 3.1}
    grid = figure.subplots(rows, columns, squeeze=False, gridspec_kw=gaps)
    for axes, (quantity, shot) in zip(grid.flat, panels, strict=False):
        _recordings_panel(axes, fit, quantity, shot)
    for axes in list(grid.flat)[len(panels) :]:
        axes.set_axis_off()
    figure.supxlabel(key, fontsize=9, color=MUTED)
    return figure


def _recordings_panel(axes: Axes, fit: Fit, quantity: str, shot: int) -> None:
    table = fit.observations
    here = np.isin(table.quantity, quantity) & (np.array(fit.shot) == shot)
    rows = np.flatnonzero(here)
    bands = [b for b in fit.bands if (b.quantity, b.shot) == (quantity, shot)]
    against_time, additive = quantity in TIMED, quantity in ADDITIVE
    less, clock = reduction(fit, quantity, shot), common_clock(fit)[rows]
    t0 = float(fit.scene.charges[shot].time_s)
    x, value, sd = fit.distance[rows], table.value[rows], fit.sd[rows]
    if against_time:
        x = table.time[rows] - clock - t0
    elif less.label and quantity != "arrival_difference_s":
        value = value - clock
    # errors of times are in seconds, those of other quantities are of ln
    ends = (
        (value - sd, value + sd)
        if additive
        else (value / np.exp(sd), value * np.exp(sd))
    )
    y, low, high = (one - less.origin - x * less.slowness for one in (value, *ends))
    x_unit = unit_for("_s" if against_time else "_m", *x[np.isfinite(x)].tolist())
    y_unit = unit_for(quantity, *y[np.isfinite(y)].tolist())
    x = x / x_unit.size
    y, low, high = (one / y_unit.size for one in (y, low, high))
    drawn = np.isfinite(x) & np.isfinite(y)
    seen = [low[drawn], high[drawn]]
    for band in bands:
        # radii are drawn against the time since detonation, as laws have it
        band = replace(band, x=band.x - t0 if against_time else band.x)
        within = _band_within(x * x_unit.size, band) if additive else band.x > 0.0
        seen += _draw_band(axes, band, within, less, (x_unit, y_unit), not additive)
    bars = np.nan_to_num(np.stack([y - low, high - y]))
    style = {"color": INK, "elinewidth": 1.1, "zorder": 3}
    bound = table.bounds()[rows]
    if (some := drawn & ~bound).any():
        axes.errorbar(x[some], y[some], bars[:, some], fmt="o", markersize=4.5, **style)
    # a lower bound has no error bar: the value was at least this
    if (some := drawn & bound).any():
        axes.plot(x[some], y[some], "^", color=INK, markerfacecolor="white", zorder=3)
    for row in set(outlier_rows(fit)) & set(rows[drawn].tolist()):
        at = int(np.flatnonzero(rows == row)[0])
        place = {"xytext": (0, 10), "ha": "center", "va": "bottom"}
        _ringed(axes, (x[at], y[at]), table.sensor[row], VERMILLION, **place)
    quiet(axes)
    if drawn.any() and np.all(x[drawn] > 0.0):
        axes.set_xscale("log")
        log_ticks(axes.xaxis, axes.get_xlim())
    if not additive:
        axes.set_yscale("log")
        log_ticks(axes.yaxis, axes.get_ylim())
    elif drawn.any():
        # readings, law and its whole band are visible; a single reading has no extent
        every = np.concatenate(seen)
        margin = 0.08 * max(np.ptp(every), 1e-9)
        axes.set_ylim(every.min() - margin, every.max() + margin)
    axes.set_ylabel(_with_unit(less.label or quantity_words(quantity), y_unit))
    along = "time after detonation" if against_time else "slant range"
    axes.set_xlabel(_with_unit(along, x_unit))
    of = f" of {fit.scene.charges[shot].name}" if fit.scene.others else ""
    law = law_words(fit.summary.law.get(quantity, ""))
    titled(axes, capitalised(quantity_words(quantity)) + of, law)


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


def _band_within(x: Float[np.ndarray, " n"], band: Band) -> Bool[np.ndarray, " point"]:
    """Return the points of a band near the readings."""
    some = x[np.isfinite(x)]
    if not some.size:
        return np.isfinite(band.x)
    low, high = some.min() / BAND_MARGIN, some.max() * BAND_MARGIN
    return (band.x >= low) & (band.x <= high)


def _draw_band(
    axes: Axes,
    band: Band,
    within: Bool[np.ndarray, " point"],
    less: Reduction,
    units: tuple[Unit, Unit],
    positive: bool,
) -> list[Float[np.ndarray, " point"]]:
    """Draw the law and its band; return the drawn values."""
    taken = less.origin + band.x * less.slowness
    curves = (band.q05, band.answer, band.q95)
    low, middle, high = ((one - taken) / units[1].size for one in curves)
    within = within & np.isfinite(low + middle + high)
    within &= (low > 0.0) | (not positive)
    x = band.x / units[0].size
    for start, stop, valid in runs(band.valid):
        part = np.arange(start, stop)
        part = part[within[part]]
        # extrapolated parts are fainter and dashed
        shade, line = (0.22, "-") if valid else (0.10, (0, (4, 2.5)))
        look: dict[str, Any] = {"color": BLUE, "alpha": shade, "linewidth": 0}
        axes.fill_between(x[part], low[part], high[part], **look)
        axes.plot(x[part], middle[part], color=BLUE, linewidth=1.6, linestyle=line)
    return [low[within], high[within]]


def _recordings_key(fit: Fit, columns: int) -> str:
    """Return the key of the marks, in a few lines."""
    air, bands = fit.scene.air, fit.bands
    windy = float(air.wind_east) != 0.0 or float(air.wind_north) != 0.0
    key = [
        words
        for words, shown in (
            ("points: recordings ± 1 sd", True),
            ("line: the law at the answer", bands),
            ("band: 5 to 95 % of the posterior", bands),
            ("dashed: outside the law's range", any(not b.valid.all() for b in bands)),
            ("band: in still air", bands and windy),
            ("open triangles: lower bounds", fit.observations.bounds().any()),
            ("ringed: suspected outlier", outlier_rows(fit)),
        )
        if shown
    ]
    a_line = 3 if columns == 1 else 5
    lines = [key[i : i + a_line] for i in range(0, len(key), a_line)]
    return "\n".join("   ·   ".join(line) for line in lines)


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


def corner_figure(fit: Fit, accepted: Accepted | None = None) -> Figure:
    """Draw the posterior of every identified parameter, alone and in pairs.

    Accepted values are lines.
    """
    names = drawn_parameters(fit)
    every = [_Drawn.of(fit, name, accepted) for name in names]
    count = len(names)
    side = max(2.3 * count + 0.6, 5.4)
    alone = count == 1
    figure = (
        new_figure(7.2, 3.6)
        if alone
        else fixed_figure(side, side, (0.95, 0.15, 0.65, 0.5))
    )
    gaps = None if alone else {"wspace": 0.05, "hspace": 0.05}
    grid = figure.subplots(count, count, squeeze=False, gridspec_kw=gaps)
    for i, row in enumerate(every):
        for j, column in enumerate(every):
            axes = grid[i, j]
            if j > i:
                axes.set_axis_off()
                continue
            _marginal(axes, row) if i == j else _joint(axes, column, row)
            _corner_axes(axes, column, None if i == j else row)
            axes.tick_params(labelbottom=i == count - 1, labelleft=0 == j < i)
            if i == count - 1:
                axes.set_xlabel(column.label)
            if j == 0 < i:
                axes.set_ylabel(row.label)
        printed = row.printed
        if alone:
            quiet(grid[0, 0])
            grid[0, 0].grid(False)
            title = f"{capitalised(parameter_words(names[0]))} {printed.value}"
            titled(grid[0, 0], title, f"90 %: {printed.interval}")
        else:
            text = f"{printed.value}\n{printed.interval}"
            grid[i, i].set_title(text, fontsize=9, color=INK)
    for axes in grid[:, 0] if count > 1 else ():
        axes.yaxis.set_label_coords(-0.28, 0.5)
    _corner_key(figure, count, any(one.truth is not None for one in every), fit)
    return figure


def _corner_key(figure: Figure, count: int, has_truths: bool, fit: Fit) -> None:
    key = ["blue line: value" if count == 1 else "contours: 50 and 90 %"]
    key += ["shaded: 90 % interval"]
    key += ["orange: accepted value, if in view"] * has_truths
    note = absent_note(fit)
    # a histogram has no empty corner: its key is below
    if count == 1:
        lines = ["   ·   ".join(key), *textwrap.wrap(note, 90)]
        figure.supxlabel("\n".join(lines), fontsize=9, color=MUTED)
        return
    # the key stands in the empty upper right, which is narrow for two parameters
    lines = key + textwrap.wrap(note, 26 if count == 2 else 40)
    place: dict[str, Any] = {"ha": "right", "va": "top", "fontsize": 9, "color": MUTED}
    figure.text(0.98, 0.98, "\n".join(lines), **place)


class _Drawn(NamedTuple):
    """Draws of a parameter in its printed unit, with the edges of their bins."""

    draws: Float[np.ndarray, " draw"]
    edges: Float[np.ndarray, " edge"]
    is_log: bool
    label: str
    printed: Any
    value: float
    interval: tuple[float | None, float | None]
    truth: float | None

    @classmethod
    def of(cls, fit: Fit, name: str, accepted: Accepted | None) -> "_Drawn":
        estimate = fit.summary.estimates[name]
        unit = unit_for(name, finite(estimate.value))
        draws = np.asarray(fit.draws[name], float) / unit.size
        wide = (finite(estimate.log_sd) or 0.0) > WIDE_LOG_SD
        is_log = wide and bool(np.all(draws > 0.0))
        # the outermost draws of a long tail would squeeze the others into a few bins
        first, last = (float(q) for q in np.quantile(draws, [0.001, 0.999]))
        # bins of equal width on a logarithmic axis
        spaced = np.geomspace if is_log else np.linspace
        low, high = finite(estimate.q05), finite(estimate.q95)
        known = (accepted or {}).get(name)
        return cls(
            draws,
            spaced(first, last, BINS + 1),
            is_log,
            _with_unit(parameter_words(name), unit),
            printed_estimate(name, estimate),
            estimate.value / unit.size,
            (low and low / unit.size, high and high / unit.size),
            None if known is None else float(known[0]) / unit.size,
        )

    @property
    def middles(self) -> Float[np.ndarray, " bin"]:
        """Middles of the bins."""
        first, last = self.edges[:-1], self.edges[1:]
        return np.sqrt(first * last) if self.is_log else 0.5 * (first + last)


def _marginal(axes: Axes, one: _Drawn) -> None:
    """Draw the histogram of a parameter with its value and its interval."""
    counts = gaussian_filter(np.histogram(one.draws, one.edges)[0] * 1.0, SMOOTH)
    axes.stairs(counts, one.edges, color=BLUE, linewidth=1.2)
    axes.stairs(counts, one.edges, color=BLUE, fill=True, alpha=0.2)
    low, high = one.interval
    if low is not None and high is not None:
        axes.axvspan(low, high, color=BLUE, alpha=0.10, lw=0)
    axes.axvline(one.value, color=BLUE, linewidth=1.6)
    axes.set_yticks([])
    _accepted_line(axes.axvline, one)


def _joint(axes: Axes, along: _Drawn, up: _Drawn) -> None:
    """Draw the regions of the densest bins that have `SHARES` of the draws."""
    counts, *_ = np.histogram2d(along.draws, up.draws, [along.edges, up.edges])
    density = gaussian_filter(counts, SMOOTH)
    falling = np.sort(density, axis=None)[::-1]
    within = np.cumsum(falling) / falling.sum()
    levels = [float(falling[np.searchsorted(within, share)]) for share in SHARES]
    # few draws may leave one level for both shares
    if levels[0] < levels[1] < falling[0]:
        x, y = along.middles, up.middles
        fills = [*levels, float(falling[0])]
        axes.contourf(x, y, density.T, fills, colors=["#cfe3f0", "#8dbfdf"])
        axes.contour(x, y, density.T, levels, colors=BLUE, linewidths=1.0)
    else:
        axes.plot(along.draws, up.draws, ".", color=BLUE, markersize=2)
    _accepted_line(axes.axvline, along)
    _accepted_line(axes.axhline, up)


def _accepted_line(line: Any, one: _Drawn) -> None:
    if one.truth is not None and one.edges[0] <= one.truth <= one.edges[-1]:
        line(one.truth, color=VERMILLION, linewidth=1.5)


def _corner_axes(axes: Axes, along: _Drawn, up: _Drawn | None) -> None:
    """Set limits, scales and few tick labels, in full."""
    for axis, one in ((axes.xaxis, along), (axes.yaxis, up)):
        if one is None:
            continue
        limits = float(one.edges[0]), float(one.edges[-1])
        scale, limit = (
            (axes.set_xscale, axes.set_xlim)
            if axis is axes.xaxis
            else (axes.set_yscale, axes.set_ylim)
        )
        if one.is_log:
            scale("log")
            log_ticks(axis, limits)
        else:
            axis.set_major_locator(MaxNLocator(3))
            formatter = axis.get_major_formatter()
            # an offset text would overlap the panel above
            if (
                isinstance(formatter, ScalarFormatter)
                and max(map(abs, limits)) < OFFSET_FROM
            ):
                formatter.set_useOffset(False)
        limit(limits)
    axes.tick_params(labelsize=8.5, color=MUTED)
    axes.spines[:].set_color(MUTED)
