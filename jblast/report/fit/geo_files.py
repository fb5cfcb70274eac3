"""The position of a charge on the Earth: GeoJSON and KML."""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
from jaxtyping import Float

from jblast.files import write_text
from jblast.inference.fitting.fit import Fit
from jblast.inference.fitting.summary import Summary
from jblast.observations.places import Frame
from jblast.report.estimates import Accepted
from jblast.report.fit.place import ChargePlace, GroundMap, ground_map, residual_colour
from jblast.report.fit.rows import estimates_of, log_name
from jblast.report.kml import add_text, coordinates, document_text, new_document
from jblast.report.words import law_words, printed_number
from jblast.results import plain

PLACE_FILES = ("place.geojson", "place.kml")
FOLDERS = {
    "sensor": "Sensors",
    "charge": "Charges",
    "other optimum": "Other optima",
    "ellipse": "Ellipses of the charge's place",
    "region": "Regions of the charge's place",
    "shock ring": "Peak overpressure",
}
FILLED, FAINT = "26", "0d"
"""Opacity of areas, of ff: the map below stays visible."""
DECIMALS = 9
"""Decimals of a degree: 1e-9 degree is a tenth of a millimetre."""
CORNERS = 120
"""Corners of a circle: the polygon's area is 0.05 % too small."""
CHARGE, ELLIPSE, RING, OTHER = "#d55e00", "#0072b2", "#666666", "#cc79a7"
Ring = Float[np.ndarray, "_ 2"]
"""Longitude and latitude [degree] of corners; the first one is not repeated."""
Polygon = tuple[Ring, ...]
"""An outline, anticlockwise, and its holes, clockwise."""


def write_place(
    fit: Fit, directory: Path, accepted: Accepted | None = None
) -> list[Path]:
    """Write the map in degrees, if the log or its scene has a position on the Earth.

    Args:
        fit: The fit.
        directory: Output directory, which exists.
        accepted: Published values by parameter name, each with its source.

    Returns:
        The files written; none without a frame, or without positions of sensors.
    """
    frame = fit.observations.frame
    shown = None if frame is None else ground_map(fit, accepted)
    if frame is None or shown is None:
        return []
    found = features(shown, frame, fit)
    name = log_name(fit)
    title = f"Blast fit: {name}" if name else "Blast fit"
    paths = [directory / name for name in PLACE_FILES]
    for path, text in zip(paths, (geojson(found), kml(found, title)), strict=True):
        write_text(path, text)
    return paths


@dataclass(frozen=True)
class Feature:
    """A feature of the map.

    Attributes:
        kind: "sensor", "charge", "ellipse", "region", "shock ring", "other optimum".
        name: Display name.
        colour: Colour as #rrggbb.
        point: Longitude and latitude [degree]; None for an area.
        polygons: The area, none of its polygons across the 180th meridian.
        properties: Numbers by name, with units in the names.
    """

    kind: str
    name: str
    colour: str
    point: tuple[float, float] | None = None
    polygons: tuple[Polygon, ...] = ()
    properties: dict[str, Any] = field(default_factory=dict)


def kml(features: Sequence[Feature], title: str) -> str:
    """Return the text of a document with a folder for each kind of feature.

    Args:
        features: The features, in any order.
        title: Name of the document in a viewer.
    """
    root, document = new_document(title)
    order = list(FOLDERS)
    # groupby joins neighbours only, and features come charge by charge
    by_kind = sorted(features, key=lambda feature: order.index(feature.kind))
    for kind, of_kind in groupby(by_kind, key=lambda feature: feature.kind):
        folder = ET.SubElement(document, "Folder")
        add_text(folder, "name", FOLDERS[kind])
        for feature in of_kind:
            _placemark(folder, feature)
    return document_text(root)


def _placemark(folder: ET.Element, feature: Feature) -> None:
    mark = ET.SubElement(folder, "Placemark")
    add_text(mark, "name", feature.name)
    _style(mark, feature)
    # viewers show these numbers when a placemark is clicked
    table = ET.SubElement(mark, "ExtendedData")
    for name, value in feature.properties.items():
        entry = ET.SubElement(table, "Data", name=name)
        add_text(entry, "value", json.dumps(plain(value)).strip('"'))
    if feature.point is not None:
        point = ET.SubElement(mark, "Point")
        add_text(point, "coordinates", coordinates(np.array([feature.point])))
        return
    areas = ET.SubElement(mark, "MultiGeometry")
    for outer, *holes in feature.polygons:
        area = ET.SubElement(areas, "Polygon")
        _boundary(area, "outerBoundaryIs", outer)
        for hole in holes:
            _boundary(area, "innerBoundaryIs", hole)


