"""The posterior: how the fitted numbers spread, and how they move together."""

import sys
import textwrap
import warnings
from types import ModuleType
from typing import cast

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

from jblast.inference.fitting.result import Fit
from jblast.report.estimates import WIDE_LOG_SD, printed_estimate
from jblast.report.figure_style import (
    BLUE,
    DPI,
    INK,
    MUTED,
    VERMILLION,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.report.fit.reference_values import Accepted
from jblast.report.numbers import Unit, finite, unit_for
from jblast.report.words import capitalised, joined, parameter_words

OFFSET_FROM = 1e5
"""Numbers of this size are too long to be written in full beside each other."""


def drawn_parameters(fit: Fit) -> list[str]:
    """Return the parameters whose draws can be plotted: finite, not all equal."""
    return [
        name
        for name in fit.summary.free
        if name in fit.draws
        and fit.summary.estimates[name].identified
        and len(fit.draws[name]) > 1
        and bool(np.all(np.isfinite(fit.draws[name])))
        and np.ptp(fit.draws[name]) > 0.0
    ]


def absent_note(fit: Fit) -> str:
    """Say which free parameters the corner plot lacks, or ""."""
    absent = [n for n in fit.summary.free if n not in drawn_parameters(fit)]
    if not absent:
        return ""
    words = joined([parameter_words(name) for name in absent])
    return f"Not shown, for want of an identified posterior: {words}."


def corner_figure(fit: Fit, accepted: Accepted | None = None) -> Figure | None:
    """Draw the posterior of every identified parameter; None where there is none.

    Two or more make a corner plot, one a histogram. Accepted values are lines.
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
    _key(figure, len(names), bool(truths), absent_note(fit))
    return figure


def _key(figure: Figure, count: int, has_truths: bool, note: str) -> None:
    key = ["blue line: value" if count == 1 else "contours: 50 and 90 %"]
    key += ["shaded: 90 % interval"] + [
        "orange: accepted value, if in view"
    ] * has_truths
    if count == 1:
        lines = ["   ·   ".join(key), *textwrap.wrap(note, 90)]
        figure.supxlabel("\n".join(lines), fontsize=9, color=MUTED)
        return
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
    first, last = (float(q) for q in np.quantile(draws, [0.001, 0.999]))
    spaced = np.geomspace if _wide(fit, name) else np.linspace
    axes.hist(draws, list(spaced(first, last, 41)), color=BLUE, alpha=0.35)
    estimate = fit.summary.estimates[name]
    low, high = finite(estimate.q05), finite(estimate.q95)
    if low is not None and high is not None:
        axes.axvspan(low / unit.size, high / unit.size, color=BLUE, alpha=0.10, lw=0)
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
        # corner says so of few draws; contours of those are merely rough
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
        _diagonal(grid[i, i], fit, name, units[name])
        if name in truths:
            _accepted_lines(grid, i, truths[name])
        if scales[i] == "log":
            log_ticks(grid[-1, i].xaxis, grid[-1, i].get_xlim())
            if i:
                log_ticks(grid[i, 0].yaxis, grid[i, 0].get_ylim())
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
    """Write 149.95 in full: an offset of 149.9 would stand on the panel above."""
    formatter = axis.get_major_formatter()
    short = np.abs(axis.get_view_interval()).max() < OFFSET_FROM
    if short and isinstance(formatter, ScalarFormatter):
        formatter.set_useOffset(False)


def _corner_package():
    """Import corner without ArviZ, which it does without where that is absent.

    Draws come as arrays here, and importing ArviZ takes longer than drawing all the
    figures. Whoever imports corner elsewhere gets all of it.
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


def _diagonal(axes: Axes, fit: Fit, name: str, unit: Unit) -> None:
    estimate = fit.summary.estimates[name]
    low, high = finite(estimate.q05), finite(estimate.q95)
    if low is not None and high is not None:
        axes.axvspan(low / unit.size, high / unit.size, color=BLUE, alpha=0.10, lw=0)
    printed = printed_estimate(name, estimate)
    axes.set_title(f"{printed.value}\n{printed.interval}", fontsize=9, color=INK)
