"""The map as KML 2.2 (OGC 07-147r2), for Google Earth and its like."""

import json
from collections.abc import Sequence
from itertools import groupby
from xml.etree import ElementTree as ET

import numpy as np

from jblast.json_values import plain
from jblast.report.fit.place.antimeridian import Ring
from jblast.report.fit.place.features import Feature

NAMESPACE = "http://www.opengis.net/kml/2.2"
FOLDERS = {
    "sensor": "Sensors",
    "charge": "Charges",
    "other optimum": "Other optima",
    "ellipse": "Ellipses of the charge's place",
    "region": "Regions of the charge's place",
    "shock ring": "Peak overpressure",
}
FILLED, FAINT = "26", "0d"
"""How opaque areas are, of ff: what is below is to be seen."""


def kml(features: Sequence[Feature], title: str) -> str:
    """Return the text of a document with a folder for each kind of feature.

    Args:
        features: What it holds, in any order.
        title: What a viewer calls it.
    """
    root = ET.Element("kml", xmlns=NAMESPACE)
    document = ET.SubElement(root, "Document")
    _said(document, "name", title)
    order = list(FOLDERS)
    by_kind = sorted(features, key=lambda feature: order.index(feature.kind))
    for kind, of_kind in groupby(by_kind, key=lambda feature: feature.kind):
        folder = ET.SubElement(document, "Folder")
        _said(folder, "name", FOLDERS[kind])
        for feature in of_kind:
            _placemark(folder, feature)
    ET.indent(root)
    text = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _placemark(folder: ET.Element, feature: Feature) -> None:
    mark = ET.SubElement(folder, "Placemark")
    _said(mark, "name", feature.name)
    _style(mark, feature)
    table = ET.SubElement(mark, "ExtendedData")
    for name, value in feature.properties.items():
        entry = ET.SubElement(table, "Data", name=name)
        _said(entry, "value", json.dumps(plain(value)).strip('"'))
    if feature.point is not None:
        point = ET.SubElement(mark, "Point")
        _said(point, "coordinates", _places(np.array([feature.point])))
        return
    areas = ET.SubElement(mark, "MultiGeometry")
    for outer, *holes in feature.polygons:
        area = ET.SubElement(areas, "Polygon")
        _boundary(area, "outerBoundaryIs", outer)
        for hole in holes:
            _boundary(area, "innerBoundaryIs", hole)


def _style(mark: ET.Element, feature: Feature) -> None:
    """Write colours, which KML has as alpha, blue, green, red."""
    red, green, blue = (feature.colour[k : k + 2] for k in (1, 3, 5))
    colour = blue + green + red
    style = ET.SubElement(mark, "Style")
    if feature.point is not None:
        _said(ET.SubElement(style, "IconStyle"), "color", f"ff{colour}")
        return
    faint = feature.kind == "shock ring"
    line = ET.SubElement(style, "LineStyle")
    _said(line, "color", f"ff{colour}")
    _said(line, "width", 1 if faint else 2)
    fill = FAINT if faint else FILLED
    _said(ET.SubElement(style, "PolyStyle"), "color", fill + colour)


def _boundary(area: ET.Element, side: str, ring: Ring) -> None:
    line = ET.SubElement(ET.SubElement(area, side), "LinearRing")
    _said(line, "coordinates", _places(np.concatenate([ring, ring[:1]])))


def _places(ring: Ring) -> str:
    return " ".join(f"{lon:.9f},{lat:.9f}" for lon, lat in ring)


def _said(parent: ET.Element, name: str, value: object) -> None:
    ET.SubElement(parent, name).text = _printable(str(value))


def _printable(text: str) -> str:
    """Return a text without signs that XML cannot hold at all."""
    return "".join(c for c in text if c.isprintable())
