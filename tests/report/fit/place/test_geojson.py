"""GeoJSON against RFC 7946, section by section, and against the map it holds."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from jblast.inference.fitting.place import LEVELS
from jblast.observations.places import Frame
from jblast.report.fit.geo_files import features, geojson, write_place
from jblast.report.fit.place import ground_map
from tests.report.fit.place.located import BEIRUT, arc, around, located, normal_draws

COVARIANCE = [[60.0, 20.0], [20.0, 30.0]]
FIJI = Frame(-16.5, 179.9995, 0.0)


def five(frame: Frame | None = BEIRUT, **other):
    draws = normal_draws((12.0, -30.0), COVARIANCE)
    return located(around(5, 220.0), draws, centre=(12.0, -30.0), frame=frame, **other)


def curved(frame=BEIRUT):
    return located(around(3, 20.0), arc(), centre=(99.0, 67.0), frame=frame)


def collection(fit):
    shown = ground_map(fit)
    assert shown is not None
    text = geojson(features(shown, fit.observations.frame, fit))
    return json.loads(text)


def of_kind(kind, found):
    return [f for f in found["features"] if f["properties"]["kind"] == kind]


def polygons(feature):
    geometry = feature["geometry"]
    parts = geometry["coordinates"]
    return {"Point": [], "Polygon": [parts], "MultiPolygon": parts}[geometry["type"]]


def area(ring):
    x, y = (np.array(ring) - ring[0]).T
    return 0.5 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])


CASES = [five, curved, lambda: five(FIJI), lambda: located([[3.0, 4.0]], frame=BEIRUT)]


@pytest.mark.parametrize("make", CASES)
def test_it_is_a_feature_collection_of_rfc_7946(make):
    found = collection(make())
    assert found["type"] == "FeatureCollection"  # 3.3
    assert found["features"]
    for feature in found["features"]:
        assert set(feature) == {"type", "geometry", "properties"}  # 3.2, 7.1
        assert feature["type"] == "Feature"
        assert isinstance(feature["properties"], dict)
        geometry = feature["geometry"]
        assert set(geometry) == {"type", "coordinates"}
        assert geometry["type"] in ("Point", "Polygon", "MultiPolygon")
        if geometry["type"] == "Point":
            lon, lat = geometry["coordinates"]  # 3.1.1
            assert -180 <= lon <= 180
            assert -90 <= lat <= 90
        for rings in polygons(feature):  # 3.1.6
            for k, ring in enumerate(rings):
                assert len(ring) >= 4
                assert ring[0] == ring[-1]
                assert (area(ring) > 0) == (k == 0)  # right-hand rule
                assert all(-180 <= x <= 180 and -90 <= y <= 90 for x, y in ring)


def test_sensors_come_back_to_where_the_log_put_them():
    fit = five()
    found = of_kind("sensor", collection(fit))
    at = np.array([f["geometry"]["coordinates"] for f in found])
    up = fit.observations.position[:, 2]
    enu = BEIRUT.to_enu(at[:, 1], at[:, 0], BEIRUT.alt_m + up)
    # nine decimals of a degree are 0.1 mm
    assert enu[:, :2] == pytest.approx(fit.observations.position[:, :2], abs=1e-3)
    told = [f["properties"]["residual_sd"] for f in found]
    assert told == pytest.approx(fit.residual)


def test_ellipses_hold_their_share_and_tell_their_axes():
    fit = five()
    east, north = fit.draws["charge_east_m"], fit.draws["charge_north_m"]
    where = BEIRUT.to_geodetic(np.stack([east, north, 0 * east], axis=-1))
    wide, narrow = of_kind("ellipse", collection(fit))
    for feature, share in ((wide, 0.9), (narrow, 0.5)):
        assert feature["properties"]["share"] == share
        ring = np.array(polygons(feature)[0][0])
        held = inside(ring, where[:, 1::-1])
        # of 120 corners: 0.05 % of the area lies outside them
        assert held.mean() == pytest.approx(share, abs=5e-3)
    values = np.linalg.eigvalsh(COVARIANCE)
    # 2,000 draws know a half axis to 2 %
    lengths = [wide["properties"][f"semi_{axis}_m"] for axis in ("minor", "major")]
    assert lengths == pytest.approx(np.sqrt(4.605 * values), rel=0.08)


def inside(ring, places):
    """Whether places lie in a ring: how often a ray to the east crosses it."""
    crossed = np.zeros(len(places), int)
    for (x1, y1), (x2, y2) in pairwise(ring):
        passes = (y1 > places[:, 1]) != (y2 > places[:, 1])
        with np.errstate(divide="ignore", invalid="ignore"):
            at = x1 + (places[:, 1] - y1) / (y2 - y1) * (x2 - x1)
        crossed += passes & (places[:, 0] < at)
    return crossed % 2 == 1


def test_a_curved_posterior_has_regions_and_says_that_its_ellipse_misleads():
    found = collection(curved())
    assert [f["properties"]["share"] for f in of_kind("region", found)] == [0.9, 0.5]
    assert all(f["properties"]["misleads"] for f in of_kind("ellipse", found))
    assert not any(
        f["properties"]["misleads"] for f in of_kind("ellipse", collection(five()))
    )


def test_rings_are_as_wide_as_they_say():
    found = of_kind("shock ring", collection(five()))
    assert [f["properties"]["peak_overpressure_pa"] for f in found] == list(LEVELS)
    for feature in found:
        told = feature["properties"]
        assert told["range_m.q05"] < told["range_m"] < told["range_m.q95"]
        at = np.array(polygons(feature)[0][0])
        enu = BEIRUT.to_enu(at[:, 1], at[:, 0], BEIRUT.alt_m)
        away = np.hypot(enu[:, 0] - 12.0, enu[:, 1] + 30.0)
        assert away == pytest.approx(told["range_m"], rel=1e-5)


def test_what_crosses_the_180th_meridian_is_cut_there():
    """The frame lies 53 m west of it."""
    for feature in of_kind("shock ring", collection(five(FIJI))):
        parts = polygons(feature)
        if feature["properties"]["range_m"] < 41.0:
            assert len(parts) == 1
            continue
        west, east = sorted((np.array(p[0]) for p in parts), key=lambda p: -p[0, 0])
        assert west[:, 0].max() == 180.0
        assert west[:, 0].min() > 179.0
        assert east[:, 0].min() == -180.0
        assert east[:, 0].max() < -179.0
        whole = collection(five(replace(FIJI, lon_deg=10.0)))
        (same,) = (
            f
            for f in of_kind("shock ring", whole)
            if f["properties"]["name"] == feature["properties"]["name"]
        )
        uncut = area(polygons(same)[0][0])
        assert area(west) + area(east) == pytest.approx(uncut, rel=1e-6)


def test_what_is_not_a_number_is_null_and_names_stay_as_they_are():
    fit = five(residuals=[np.nan, 1.0, -2.5, 0.0, 3.4])
    names = ("</kml>&\"'", "Küche", "m3", "m4", "m5")
    table = replace(fit.observations, sensor=names)
    found = of_kind("sensor", collection(replace(fit, observations=table)))
    assert [f["properties"]["name"] for f in found] == list(names)
    assert found[0]["properties"]["residual_sd"] is None


def test_without_a_frame_nothing_is_written(tmp_path):
    assert write_place(five(None), tmp_path) == []
    assert list(tmp_path.iterdir()) == []
    written = write_place(five(), tmp_path)
    assert [path.name for path in written] == ["place.geojson", "place.kml"]
    assert json.loads(written[0].read_text("utf-8"))["type"] == "FeatureCollection"