def _style(mark: ET.Element, feature: Feature) -> None:
    """Write the colours of a feature."""
    # KML orders the bytes of a colour alpha, blue, green, red
    red, green, blue = (feature.colour[k : k + 2] for k in (1, 3, 5))
    colour = blue + green + red
    style = ET.SubElement(mark, "Style")
    if feature.point is not None:
        add_text(ET.SubElement(style, "IconStyle"), "color", f"ff{colour}")
        return
    # rings are large: in full colour they would hide the charge
    faint = feature.kind == "shock ring"
    line = ET.SubElement(style, "LineStyle")
    add_text(line, "color", f"ff{colour}")
    add_text(line, "width", 1 if faint else 2)
    fill = FAINT if faint else FILLED
    add_text(ET.SubElement(style, "PolyStyle"), "color", fill + colour)


def _boundary(area: ET.Element, side: str, ring: Ring) -> None:
    line = ET.SubElement(ET.SubElement(area, side), "LinearRing")
    add_text(line, "coordinates", coordinates(np.concatenate([ring, ring[:1]])))


def geojson(features: Sequence[Feature]) -> str:
    """Return the text of a feature collection, one line a feature.

    Colours have the names of simplestyle-spec 1.1, which viewers support.
    """
    lines = [
        json.dumps(_feature(f), ensure_ascii=False, allow_nan=False) for f in features
    ]
    body = ",\n".join(lines)
    return f'{{"type": "FeatureCollection", "features": [\n{body}\n]}}\n'


def _feature(feature: Feature) -> dict[str, Any]:
    style: dict[str, Any] = {"marker-color": feature.colour}
    if feature.point is not None:
        at = [round(degree, DECIMALS) for degree in feature.point]
        geometry = {"type": "Point", "coordinates": at}
    else:
        areas = [_closed(polygon) for polygon in feature.polygons]
        geometry = {"type": "MultiPolygon", "coordinates": areas}
        if len(areas) == 1:
            geometry = {"type": "Polygon", "coordinates": areas[0]}
        faint = feature.kind == "shock ring"
        style = {
            "stroke": feature.colour,
            "stroke-width": 1 if faint else 2,
            "fill": feature.colour,
            "fill-opacity": 0.03 if faint else 0.15,
        }
    return {
        "type": "Feature",
        "geometry": geometry,
        "properties": plain(
            {"kind": feature.kind, "name": feature.name} | feature.properties | style
        ),
    }


def _closed(polygon: Polygon) -> list[list[list[float]]]:
    closed = (np.concatenate([ring, ring[:1]]) for ring in polygon)
    return [np.round(ring, DECIMALS).tolist() for ring in closed]


def features(shown: GroundMap, frame: Frame, fit: Fit) -> tuple[Feature, ...]:
    """Return the features of a map in WGS84, areas first so that points lie above them.

    Args:
        shown: Contents of the map.
        frame: Origin of its east, north, up.
        fit: The fit, for the estimates of its charges.
    """
    found = [
        feature
        for charge in shown.charges
        for feature in (
            *_rings(charge, frame),
            *_areas(charge, frame),
            *_charge(charge, frame, fit.summary, fit.scene.label),
        )
    ]
    return (*found, *_sensors(shown, frame))


def _sensors(shown: GroundMap, frame: Frame) -> Iterator[Feature]:
    for station in shown.stations:
        each = {f"residual_sd.{quantity}": r for quantity, r in station.residuals}
        yield Feature(
            kind="sensor",
            name=station.name,
            colour=residual_colour(station.worst),
            point=_point(frame, station.position),
            properties={
                "residual_sd": station.worst,
                **each,
                "up_m": float(station.position[2]),
                "suspected_outlier": station.suspected,
            },
        )


def _charge(charge: ChargePlace, frame: Frame, found: Summary, label) -> Iterator:
    numbers = estimates_of(found)
    suffix = f".{charge.name}" if charge.name else ""
    properties: dict[str, Any] = {}
    for name, estimate in numbers.items():
        stem, _, of = name.partition(".")
        if f".{of}" * bool(of) == suffix and (stem.startswith("charge_") or not suffix):
            properties[stem] = estimate.value
            properties |= {f"{stem}.q05": estimate.q05, f"{stem}.q95": estimate.q95}
    yield Feature(
        kind="charge",
        name=charge.name or "charge",
        colour=CHARGE,
        point=_point(frame, charge.position),
        properties={"place": "fitted" if charge.is_fitted else "given", **properties},
    )
    for east, north in charge.elsewhere:
        yield Feature(
            kind="other optimum",
            name=f"{charge.name or 'charge'}, another optimum",
            colour=OTHER,
            point=_point(frame, np.array([east, north, charge.position[2]])),
        )


