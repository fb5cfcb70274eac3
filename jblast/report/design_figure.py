"""Positions for a next sensor: the sd of mass and position, mapped over the plane."""

import textwrap

import numpy as np
from jaxtyping import Float
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from jblast.inference.design.sensor_map import BoundMap
from jblast.report.figures import (
    BLUE,
    INK,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
)
from jblast.report.words import (
    capitalised,
    joined,
    parameter_words,
    printed_number,
    quantity_words,
)

SHADES = LinearSegmentedColormap.from_list("paper", ["#3d84b8", "#b7d4e8", "#ffffff"])
"""Dark where a sensor adds much information."""
ROUND_NUMBERS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)
"""Contour levels within a decade, about evenly spaced in ln."""
MAX_LEVELS = 6
"""Largest number of contours: more of them hide the shading."""
MAX_NAMED = 12
"""Largest number of sensors drawn with names: names of more of them overlap."""


def bound_figure(drawn: BoundMap) -> Figure:
    """Draw the sd of ln mass and of the position over the position of a next sensor."""
    panels = []
    if drawn.log_sd_mass is not None:
        percent = 100.0 * drawn.log_sd_mass
        now = f"now {_percent(100 * drawn.now['mass'], 2)}"
        panels.append((f"sd of {parameter_words(drawn.mass)}", percent, _percent, now))
    if drawn.place_sd is not None:
        # with one free coordinate the panel shows that coordinate
        one = len(drawn.place) != 2
        name = parameter_words(drawn.place[-1]) if one else "position"
        now = f"now {_metres(drawn.now['place'], 2)}"
        panels.append((f"sd of {name}", drawn.place_sd, _metres, now))
    figure = new_figure(6.2 * len(panels), 6.4)
    grid = figure.subplots(1, len(panels), squeeze=False)
    for axes, (name, values, words, now) in zip(grid.flat, panels, strict=True):
        _panel(axes, drawn, values, words)
        titled(axes, capitalised(name), now)
    records = joined([quantity_words(q) for q in drawn.records])
    hatched = "" if drawn.valid.all() else "  Hatched: outside the range of a law."
    caption = (
        f"One more sensor at this position, {drawn.up:g} m up, that records {records} "
        f"like {drawn.like}. Dots: sensors. Star: charge.{hatched}"
    )
    lines = textwrap.wrap(caption, 92 * len(panels))
    figure.supxlabel("\n".join(lines), fontsize=9, color=MUTED)
    return figure


def _panel(axes: Axes, drawn: BoundMap, values, words) -> None:
    seen = values[np.isfinite(values)]
    if seen.size:
        _shade(axes, drawn, np.where(np.isfinite(values), values, np.nan), words)
    else:
        axes.text(
            *(0.5, 0.03),
            "not identified at any position",
            transform=axes.transAxes,
            ha="center",
            color=INK,
        )
    if not drawn.valid.all():
        # hatched, not hidden: the bound there rests on an extrapolated law
        outside = axes.contourf(
            drawn.east,
            drawn.north,
            (~drawn.valid).astype(float),
            levels=[0.5, 1.5],
            colors="none",
            hatches=["//"],
        )
        outside.set(edgecolor="#c4c4c4", linewidth=0.0)
    quiet(axes)
    # grid lines would look like contours
    axes.grid(False)
    axes.set(xlabel="east (m)", ylabel="north (m)", aspect="equal")
    axes.set(xlim=drawn.east[[0, -1]], ylim=drawn.north[[0, -1]])
    # names lie on shading of any tone
    halo = [patheffects.withStroke(linewidth=2.5, foreground="white")]
    for name, (east, north) in drawn.sensors.items():
        axes.plot(
            *(east, north), "o", color=BLUE, markeredgecolor="white", markersize=8
        )
        if len(drawn.sensors) <= MAX_NAMED:
            axes.annotate(
                name,
                (east, north),
                xytext=(6, 5),
                textcoords="offset points",
                fontsize=9,
                color=INK,
                path_effects=halo,
            )
    axes.plot(
        *drawn.charges.T,
        "*",
        color=VERMILLION,
        markeredgecolor="white",
        markersize=15,
    )


def _shade(axes: Axes, drawn: BoundMap, values, words) -> None:
    """Shade the standard deviation, with contours at round numbers."""
    # quantiles: near the charge and far off a few values would take the whole scale
    low, high = np.nanquantile(values, [0.005, 0.995])
    norm = LogNorm(low, max(high, 1.001 * low))
    half = [(line[1] - line[0]) / 2 for line in (drawn.east, drawn.north)]
    axes.imshow(
        np.ma.masked_invalid(values),
        origin="lower",
        extent=(
            drawn.east[0] - half[0],
            drawn.east[-1] + half[0],
            drawn.north[0] - half[1],
            drawn.north[-1] + half[1],
        ),
        interpolation="bilinear",
        norm=norm,
        cmap=SHADES,
    )
    levels = round_levels(float(low), float(high))
    # a map that is flat within 1 % has no contour to label
    if len(levels):
        lines = axes.contour(
            drawn.east, drawn.north, values, levels, colors=INK, linewidths=0.8
        )
        axes.clabel(lines, fmt=words, fontsize=9)


def round_levels(low: float, high: float) -> Float[np.ndarray, " level"]:
    """Return round numbers between two numbers, evenly spaced if their ratio is small.

    None are returned if the two are equal within 1 %.
    """
    if high < 1.01 * low:
        return np.zeros(0)
    # within a factor of 2.5 there are only two or three of `ROUND_NUMBERS`
    if high < 2.5 * low:
        locator = MaxNLocator(MAX_LEVELS, steps=[1, 2, 2.5, 5, 10])
        levels = np.asarray(locator.tick_values(low, high))
    else:
        decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
        levels = np.array([m * 10.0**d for d in decades for m in ROUND_NUMBERS])
    levels = levels[(levels > low) & (levels < high)]
    return levels[:: max(-(-len(levels) // MAX_LEVELS), 1)]


def _percent(value: float, digits: int = 4) -> str:
    return f"{value:.{digits}g} %" if np.isfinite(value) else "not identified"


def _metres(value: float, digits: int = 4) -> str:
    shown = np.isfinite(value)
    return printed_number("_m", value, digits) if shown else "not identified"
