"""Maps of fits: figure, GeoJSON by RFC 7946, and KML, of the same features."""

import json
from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from matplotlib.path import Path

from jblast.inference.fitting.place import LEVELS
from jblast.observations.places import Frame
from jblast.report import map_figures, maps
from jblast.report.figures import figure_bytes
from jblast.report.fit_map import map_of_fit, place_files
from tests.report.fit.place.located import BEIRUT, arc, around, located, normal_draws

COVARIANCE = [[60.0, 20.0], [20.0, 30.0]]
FIJI = Frame(-16.5, 179.9995, 0.0)
EAST, NORTH = 685_800.0, 3_752_000.0


def five(frame: Frame | None = BEIRUT, **other):
    draws = normal_draws((12.0, -30.0), COVARIANCE)
    return located(around(5, 220.0), draws, centre=(12.0, -30.0), frame=frame, **other)


def curved(**other):
    draws = arc()
    return located(around(5, 20.0), draws, centre=(99.0, 67.0), frame=BEIRUT, **other)


CASES = {
    "one sensor": lambda: located([[30.0, 12.0]], frame=BEIRUT),
    "five": five,
    "wind and outlier": lambda: five(wind=(3.0, -4.0), suspected=(2,)),
    "two hundred": lambda: located(
        around(200, 800.0), normal_draws((4.0, 8.0), np.eye(2) * 900), suspected=(3, 77)
    ),
    "arc": curved,
    "one coordinate": lambda: located(
        around(3, 20.0), normal_draws((0, 0), [[4.0, 0.0], [0.0, 0.0]])
    ),
    "no residual": lambda: located(around(2, 30.0), residuals=[np.nan, np.nan], up=9.0),
}


def drawn(fit, accepted=None):
    shown = map_of_fit(fit, accepted)
    assert shown is not None
    return map_figures.map_figure(shown)


@pytest.mark.parametrize("case", CASES)
def test_a_map_has_equal_scales_and_all_sensors_in_view(case):
    fit = CASES[case]()
    figure = drawn(fit)
    assert figure_bytes(figure).startswith(b"\x89PNG")
    axes = figure.axes[0]
    (west, east), (south, north) = axes.get_xlim(), axes.get_ylim()
    box = axes.get_window_extent()
    # drawn to a pixel
    assert (east - west) / box.width == pytest.approx(
        (north - south) / box.height, rel=0.01
    )
    for x, y, _ in fit.observations.position:
        assert west < x < east
        assert south < y < north


def test_more_than_forty_names_are_left_out_except_suspected_sensors():
    names = {text.get_text() for text in drawn(CASES["two hundred"]()).axes[0].texts}
    assert {"m4", "m78", "charge"} <= names
    assert "m5" not in names


def test_wind_and_ranges_stand_at_the_map():
    figure = drawn(CASES["wind and outlier"]())
    assert "wind 5 m/s towards 143°" in figure.axes[0].get_title("right")
    title = figure.legends[0].get_title().get_text()
    assert "1 kPa to 203 m*" in title.replace("\n", " ")
    assert "33.89" in title


def test_a_dot_is_enlarged_with_an_accepted_position_near_it():
    draws = normal_draws((3.0, 4.0), 0.1 * np.eye(2))
    fit = located(around(7, 2e3), draws, centre=(3.0, 4.0))
    names = "charge_east_m", "charge_north_m"
    accepted = {name: (x, "paper") for name, x in zip(names, (5.0, 4.0), strict=True)}
    west, east = drawn(fit, accepted).axes[1].get_xlim()
    assert west < 3.0 < 5.0 < east
    assert east - west < 8.0
    wrong = accepted | {"charge_east_m": (500.0, "paper")}
    assert drawn(fit, wrong).axes[1].get_xlim()[1] < 8.0


def test_positions_far_from_the_origin_are_in_full_digits():
    far = [[EAST, NORTH], [EAST + 25.0, NORTH + 10.0]]
    figure = drawn(located(far, centre=(EAST + 9.0, NORTH)))
    figure.draw_without_rendering()
    ticks = [tick.get_text() for tick in figure.axes[0].get_xticklabels()]
    assert "685.81" in ticks
    assert len(set(ticks)) == len(ticks)


def collection(fit):
    return json.loads(place_files(fit)["place.geojson"])["features"]


def of_kind(kind, fit):
    return [f for f in collection(fit) if f["properties"]["kind"] == kind]


def polygons(feature):
    geometry = feature["geometry"]
    parts = geometry["coordinates"]
    return {"Point": [], "Polygon": [parts], "MultiPolygon": parts}[geometry["type"]]


def area(ring):
    x, y = (np.array(ring) - ring[0]).T
    return 0.5 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])


