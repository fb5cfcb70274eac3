"""Maps of features, drawn by layers."""

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap, to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox

from jblast.report.colours import INK, MUTED, VERMILLION
from jblast.report.figures import new_figure, place_names, quiet, titled
from jblast.report.maps import LAYERS, Feature, Map, degrees
from jblast.report.numbers import unit_for

MAP_INCHES, CLOSE_INCHES = 7.3, 4.4
"""Widths of the map with its scale, and of the enlarged map."""
MAX_NAMES = 40
"""With more names only those in vermillion are written, as names would overlap."""


def view_of(places: Float[np.ndarray, "place 2"], least: float = 0.5) -> Bbox:
    """Return the rectangle of ground that shows all positions with a margin [m].

    Args:
        places: Positions (east, north) [m], at least one.
        least: Least ratio of its sides: positions in a line would otherwise make a
            strip without room for names.
    """
    low, high = places.min(axis=0), places.max(axis=0)
    # a single position has no extent, and an axis needs one: ten metres
    longest = float((high - low).max()) or 10.0
    # 12 % at each side is room for names
    half = 0.62 * np.maximum(high - low, least * longest)
    return Bbox([0.5 * (low + high) - half, 0.5 * (low + high) + half])


def map_figure(shown: Map) -> Figure:
    """Draw a map, with an enlarged one beside it if there is need."""
    framed = [f.places for f in shown.features if f.layer.framed]
    views = [view_of(np.concatenate(framed or [np.zeros((1, 2))]))]
    whole = max(views[0].width, views[0].height)
    # below a tenth, half an inch, an ellipse is about two markers
    if shown.near is not None and (close := view_of(shown.near, 1.0)).width < whole / 8:
        views.append(close)
    widths = [MAP_INCHES, CLOSE_INCHES][: len(views)]
    lines = [*shown.lines]
    if shown.frame is not None:
        corners = np.hstack([views[0].get_points(), [[0.0], [0.0]]])
        low, high = (degrees(*at[:2]) for at in shown.frame.to_geodetic(corners))
        lines += [f"lower left {low}, upper right {high} (WGS84)"]
    per_line = round(14 * sum(widths))  # characters of 9 points
    lines = [part for line in lines for part in textwrap.wrap(line, per_line)]
    # a map taller than 1.25 widths does not fit a page
    height = 5.4 * min(views[0].height / views[0].width, 1.25)
    figure = new_figure(sum(widths), height + 1.6 + 0.17 * len(lines))
    grid = figure.subplots(1, len(views), squeeze=False, width_ratios=widths)[0]
    hidden = {"draw"} | ({"accepted"} if len(views) > 1 else set())
    first = [f for f in shown.features if f.kind not in hidden]
    draw_features(grid[0], first, views[0])
    titled(grid[0], shown.title, shown.note)
    for axes, view in zip(grid[1:], views[1:], strict=True):
        draw_features(axes, shown.features, view)
        titled(axes, "Enlarged")
    if shown.scale is not None:
        label, bounds, colours = shown.scale
        norm = BoundaryNorm([bounds[0] - 1, *bounds, bounds[-1] + 1], len(colours))
        mapped = ScalarMappable(norm, ListedColormap(list(colours)))
        bar = figure.colorbar(mapped, ax=grid[0], shrink=0.7, aspect=28, pad=0.02)
        bar.set_ticks(list(bounds))
        bar.set_label(label, fontsize=9, color=INK)
        bar.ax.tick_params(labelsize=8.5, color=MUTED)
    handles, names = grid[-1].get_legend_handles_labels()
    legend = figure.legend(
        handles[::-1], names[::-1], loc="outside lower center", frameon=False,
        ncols=min(len(names), 4 * len(views)), fontsize=9, labelcolor=MUTED,
        title="\n".join(lines), title_fontproperties={"size": 9},
    )  # fmt: skip
    legend.get_title().set(color=MUTED, multialignment="center")
    write_names(figure, grid[0], first)
    return figure


def draw_features(axes: Axes, features: Sequence[Feature], view: Bbox) -> None:
    """Draw features into axes with north up, equal scales, and numbers in full."""
    axes.set(xlim=view.intervalx, ylim=view.intervaly, aspect="equal")
    quiet(axes)
    axes.spines[:].set(visible=True, color=MUTED)
    unit = unit_for("_m", *view.extents)
    for axis, name in ((axes.xaxis, "east"), (axes.yaxis, "north")):
        axis.set_major_formatter(lambda x, _: f"{x / unit.size:.12g}".replace("-", "−"))
        axis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
        axis.set_label_text(f"{name} ({unit.symbol})")
    titles: set[str] = {""}  # in the legend once each
    for feature in sorted(features, key=lambda f: [*LAYERS].index(f.kind)):
        layer, colour = feature.layer, feature.colour or feature.layer.colour
        style: dict[str, Any] = {"zorder": 2 + [*LAYERS].index(feature.kind) / 10}
        if layer.title not in titles and not feature.dashed:
            style["label"] = layer.title
            titles.add(layer.title)
        if layer.geometry != "Point":
            style |= {"ls": (0, (4, 3)) if feature.dashed else "-"}
        for rings in feature.parts:
            if layer.geometry == "Polygon":
                closed = (np.vstack([ring, ring[:1]])[:, :2] for ring in rings)
                area = Path.make_compound_path(*(Path(r, closed=True) for r in closed))
                fill = to_rgba(colour, 0.0 if feature.dashed else layer.fill)
                style |= {"fc": fill, "ec": colour, **layer.style}
                style |= {"lw": 0.9} if feature.dashed else {}
                axes.add_patch(PathPatch(area, **style))
            else:
                style = {"color": colour, **style, **layer.style}
                lines = axes.plot(*rings[0][:, :2].T, **style)
                if layer.geometry == "Point":
                    lines[0].set(
                        linestyle="", markersize=feature.size * layer.style["ms"]
                    )
            style.pop("label", None)
        if layer.geometry == "Polygon" and feature.label:
            _write_on_outline(axes, feature, view)


def write_names(figure: Figure, axes: Axes, features: Sequence[Feature]) -> None:
    """Write the labels of points in view, after all else is drawn."""
    points = [f for f in features if f.layer.geometry == "Point"]
    named = [f for f in points if f.label and axes.viewLim.contains(*f.places[0])]
    if len(named) > MAX_NAMES:
        named = [f for f in named if f.layer.colour == VERMILLION]
    if named:
        engine = figure.get_layout_engine()
        assert engine is not None
        engine.execute(figure)
        marks = np.concatenate([f.places for f in points])
        at = np.array([f.places[0] for f in named])
        colours = [f.layer.colour for f in named]
        place_names(axes, [f.label for f in named], at, colours, avoid=marks)


def _write_on_outline(axes: Axes, feature: Feature, view: Bbox) -> None:
    """Write the label of an area on its outline, where that is in view."""
    inner = view.expanded(0.9, 0.9)
    seen = [place for place in feature.places if inner.contains(*place)]
    # a label would cover a smaller ring
    if seen and np.ptp(feature.places[:, 0]) > 0.1 * view.width:
        # at the upper right
        x, y = max(seen, key=lambda place: float(place @ [1.0, 2.0]))
        paper = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 0.6}
        axes.text(
            x, y, feature.label, ha="center", va="center", fontsize=8, color=MUTED,
            zorder=3, bbox=paper,
        )  # fmt: skip
