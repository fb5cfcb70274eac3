"""Maps: features by layers, as GeoJSON and as KML; `map_figures` draws them."""

import importlib.util
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.observations.places import Frame
from jblast.report.colours import BLUE, COLOURS, INK, MUTED, VERMILLION
from jblast.results import plain

Ring = Float[np.ndarray, "corner axis"]
"""East, north and perhaps up [m]; the first corner is not repeated."""
FAINT = 0.03
"""Opacity of an area without a fill in files, where it can be clicked."""


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
