"""A mission as KML 2.2 (OGC 07-147r2): plan, flown path, waypoints, blasts."""

from xml.etree import ElementTree as ET

import numpy as np
from jaxtyping import Float

from jblast.missions.frame import geodetic
from jblast.report.missions.figures import flown_path, planned_path
from jblast.study.missions.records import MissionFlight

NAMESPACE = "http://www.opengis.net/kml/2.2"
PLANNED, FLOWN, BLAST = "ff666666", "ffb27200", "ff005ed5"
"""Colours, which KML has as alpha, blue, green, red."""


def mission_kml(flight: MissionFlight) -> str:
    """Return the text of a document with a mission's paths and places.

    Heights are those of the plan's home and the scene's place, taken as above the sea.
    """
    frame = flight.mission.frame
    root = ET.Element("kml", xmlns=NAMESPACE)
    document = ET.SubElement(root, "Document")
    _said(document, "name", f"Mission: {flight.mission.plan.source}")
    for name, path, colour in (
        ("planned", planned_path(flight), PLANNED),
        ("flown", flown_path(flight), FLOWN),
    ):
        mark = ET.SubElement(document, "Placemark")
        _said(mark, "name", name)
        style = ET.SubElement(ET.SubElement(mark, "Style"), "LineStyle")
        _said(style, "color", colour)
        _said(style, "width", 3)
        line = ET.SubElement(mark, "LineString")
        _said(line, "altitudeMode", "absolute")
        _said(line, "coordinates", _places(geodetic(frame, path)))
    folder = ET.SubElement(document, "Folder")
    _said(folder, "name", "Waypoints")
    for one in flight.waypoints:
        words = "reached" if one.reached else "missed"
        _point(folder, f"{one.item.words}: {words}", geodetic(frame, one.goal_m), "")
    folder = ET.SubElement(document, "Folder")
    _said(folder, "name", "Blasts")
    for one, place in zip(flight.disturbances, flight.places_m, strict=True):
        _point(folder, one.charge or "blast", geodetic(frame, place), BLAST)
    ET.indent(root)
    text = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _point(
    parent: ET.Element, name: str, place: Float[np.ndarray, "3"], colour: str
) -> None:
    mark = ET.SubElement(parent, "Placemark")
    _said(mark, "name", name)
    if colour:
        icon = ET.SubElement(ET.SubElement(mark, "Style"), "IconStyle")
        _said(icon, "color", colour)
    point = ET.SubElement(mark, "Point")
    _said(point, "altitudeMode", "absolute")
    _said(point, "coordinates", _places(place[None]))


def _places(places: Float[np.ndarray, "place 3"]) -> str:
    return " ".join(f"{lon:.9f},{lat:.9f},{alt:.3f}" for lat, lon, alt in places)


def _said(parent: ET.Element, name: str, value: object) -> None:
    text = "".join(c for c in str(value) if c.isprintable())
    ET.SubElement(parent, name).text = text
