"""The answer on a map in metres: sensors by residual, charge, ellipses, shock, wind."""

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from jblast.inference.fitting.result import Fit
from jblast.report.figure_style import (
    INK,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
)
from jblast.report.fit.place.charge_marks import draw_charge
from jblast.report.fit.place.compass import draw_compass, draw_scale_bar
from jblast.report.fit.place.ground_map import GroundMap, Station, ground_map
from jblast.report.fit.place.labels import Label, draw_labels
from jblast.report.fit.place.map_words import map_notes
from jblast.report.fit.place.residual_colours import COLOURS, EDGES, residual_colour
from jblast.report.fit.place.view import (
    View,
    close_view,
    free_corners,
    whole_view,
)
from jblast.report.fit.reference_values import Accepted
from jblast.report.numbers import unit_for

WIDE, CLOSE, KEY = 5.4, 4.4, 1.9
"""Of the map, of what it shows larger, and of all that stands beside a map [inch]."""
TALLEST = 1.25
"""Height over width of the tallest map."""
LETTERS = 13
"""An inch, of the notes below."""
MOST_NAMES = 40
"""Of more sensors only the suspected are named."""


def map_figure(fit: Fit, accepted: Accepted | None = None) -> Figure | None:
    """Draw an answer on the ground; None where no sensor's place is known.

    Where a charge is known so well that its ellipse would be a dot, the place about it
    is drawn once more beside the map.

    Args:
        fit: The fit.
        accepted: Published values by parameter name, each with where it comes from.
    """
    shown = ground_map(fit, accepted)
    if shown is None:
        return None
    view = whole_view(shown)
    near = [(c, v) for c in shown.charges if (v := close_view(c, view))][:1]
    width = WIDE + KEY + CLOSE * len(near)
    notes = map_notes(shown, view, round(LETTERS * width))
    height = WIDE * min(view.height / view.width, TALLEST)
    figure = new_figure(width, height + 1.35 + 0.17 * len(notes))
    grid = figure.subplots(
        1, 1 + len(near), squeeze=False, width_ratios=[WIDE + KEY] + [CLOSE] * len(near)
    )[0]
    _map(grid[0], shown, view, {charge.shot for charge, _ in near})
    for charge, close in near:
        _frame(grid[1], close)
        draw_charge(grid[1], charge, close, close=True)
        draw_scale_bar(grid[1], close, (0.0, 0.0))
        titled(grid[1], f"About {charge.name or 'the charge'}", "dots: draws")
    _residual_key(figure, grid[0])
    figure.supxlabel("\n".join(notes), fontsize=9, color=MUTED)
    return figure


def _map(axes: Axes, shown: GroundMap, view: View, larger: set[int]) -> None:
    _frame(axes, view)
    for charge in shown.charges:
        # where its place is drawn larger, a cross would only hide it here
        draw_charge(axes, charge, view, with_accepted=charge.shot not in larger)
    for station in shown.stations:
        _sensor(axes, station)
    labels = [
        _label(s.name, s.position, VERMILLION if s.suspected else INK, s.suspected)
        for s in shown.stations
        if s.suspected or len(shown.stations) <= MOST_NAMES
    ]
    labels += [
        _label(charge.name or "charge", charge.position, VERMILLION, True)
        for charge in shown.charges
    ]
    draw_labels(axes, view, 72 * WIDE, labels)
    places = [s.position[:2] for s in shown.stations]
    places = np.array([*places, *(c.position[:2] for c in shown.charges)])
    first, second = free_corners(view, places)[:2]
    draw_compass(axes, first, shown.wind)
    draw_scale_bar(axes, view, second)
    titled(axes, "Map", "north up")


def _label(
    name: str, position: Float[np.ndarray, "3"], colour: str, needed: bool
) -> Label:
    return Label(name, float(position[0]), float(position[1]), colour, needed)


def _sensor(axes: Axes, station: Station) -> None:
    east, north, _ = station.position
    axes.plot(
        east,
        north,
        "o",
        markersize=8,
        markerfacecolor=residual_colour(station.worst),
        markeredgecolor=INK,
        markeredgewidth=0.8,
        zorder=4,
    )
    if station.suspected:
        axes.plot(
            east, north, "o", markersize=14, markerfacecolor="none",
            markeredgecolor=VERMILLION, markeredgewidth=1.6, zorder=4,
        )  # fmt: skip


def _frame(axes: Axes, view: View) -> None:
    axes.set_xlim(view.west, view.east)
    axes.set_ylim(view.south, view.north)
    axes.set_aspect("equal")
    quiet(axes)
    axes.spines[["top", "right"]].set_visible(True)
    axes.spines[["top", "right"]].set_color(MUTED)
    unit = unit_for("_m", view.west, view.east, view.south, view.north)
    for axis, name in ((axes.xaxis, "east"), (axes.yaxis, "north")):
        axis.set_major_formatter(lambda x, _: f"{x / unit.size:.10g}".replace("-", "−"))
        axis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
        axis.set_label_text(f"{name} ({unit.symbol})")


def _residual_key(figure: Figure, axes: Axes) -> None:
    ends = [-4.0, *EDGES, 4.0]
    colours = ScalarMappable(BoundaryNorm(ends, len(COLOURS)), ListedColormap(COLOURS))
    bar = figure.colorbar(colours, ax=axes, shrink=0.7, aspect=28, pad=0.02)
    bar.set_ticks([-3, -2, -1, 1, 2, 3])
    bar.set_label("largest residual of the sensor (sd)", fontsize=9, color=INK)
    bar.ax.tick_params(labelsize=8.5, color=MUTED)
    bar.outline.set_edgecolor(MUTED)
