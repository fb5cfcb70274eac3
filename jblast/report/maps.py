"""Maps: features by layers, as a figure, as GeoJSON and as KML."""

import importlib.util
import json
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
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

from jblast.observations.places import Frame
from jblast.report.figures import (
    BLUE,
    COLOURS,
    INK,
    MUTED,
    VERMILLION,
    new_figure,
    place_names,
    quiet,
    titled,
)
from jblast.report.numbers import unit_for
from jblast.results import plain

Ring = Float[np.ndarray, "corner axis"]
"""East, north and perhaps up [m]; the first corner is not repeated."""
MAP_INCHES, CLOSE_INCHES = 7.3, 4.4
"""Widths of the map with its scale, and of the enlarged map."""
FAINT = 0.03
"""Opacity of an area without a fill in files, where it can be clicked."""
MAX_NAMES = 40
"""With more names only those in vermillion are written, as names would overlap."""


@dataclass(frozen=True)
class Layer:
    """Features of one kind.

    Attributes:
        title: Name in the legend, and of the folder of KML.
        colour: Colour as #rrggbb.
        style: Style of points or lines in Matplotlib's words.
        fill: Opacity of areas; NaN for points and paths.
        framed: Whether the map's view contains all features.
        heights: Whether heights are written into files.
    """

    title: str
    colour: str
    style: Mapping[str, Any]
    fill: float = float("nan")
    framed: bool = True
    heights: bool = False

    @property
    def geometry(self) -> str:
        """Geometry of the features, in the words of GeoJSON."""
        areas = "Polygon" if self.fill >= 0.0 else "LineString"
        return "Point" if "marker" in self.style else areas


DOT, STAR, CROSS = {"marker": "o"}, {"marker": "*", "ms": 14}, {"marker": "X", "ms": 9}
WHITE = {"mec": "white", "mew": 0.8}
HOLLOW = {"mfc": "none", "mew": 1.6}
LAYERS = {
    "band": Layer("", MUTED, {"lw": 0}, 0.12, framed=False),
    "shock ring": Layer("peak overpressure", MUTED, {"lw": 1}, 0.0, framed=False),
    "draw": Layer("draws", BLUE, {"marker": ".", "ms": 3, "alpha": 0.4}, framed=False),
    "region": Layer("region of the posterior", BLUE, {"lw": 0}, 0.22),
    "ellipse": Layer("ellipse of the posterior", BLUE, {"lw": 1.4}, 0.1),
    "planned": Layer("planned", MUTED, {"lw": 3.5, "alpha": 0.45}, heights=True),
    "flown": Layer("flown", BLUE, {"lw": 1.2}, heights=True),
    "home": Layer("home", INK, {"marker": "s", "ms": 7}, heights=True),
    "waypoint": Layer("waypoint", INK, {**DOT, "ms": 4}, heights=True),
    "missed": Layer("waypoint, missed", VERMILLION, CROSS | WHITE, heights=True),
    "sensor": Layer("sensor", INK, {**DOT, "ms": 8, "mec": INK, "mew": 0.8}),
    "camera": Layer("camera", INK, {"marker": "v", "ms": 8}),
    "suspected": Layer("suspected outlier", VERMILLION, {**DOT, "ms": 14, **HOLLOW}),
    "other optimum": Layer("other optimum", COLOURS[3], CROSS | WHITE),
    "charge": Layer("charge", VERMILLION, {**STAR, **WHITE}),
    "blast": Layer("blast", VERMILLION, {**STAR, **WHITE}, heights=True),
    "accepted": Layer("accepted", INK, {**CROSS, "marker": "+"}, framed=False),
}  # fmt: skip
"""Layers by kind of feature; later ones lie above earlier ones."""


@dataclass(frozen=True)
class Feature:
    """Something at a position.

    Attributes:
        kind: Its layer.
        name: Name in files; "" leaves it out of them.
        parts: Points as one array, paths as one array each, areas as outlines, each
            followed by its holes, which turn the other way.
        label: Name on the map; "" for none.
        properties: Numbers by name, with units in the names, for files.
        colour: Colour of its inside, "" for that of the layer.
        size: Size of its marker over that of the layer.
        dashed: Whether its outline is dashed, and its area is not filled.
    """

    kind: str
    name: str
    parts: Sequence[Sequence[Ring]]
    label: str = ""
    properties: Mapping[str, Any] = field(default_factory=dict)
    colour: str = ""
    size: float = 1.0
    dashed: bool = False

    @property
    def layer(self) -> Layer:
        """Its layer."""
        return LAYERS[self.kind]

    @property
    def places(self) -> Float[np.ndarray, "place 2"]:
        """All its positions (east, north) [m]."""
        return np.concatenate([ring[:, :2] for part in self.parts for ring in part])


def point(kind: str, name: str, place: Any, **more: Any) -> Feature:
    """Return a feature at one or several points (east, north, up) [m]."""
    return Feature(kind, name, [[np.atleast_2d(np.asarray(place, float))]], **more)