@pytest.mark.parametrize("make", [five, curved, CASES["one sensor"]])
def test_the_file_is_a_feature_collection_of_rfc_7946(make):
    for feature in collection(make()):
        assert set(feature) == {"type", "geometry", "properties"}  # 3.2, 7.1
        assert feature["type"] == "Feature"
        assert set(feature["geometry"]) == {"type", "coordinates"}
        if feature["geometry"]["type"] == "Point":
            lon, lat = feature["geometry"]["coordinates"]  # 3.1.1
            assert (lon, lat) == pytest.approx((35.5, 33.9), abs=0.1)
        for rings in polygons(feature):  # 3.1.6
            for k, ring in enumerate(rings):
                assert len(ring) >= 4
                assert ring[0] == ring[-1]
                assert (area(ring) > 0) == (k == 0)  # right-hand rule


def test_sensors_are_at_their_positions_in_the_log():
    fit = five()
    found = of_kind("sensor", fit)
    at = np.array([f["geometry"]["coordinates"] for f in found])
    up = fit.observations.position[:, 2]
    enu = BEIRUT.to_enu(at[:, 1], at[:, 0], BEIRUT.alt_m + up)
    # nine decimals of a degree are 0.1 mm
    assert enu[:, :2] == pytest.approx(fit.observations.position[:, :2], abs=1e-3)
    given = [f["properties"]["residual_sd"] for f in found]
    assert given == pytest.approx(fit.residual)


def test_ellipses_contain_their_share_and_state_their_axes():
    fit = five()
    east, north = fit.draws["charge_east_m"], fit.draws["charge_north_m"]
    where = BEIRUT.to_geodetic(np.stack([east, north, 0 * east], axis=-1))
    found = of_kind("ellipse", fit)
    for feature, share in zip(found, (0.9, 0.5), strict=True):
        assert feature["properties"]["share"] == share
        assert not feature["properties"]["misleads"]
        inside = Path(polygons(feature)[0][0]).contains_points(where[:, 1::-1])
        # of 120 corners: 0.05 % of the area lies outside them
        assert inside.mean() == pytest.approx(share, abs=5e-3)
    lengths = [found[0]["properties"][f"semi_{axis}_m"] for axis in ("minor", "major")]
    # 2,000 draws determine a half axis to 2 %
    values = np.linalg.eigvalsh(COVARIANCE)
    assert lengths == pytest.approx(np.sqrt(4.605 * values), rel=0.08)


def test_a_curved_posterior_has_regions_and_an_ellipse_that_misleads():
    shares = [f["properties"]["share"] for f in of_kind("region", curved())]
    assert shares == [0.9, 0.5]
    assert all(f["properties"]["misleads"] for f in of_kind("ellipse", curved()))


@pytest.mark.parametrize("frame", [BEIRUT, FIJI])
def test_rings_have_their_radius_also_across_the_180th_meridian(frame):
    found = of_kind("shock ring", five(frame))
    assert [f["properties"]["peak_overpressure_pa"] for f in found] == list(LEVELS)
    for feature in found:
        numbers = feature["properties"]
        assert numbers["range_m.q05"] < numbers["range_m"] < numbers["range_m.q95"]
        at = np.array(polygons(feature)[0][0])
        assert np.ptp(at[:, 0]) < 1.0
        enu = frame.to_enu(at[:, 1], at[:, 0], frame.alt_m)
        away = np.hypot(enu[:, 0] - 12.0, enu[:, 1] + 30.0)
        assert away == pytest.approx(numbers["range_m"], rel=1e-5)


@pytest.mark.parametrize("make", [five, curved])
def test_kml_contains_what_geojson_contains(make):
    fit = make(residuals=[np.nan, 1.0, -2.5, 0.0, 3.4])
    table = fit.observations
    names = ("</kml>&\"'\x07", "Küche", *table.sensor[2:])
    fit = replace(fit, observations=replace(table, sensor=names))
    root = ET.fromstring(place_files(fit)["place.kml"])
    space = "{http://www.opengis.net/kml/2.2}"
    marks = [m for m in root.iter(f"{space}Placemark")]
    expected = collection(fit)
    sensors = [f["properties"] for f in expected if f["properties"]["kind"] == "sensor"]
    assert [one["name"] for one in sensors] == list(names)
    assert sensors[0]["residual_sd"] is None
    by_name = {m.findtext(f"{space}name"): m for m in marks}
    assert len(by_name) == len(expected)
    for feature in expected:
        numbers = feature["properties"]
        mark = by_name[numbers["name"].replace("\x07", "")]
        count = len(list(mark.iter(f"{space}coordinates")))
        assert count == max(1, sum(len(part) for part in polygons(feature)))
        entries = mark.iter(f"{space}Data")
        data = {e.get("name"): e.findtext(f"{space}value") for e in entries}
        for name, value in data.items():
            assert value == str(json.dumps(numbers[name])).strip('"')


def test_without_a_frame_or_simplekml_files_are_left_out(monkeypatch):
    assert place_files(five(None)) == {}
    assert [*place_files(five())] == ["place.geojson", "place.kml"]
    monkeypatch.setattr(maps.importlib.util, "find_spec", lambda name: None)
    assert [*place_files(five())] == ["place.geojson"]
