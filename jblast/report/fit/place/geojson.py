"""The map as GeoJSON (RFC 7946): longitude before latitude, WGS84, rings closed."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from jblast.json_values import plain
from jblast.report.fit.place.antimeridian import Polygon
from jblast.report.fit.place.features import Feature

DECIMALS = 9
"""Of a degree: a tenth of a millimetre."""


def geojson(features: Sequence[Feature]) -> str:
    """Return the text of a feature collection, a line a feature.

    Colours are named as simplestyle-spec 1.1 names them, which viewers know.
    """
    lines = [
        json.dumps(_feature(f), ensure_ascii=False, allow_nan=False) for f in features
    ]
    body = ",\n".join(lines)
    return f'{{"type": "FeatureCollection", "features": [\n{body}\n]}}\n'


def _feature(feature: Feature) -> dict[str, Any]:
    style: dict[str, Any] = {"marker-color": feature.colour}
    if feature.point is None:
        faint = feature.kind == "shock ring"
        style = {
            "stroke": feature.colour,
            "stroke-width": 1 if faint else 2,
            "fill": feature.colour,
            "fill-opacity": 0.03 if faint else 0.15,
        }
    return {
        "type": "Feature",
        "geometry": _geometry(feature),
        "properties": plain(
            {"kind": feature.kind, "name": feature.name} | feature.properties | style
        ),
    }


def _geometry(feature: Feature) -> dict[str, Any]:
    if feature.point is not None:
        lon, lat = feature.point
        at = [round(lon, DECIMALS), round(lat, DECIMALS)]
        return {"type": "Point", "coordinates": at}
    areas = [_rings(polygon) for polygon in feature.polygons]
    if len(areas) == 1:
        return {"type": "Polygon", "coordinates": areas[0]}
    return {"type": "MultiPolygon", "coordinates": areas}


def _rings(polygon: Polygon) -> list[list[list[float]]]:
    closed = (np.concatenate([ring, ring[:1]]) for ring in polygon)
    return [np.round(ring, DECIMALS).tolist() for ring in closed]
