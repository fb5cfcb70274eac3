"""The charge and the sensors on a map."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle, PathPatch
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import ScaledTranslation

from jblast.inference.fitting.fit import Fit
from jblast.inference.fitting.place import ShockRing
from jblast.report.estimates import Accepted
from jblast.report.figures import (
    BLUE,
    INK,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
)
from jblast.report.fit.place import (
    COLOURS,
    EDGES,
    ChargePlace,
    GroundMap,
    Station,
    View,
    close_view,
    free_corners,
    ground_map,
    map_notes,
    residual_colour,
    round_length,
    whole_view,
)
from jblast.report.words import printed_number, unit_for

MAP_WIDTH, CLOSE_WIDTH, KEY_WIDTH = 5.4, 4.4, 1.9
"""Widths of the map, of the enlarged map, and of axis labels with colour bar [inch]."""
MAX_ASPECT = 1.25
"""Largest height over width of a map: a taller one does not fit a page."""
CHARACTERS_PER_INCH = 13
"""Characters per inch of the notes below a map, at 9 points."""
MAX_NAMED_SENSORS = 40
"""With more sensors only the suspected ones are named, as names would overlap."""
CALM_M_S = 0.05
"""Wind below this is not drawn [m/s]: it would be printed as 0.0."""
HALF_ARROW = 17.0
"""Half the length of an arrow [point]."""
CORNER_OFFSET = 26.0
"""Distance of a compass arrow from the sides of the map [point]."""
ARROW_SPACING = 52.0
"""Distance from the north arrow to the wind arrow [point]: room for its label."""
FONT_SIZE = 8.5
"""Size of names [point]."""
MAX_LABEL = 18
"""Longest name that is written in full [characters]."""
GAP, RINGED_GAP = 6.0, 9.0
"""Distance of a name from its marker, and from a ringed marker [point]."""
HALO = [withStroke(linewidth=2.5, foreground="white")]
"""White outline that separates text from lines below it."""
Box = tuple[float, ...]
"""Left, lower, right, upper [point]."""
MAX_DRAWS = 600
"""Draws in an enlarged map: more of them merge into one spot."""
PAPER = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 0.6}
UNLABELLED_RING = 0.05
"""A ring whose radius is below this share of the map's width has no label: the label
would cover the ring."""


def map_figure(fit: Fit, accepted: Accepted | None = None) -> Figure | None:
    """Draw the answer on a map; None if no sensor's position is known.

    If the ellipse of a charge would be a dot, an enlarged map is drawn next to it.

    Args:
        fit: The fit.
        accepted: Published values by parameter name, each with its source.
    """
    shown = ground_map(fit, accepted)
    if shown is None:
        return None
    view = whole_view(shown)
    # one enlarged map: a second would not fit the width of a page
    near = [(c, v) for c in shown.charges if (v := close_view(c, view))][:1]
    # the notes are broken to the width of the figure, so their number decides its
    # height
    width = MAP_WIDTH + KEY_WIDTH + CLOSE_WIDTH * len(near)
    notes = map_notes(shown, view, round(CHARACTERS_PER_INCH * width))
    height = MAP_WIDTH * min(view.height / view.width, MAX_ASPECT)
    figure = new_figure(width, height + 1.35 + 0.17 * len(notes))
    grid = figure.subplots(
        1,
        1 + len(near),
        squeeze=False,
        width_ratios=[MAP_WIDTH + KEY_WIDTH] + [CLOSE_WIDTH] * len(near),
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
        # the enlarged map shows the accepted position; here it would hide the star
        draw_charge(axes, charge, view, with_accepted=charge.shot not in larger)
    for station in shown.stations:
        _sensor(axes, station)
    labels = [
        Label(s.name, s.position, VERMILLION if s.suspected else INK, s.suspected)
        for s in shown.stations
        if s.suspected or len(shown.stations) <= MAX_NAMED_SENSORS
    ]
    labels += [
        Label(charge.name or "charge", charge.position, VERMILLION, True)
        for charge in shown.charges
    ]
    draw_labels(axes, view, 72 * MAP_WIDTH, labels)
    places = [s.position[:2] for s in shown.stations]
    places = np.array([*places, *(c.position[:2] for c in shown.charges)])
    first, second = free_corners(view, places)[:2]
    draw_compass(axes, first, shown.wind)
    draw_scale_bar(axes, view, second)
    titled(axes, "Map", "north up")


@dataclass(frozen=True)
class Label:
    """A name at a position (east, north, up) [m], in a colour."""

    name: str
    position: Float[np.ndarray, "3"]
    colour: str = INK
    needed: bool = False


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


def draw_compass(
    axes: Axes, corner: tuple[float, float], wind: tuple[float, float]
) -> None:
    """Draw an arrow to the north, and one along the wind, in a corner.

    Args:
        axes: Axes of a map.
        corner: Corner as shares of width and height.
        wind: Speed of the air towards east and north [m/s].
    """
    inward = 1.0 if corner[0] < 0.5 else -1.0
    upward = 1.0 if corner[1] < 0.5 else -1.0
    level = upward * CORNER_OFFSET + 5.0
    _arrow(axes, corner, (0.8 * inward * CORNER_OFFSET, level), (0.0, 1.0), "N", INK)
    speed = math.hypot(*wind)
    if speed >= CALM_M_S:
        label = f"wind {printed_number('_m_s', speed, 2)}"
        along = wind[0] / speed, wind[1] / speed
        offset = inward * (CORNER_OFFSET + ARROW_SPACING), level
        _arrow(axes, corner, offset, along, label, BLUE)


def _arrow(
    axes: Axes,
    corner: tuple[float, float],
    offset: tuple[float, float],
    along: tuple[float, float],
    label: str,
    colour: str,
) -> None:
    """Draw an arrow of any direction with a label below it; offset in points."""
    assert axes.figure is not None
    # offsets in points keep arrow and label apart on a map of any size
    inches = axes.figure.dpi_scale_trans
    place = axes.transAxes + ScaledTranslation(offset[0] / 72, offset[1] / 72, inches)
    ends = [
        place
        + ScaledTranslation(
            s * along[0] * HALF_ARROW / 72, s * along[1] * HALF_ARROW / 72, inches
        )
        for s in (-1.0, 1.0)
    ]
    axes.annotate(
        "",
        xy=corner,
        xycoords=ends[1],
        xytext=corner,
        textcoords=ends[0],
        arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 1.6},
        zorder=6,
    )
    below = place + ScaledTranslation(0.0, -(HALF_ARROW + 3) / 72, inches)
    axes.text(
        *corner, label, transform=below, ha="center", va="top", fontsize=8.5,
        color=colour, path_effects=HALO, zorder=6,
    )  # fmt: skip


def draw_scale_bar(axes: Axes, view: View, corner: tuple[float, float]) -> None:
    """Draw a bar of a round length in a corner.

    Args:
        axes: Axes of a map.
        view: View of the map.
        corner: Corner as shares of width and height.
    """
    length = round_length(0.3 * view.width)
    edge = 0.04 * view.width
    left = view.west + edge if corner[0] < 0.5 else view.east - edge - length
    level = view.south if corner[1] < 0.5 else view.north
    assert axes.figure is not None
    rise = (10.0 if corner[1] < 0.5 else -22.0) / 72
    lifted = axes.transData + ScaledTranslation(0.0, rise, axes.figure.dpi_scale_trans)
    axes.plot(
        [left, left + length], [level] * 2, transform=lifted, color=INK, linewidth=3,
        solid_capstyle="butt", path_effects=HALO, zorder=6,
    )  # fmt: skip
    axes.annotate(
        f"{length / 1e3:g} km" if length >= 1e3 else printed_number("_m", length),
        (left + length / 2, level),
        xycoords=lifted,
        xytext=(0, 4),
        textcoords="offset points",
        ha="center",
        va="bottom",
        fontsize=8.5,
        color=INK,
        path_effects=HALO,
        zorder=6,
    )


class Side(NamedTuple):
    """Position of a name relative to its marker: offset [point] and alignment."""

    dx: float
    dy: float
    ha: Literal["left", "right", "center"]
    va: Literal["bottom", "top", "center"]


def draw_labels(axes: Axes, view: View, width: float, labels: Sequence[Label]) -> None:
    """Write names next to their markers; a name without room is left out.

    Args:
        axes: Axes of a map.
        view: View of the map.
        width: Width of the axes [point].
        labels: The names; those that are `needed` are always written.
    """
    scale = width / view.width
    marks = [tuple((scale * label.position[:2]).tolist()) for label in labels]
    frame = tuple(
        scale * edge for edge in (view.west, view.south, view.east, view.north)
    )
    taken: list[Box] = []
    # charges and suspected sensors take their room first
    for label, mark in sorted(
        zip(labels, marks, strict=True), key=lambda pair: not pair[0].needed
    ):
        name = label.name if len(label.name) <= MAX_LABEL else label.name[:17] + "…"
        room = _room(
            name, mark, RINGED_GAP if label.needed else GAP, frame, taken, marks
        )
        if room is None and not label.needed:
            continue
        side, box = room or _sides(name, mark, RINGED_GAP)[0]
        taken.append(box)
        axes.annotate(
            name,
            tuple(label.position[:2].tolist()),
            xytext=(side.dx, side.dy),
            textcoords="offset points",
            ha=side.ha,
            va=side.va,
            fontsize=FONT_SIZE,
            color=label.colour,
            parse_math=False,
            path_effects=HALO,
            zorder=6,
        )


def _room(name, mark, gap, frame: Box, taken: list[Box], marks):
    """Return the first side of a marker where its name hides nothing, else None."""
    west, south, east, north = frame
    for side, box in _sides(name, mark, gap):
        left, low, right, high = box
        inside = west <= left and south <= low and right <= east and high <= north
        over_name = any(
            left < other[2] and other[0] < right and low < other[3] and other[1] < high
            for other in taken
        )
        # 3 points are the radius of a marker, whose centre is stored
        over_mark = any(
            left - 3 < x < right + 3 and low - 3 < y < high + 3
            for x, y in marks
            if (x, y) != mark
        )
        if inside and not over_name and not over_mark:
            return side, box
    return None


def _sides(name: str, mark: tuple[float, float], gap: float) -> list[tuple[Side, Box]]:
    """Return the boxes for a name right, left, above and below its marker."""
    # 0.62 em is the mean width of a character of DejaVu Sans, 1.15 em its line
    wide, high = 0.62 * FONT_SIZE * len(name), 1.15 * FONT_SIZE
    back = {"left": 0.0, "center": wide / 2, "right": wide}
    down = {"bottom": 0.0, "center": high / 2, "top": high}
    # right first: a name is read from its marker on
    sides = (
        Side(gap, 0.0, "left", "center"),
        Side(-gap, 0.0, "right", "center"),
        Side(0.0, gap, "center", "bottom"),
        Side(0.0, -gap, "center", "top"),
    )
    boxes = []
    for side in sides:
        left = mark[0] + side.dx - back[side.ha]
        low = mark[1] + side.dy - down[side.va]
        boxes.append((side, (left, low, left + wide, low + high)))
    return boxes


def draw_charge(
    axes: Axes,
    charge: ChargePlace,
    view: View,
    *,
    close: bool = False,
    with_accepted: bool = True,
) -> None:
    """Draw a charge's position, its ellipses or regions, and its rings.

    Args:
        axes: Axes of a map.
        charge: The charge.
        view: View of the map.
        close: Whether the map is the enlarged one, which shows draws.
        with_accepted: Whether to mark the accepted position.
    """
    east, north, _ = charge.position
    for ring in charge.rings:
        _ring(axes, ring, (float(east), float(north)), view)
    if close and charge.draws is not None:
        # every n-th draw: in MCMC neighbours are correlated
        few = charge.draws[:: max(len(charge.draws) // MAX_DRAWS, 1)]
        axes.plot(*few.T, ".", color=BLUE, markersize=2.5, alpha=0.35, zorder=2)
    for ellipse in charge.ellipses:
        # where a region is drawn the ellipse misleads: a thin line without a fill
        style = (0, (2, 2)) if charge.regions else "-"
        outline = _closed(ellipse.outline(120))
        width = 0.8 if charge.regions else 1.4
        axes.plot(*outline.T, color=BLUE, linewidth=width, linestyle=style, zorder=3)
        if not charge.regions:
            axes.fill(*outline.T, color=BLUE, alpha=0.10, linewidth=0, zorder=2)
    for region in charge.regions:
        axes.add_patch(
            PathPatch(
                _path(region.parts),
                facecolor=BLUE,
                edgecolor="none",
                alpha=0.22,
                zorder=2,
            )
        )
    axes.plot(
        east, north, "*", color=VERMILLION, markersize=13, markeredgecolor="white",
        markeredgewidth=0.8, zorder=5,
    )  # fmt: skip
    for there in charge.elsewhere:
        if view.holds(*there):
            axes.plot(*there, "X", color=VERMILLION, markersize=8, alpha=0.6, zorder=5)
    if with_accepted and charge.accepted is not None and view.holds(*charge.accepted):
        axes.plot(*charge.accepted, "+", color=INK, markersize=12, mew=2, zorder=6)


def _ring(axes: Axes, ring: ShockRing, centre: tuple[float, float], view: View) -> None:
    style = "-" if ring.valid else (0, (4, 3))
    thick = ring.range_q95_m - ring.range_q05_m
    # a thinner band is no wider than the line of the ring
    if thick > 0.004 * view.width:
        band = (
            _circle(centre, ring.range_q95_m),
            # backwards, so that the winding leaves the inside of the band empty
            _circle(centre, ring.range_q05_m)[::-1],
        )
        path = _path(((band[0], (band[1],)),))
        axes.add_patch(PathPatch(path, facecolor=MUTED, edgecolor="none", alpha=0.12))
    axes.add_patch(
        Circle(centre, ring.range_m, fill=False, ec=MUTED, lw=1.0, ls=style, zorder=1)
    )
    if ring.range_m < UNLABELLED_RING * view.width:
        return
    # the label stands at the first point of the ring in view, clockwise from 30 degrees
    for turn in np.deg2rad(np.arange(60.0, -300.0, -15.0)):
        x = centre[0] + ring.range_m * math.cos(turn)
        y = centre[1] + ring.range_m * math.sin(turn)
        edge = 0.04 * view.width
        inner = View(
            view.west + 2 * edge,
            view.east - 2 * edge,
            view.south + edge,
            view.north - edge,
        )
        if inner.holds(x, y):
            axes.text(
                x, y, printed_number("_pa", ring.peak_overpressure_pa),
                ha="center", va="center", fontsize=8, color=MUTED, zorder=3.5,
                bbox=PAPER,
            )  # fmt: skip
            return


def _circle(
    centre: tuple[float, float], radius: float
) -> Float[np.ndarray, "corner 2"]:
    turn = np.linspace(0.0, 2 * np.pi, 180, endpoint=False)
    return np.array(centre) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=-1)


def _closed(ring: Float[np.ndarray, "corner 2"]) -> Float[np.ndarray, "corner_ 2"]:
    return np.concatenate([ring, ring[:1]])


def _path(parts) -> Path:
    """Return areas with their holes as one path."""
    rings = [ring for outer, holes in parts for ring in (outer, *holes)]
    return Path.make_compound_path(
        *(Path(_closed(ring), closed=True) for ring in rings)
    )
