"""KML read back: the same places as in GeoJSON, in the schema's order."""

import json
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from jblast.report.fit.geo_files import features, geojson, kml
from jblast.report.fit.place import ground_map
from tests.report.fit.place.located import BEIRUT, arc, around, located, normal_draws

KML = "{http://www.opengis.net/kml/2.2}"


def written(fit):
    shown = ground_map(fit)
    assert shown is not None
    found = features(shown, BEIRUT, fit)
    root = ET.fromstring(kml(found, "Blast fit: a & b"))
    return root, json.loads(geojson(found))["features"]


def example(draws=None, **other):
    draws = normal_draws((3.0, 4.0), np.eye(2)) if draws is None else draws
    return located(around(5, 90.0), draws, centre=(3.0, 4.0), frame=BEIRUT, **other)


def coordinates(element):
    return np.array(
        [[float(x) for x in place.split(",")] for place in element.text.split()]
    )


@pytest.mark.parametrize("fit", [example(), example(arc())], ids=["normal", "arc"])
def test_it_holds_what_geojson_holds(fit):
    root, expected = written(fit)
    assert root.tag == f"{KML}kml"
    marks = {m.findtext(f"{KML}name"): m for m in root.iter(f"{KML}Placemark")}
    assert set(marks) == {f["properties"]["name"] for f in expected}
    for feature in expected:
        mark, geometry = marks[feature["properties"]["name"]], feature["geometry"]
        found = [coordinates(e) for e in mark.iter(f"{KML}coordinates")]
        parts = geometry["coordinates"]
        told = {
            "Point": lambda parts=parts: [[parts]],
            "Polygon": lambda parts=parts: parts,
            "MultiPolygon": lambda parts=parts: [r for area in parts for r in area],
        }[geometry["type"]]()
        assert len(found) == len(told)
        for one, other in zip(found, told, strict=True):
            assert one == pytest.approx(np.array(other), abs=2e-9)
        data = {
            entry.get("name"): entry.findtext(f"{KML}value")
            for entry in mark.iter(f"{KML}Data")
        }
        for name, value in data.items():
            assert value == str(json.dumps(feature["properties"][name])).strip('"')