@dataclass(frozen=True)
class Map:
    """Contents of a map.

    Attributes:
        features: The features.
        frame: Origin of east, north, up on the Earth; None if unknown.
        title: Title.
        note: Note opposite the title.
        lines: Lines below.
        near: Positions (east, north) [m] that an enlarged map beside it shows, if they
            would be a dot; draws are in that map only.
        scale: Label, bounds and colours of the sensors' scale, if they have one.
    """

    features: Sequence[Feature]
    frame: Frame | None = None
    title: str = "Map"
    note: str = "north up"
    lines: Sequence[str] = ()
    near: Float[np.ndarray, "place 2"] | None = None
    scale: tuple[str, Sequence[float], Sequence[str]] | None = None


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
                lines = axes.plot(
                    *rings[0][:, :2].T, **{"color": colour, **style, **layer.style}
                )
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


def degrees(lat: float, lon: float) -> str:
    """Return a position as 47.12345° N, 8.54321° E."""
    ns, ew = "N" if lat >= 0 else "S", "E" if lon >= 0 else "W"
    return f"{abs(lat):.5f}° {ns}, {abs(lon):.5f}° {ew}"


def map_files(
    stem: str, features: Sequence[Feature], frame: Frame, title: str
) -> dict[str, str]:
    """Return the map in WGS84 as files by name: STEM.geojson and STEM.kml.

    KML needs the package simplekml, and is left out without it.
    """
    files = {f"{stem}.geojson": geojson(features, frame)}
    if importlib.util.find_spec("simplekml"):
        files[f"{stem}.kml"] = kml(features, frame, title)
    return files


def geojson(features: Sequence[Feature], frame: Frame) -> str:
    """Return the text of a feature collection (RFC 7946), one line a feature.

    Colours have the names of simplestyle-spec 1.1, which viewers support.
    """
    lines = []
    for feature in (f for f in features if f.name):
        layer, colour = feature.layer, (feature.colour or feature.layer.colour).lower()
        parts = [[r.tolist() for r in part] for part in _in_degrees(feature, frame)]
        kind, places = layer.geometry, parts[0]
        style: dict[str, Any] = {
            "stroke": colour,
            "stroke-width": layer.style.get("lw"),
        }
        if kind == "Point":
            places, style = parts[0][0][0], {"marker-color": colour}
        elif kind == "LineString":
            places = parts[0][0]
        else:
            style |= {"fill": colour, "fill-opacity": layer.fill or FAINT}
            if len(parts) > 1:
                kind, places = "MultiPolygon", parts
        own = {"kind": feature.kind, "name": feature.name}
        whole = {
            "type": "Feature",
            "geometry": {"type": kind, "coordinates": places},
            "properties": plain({**own, **feature.properties, **style}),
        }
        lines.append(json.dumps(whole, ensure_ascii=False, allow_nan=False))
    body = ",\n".join(lines)
    return f'{{"type": "FeatureCollection", "features": [\n{body}\n]}}\n'


def kml(features: Sequence[Feature], frame: Frame, title: str) -> str:
    """Return the text of a KML document, with a folder for each layer."""
    import simplekml

    document = simplekml.Kml(name=title)
    document.resetidcounter()  # the same text each time it is written
    folders: dict[str, Any] = {}
    for feature in (f for f in features if f.name):
        layer, parts = feature.layer, _in_degrees(feature, frame)
        if layer.title not in folders:
            folders[layer.title] = document.newfolder(name=layer.title)
        folder = folders[layer.title]
        red, green, blue = bytes.fromhex((feature.colour or layer.colour)[1:])
        colour = simplekml.Color.rgb(red, green, blue)
        # XML 1.0 forbids control characters even as references
        name = "".join(c for c in feature.name if c.isprintable())
        if layer.geometry == "Point":
            mark = folder.newpoint(name=name, coords=parts[0][0].tolist())
            mark.style.iconstyle.color = colour
        elif layer.geometry == "LineString":
            mark = folder.newlinestring(name=name, coords=parts[0][0].tolist())
        else:
            mark = folder.newmultigeometry(name=name)
            fill = simplekml.Color.changealphaint(
                round(255 * (layer.fill or FAINT)), colour
            )
            mark.style.polystyle.color = fill
            for outer, *holes in parts:
                mark.newpolygon(
                    outerboundaryis=outer.tolist(),
                    innerboundaryis=[hole.tolist() for hole in holes],
                )
        mark.style.linestyle.color = colour
        mark.style.linestyle.width = layer.style.get("lw", 1)
        if layer.heights:
            mark.altitudemode = simplekml.AltitudeMode.absolute
        # viewers show these numbers when a feature is clicked
        for key, value in plain(dict(feature.properties)).items():
            mark.extendeddata.newdata(key, json.dumps(value).strip('"'))
    return document.kml()


def _in_degrees(feature: Feature, frame: Frame) -> list[list[Float[np.ndarray, "_ _"]]]:
    """Return longitude and latitude [degree], and height [m] where it is written."""

    def one(ring: Ring) -> Float[np.ndarray, "_ _"]:
        if feature.layer.geometry == "Polygon":
            ring = np.vstack([ring, ring[:1]])
        enu = np.pad(ring, ((0, 0), (0, 3 - ring.shape[1])))
        lat, lon, alt = frame.to_geodetic(enu).T
        # continuous across the 180th meridian; nine decimals are a tenth of a mm
        columns = [np.unwrap(lon, period=360.0).round(9), lat.round(9)]
        return np.stack(columns + [alt.round(3)] * feature.layer.heights, axis=-1)

    return [[one(ring) for ring in part] for part in feature.parts]