def _areas(charge: ChargePlace, frame: Frame) -> Iterator[Feature]:
    of = f" of {charge.name}" if charge.name else ""
    # the largest first: viewers draw later areas above it, where they can be clicked
    for region in reversed(charge.regions):
        rings = [(outer, *holes) for outer, holes in region.parts]
        yield Feature(
            kind="region",
            name=f"{100 * region.share:.0f} % region{of}",
            colour=ELLIPSE,
            polygons=_polygons(frame, rings),
            properties={"share": region.share},
        )
    for ellipse in reversed(charge.ellipses):
        # with one free coordinate the ellipse is a line, and has no area
        if not ellipse.minor > 0.0:
            continue
        yield Feature(
            kind="ellipse",
            name=f"{100 * ellipse.share:.0f} % ellipse{of}",
            colour=ELLIPSE,
            polygons=_polygons(frame, [(ellipse.outline(CORNERS),)]),
            properties={
                "share": ellipse.share,
                "semi_major_m": ellipse.major,
                "semi_minor_m": ellipse.minor,
                "azimuth_deg": ellipse.azimuth_deg,
                "misleads": bool(charge.regions),
            },
        )


def _rings(charge: ChargePlace, frame: Frame) -> Iterator[Feature]:
    of = f" of {charge.name}" if charge.name else ""
    turn = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
    unit = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    for ring in charge.rings:
        peak = printed_number("_pa", ring.peak_overpressure_pa)
        yield Feature(
            kind="shock ring",
            name=f"{peak}{of}",
            colour=RING,
            polygons=_polygons(frame, [(charge.position[:2] + ring.range_m * unit,)]),
            properties={
                "peak_overpressure_pa": ring.peak_overpressure_pa,
                "range_m": ring.range_m,
                "range_m.q05": ring.range_q05_m,
                "range_m.q95": ring.range_q95_m,
                "law": law_words(ring.law),
                "law_holds": ring.valid,
            },
        )


def _point(frame: Frame, enu: Float[np.ndarray, "3"]) -> tuple[float, float]:
    lat, lon, _ = frame.to_geodetic(enu)
    return float(lon), float(lat)


def _polygons(
    frame: Frame, parts: Iterable[tuple[Float[np.ndarray, "_ 2"], ...]]
) -> tuple[Polygon, ...]:
    """Return areas (east, north) [m] as polygons in degrees."""
    found: list[Polygon] = []
    for rings in parts:
        in_degrees = []
        for ring in rings:
            # up = 0: the height of an area is not written
            enu = np.concatenate([ring, np.zeros((len(ring), 1))], axis=1)
            # latitude comes first here, longitude in GeoJSON and KML
            in_degrees.append(frame.to_geodetic(enu)[:, 1::-1])
        found += without_crossing(in_degrees)
    return tuple(found)


def without_crossing(rings: Sequence[Ring]) -> list[Polygon]:
    """Return an area as one polygon, or as two on either side of the 180th meridian.

    Args:
        rings: Outline and holes, longitudes -180 to 180; none encloses a pole.
    """
    # one start for all: a hole must not lie a turn away from its outline
    start = rings[0][0, 0]
    turned = [_continuous(ring, start) for ring in rings]
    low, high = turned[0][:, 0].min(), turned[0][:, 0].max()
    if low >= -180.0 and high <= 180.0:
        return [tuple(turned)]
    # RFC 7946, section 3.1.9: areas across the meridian are cut at it
    cut = 180.0 if high > 180.0 else -180.0
    found = []
    for side in (1.0, -1.0):
        shift = -np.sign(cut) * 360.0 if side * np.sign(cut) < 0.0 else 0.0
        kept = [_clipped(ring, cut, side) for ring in turned]
        parts = [ring + np.array([shift, 0.0]) for ring in kept if len(ring) > 2]
        if len(kept[0]) > 2:
            found.append(tuple(parts))
    return found


def _continuous(ring: Ring, start: float) -> Ring:
    """Return a ring without jumps of 360 degrees, starting near a longitude."""
    lon = np.rad2deg(np.unwrap(np.deg2rad(ring[:, 0])))
    near = 360.0 * np.round((start - lon[0]) / 360.0)
    # unwrapping rounds, so longitudes that did not jump keep their exact values
    lon = np.where(np.abs(lon - ring[:, 0]) < 1.0, ring[:, 0], lon) + near
    return np.stack([lon, ring[:, 1]], axis=-1)


def _clipped(ring: Ring, cut: float, side: float) -> Ring:
    """Return the part of a ring below a longitude (side 1), or above it (side -1).

    Sutherland and Hodgman (1974): corners on that side, and crossings of edges.
    """
    found = []
    for one, other in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        inside, then = (side * (cut - p[0]) >= 0.0 for p in (one, other))
        if inside:
            found.append(one)
        if inside != then:
            part = (cut - one[0]) / (other[0] - one[0])
            found.append(np.array([cut, one[1] + part * (other[1] - one[1])]))
    return np.array(found).reshape(-1, 2)
