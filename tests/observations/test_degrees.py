"""Logs that give latitudes and longitudes."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import jblast
from jblast.errors import InputError
from jblast.observations import write
from jblast.observations.places import Frame, mean_frame
from jblast.report.messages import sentences_of

HEAD = "sensor,quantity,value,sigma,lat_deg,lon_deg,alt_m\n"
LOG = HEAD + (
    "a,air_arrival_s,1.0,0.01,33.9,35.5,10\n"
    "b,air_arrival_s,1.1,0.01,33.902,35.5,20\n"
    "b,peak_overpressure_pa,900,90,33.902,35.5,20\n"
)


def read(tmp_path, text, **options):
    path = tmp_path / "log.csv"
    path.write_text(text)
    return jblast.read(path, **options)


def test_places_are_metres_about_the_middle_of_the_sensors(tmp_path):
    log = read(tmp_path, LOG)
    assert log.frame is not None
    assert (log.frame.lat_deg, log.frame.alt_m) == pytest.approx((33.901, 15.0))
    # a degree of latitude is 110.92 km there (6355.2 km, the meridian's radius)
    assert log.position[:, 1] == pytest.approx([-110.92, 110.92, 110.92], abs=0.01)
    assert log.position[:, 2] == pytest.approx([-5, 5, 5], abs=0.001)


@pytest.mark.parametrize(
    ("lat", "lon"),
    [
        ('48°12\'00.3238""N', '11°30\'02.9057""W'),
        ("48° 12.0053967' N", "W 11°30.0484283'"),
        ("48°12′00,3238″N", "11.500807139 °W"),
        ("48.200089944", "-11.500807139"),
    ],
)
def test_degrees_minutes_and_seconds_have_a_hemisphere(tmp_path, lat, lon):
    row = f'a,air_arrival_s,1.0,0.01,"{lat}","{lon}",0\n'
    frame = read(tmp_path, HEAD + row).frame
    assert frame is not None
    assert frame.lat_deg == pytest.approx(48.200089944, abs=2e-9)
    assert frame.lon_deg == pytest.approx(-11.500807139, abs=2e-9)


def test_longitudes_above_180_are_west_and_reported(tmp_path):
    west = read(tmp_path, LOG.replace(",35.5,", ",355.5,"))
    same = read(tmp_path, LOG.replace(",35.5,", ",-4.5,"))
    assert west.frame is not None
    assert west.frame.lon_deg == pytest.approx(-4.5)
    assert west.position == pytest.approx(same.position, abs=1e-6)
    (words,) = sentences_of(west.understood)
    assert words == "lon_deg above 180 was read as west: less 360 (3 rows)"
    assert not same.understood


def test_what_is_written_is_read_again(tmp_path):
    log = read(tmp_path, LOG)
    write(tmp_path / "again.csv", log)
    again = jblast.read(tmp_path / "again.csv")
    assert again.frame is not None
    assert vars(again.frame) == pytest.approx(vars(log.frame), abs=1e-9)
    assert again.position == pytest.approx(log.position, abs=1e-6)


def test_heights_are_above_the_ground_or_left_out(tmp_path):
    ground = read(tmp_path, LOG.replace("alt_m", "up_m"))
    assert ground.frame is not None
    assert ground.frame.alt_m == 0
    assert ground.position[:, 2] == pytest.approx([10, 20, 20], abs=0.002)
    none = read(
        tmp_path,
        LOG.replace(",alt_m", "").replace(",10\n", "\n").replace(",20\n", "\n"),
    )
    assert none.position[:, 2] == pytest.approx([0, 0, 0], abs=0.002)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("33.9,35.5,10", "133.9,35.5,10", "line 2, column lat_deg: .*swapped"),
        ("33.9,35.5,10", "33.9,400,10", "line 2, column lon_deg: .*between -180 and"),
        ("33.9,35.5,10", "33.9,,10", "line 2, column lon_deg: .*got nothing"),
        ("33.902,35.5,20", "33.902,35.5,", "line 3, column alt_m: .*got nothing"),
        ("33.9,35.5,10", "33.9,35.5,1e6", "line 2, column alt_m"),
        ("33.9,35.5,10", "-33.9,35.5,10", "line 2, column lat_deg: .*sign missing"),
        ("33.9,35.5,10", "N33.9,35.5,10", "line 2, column lat_deg: .*number"),
        ("33.9,", "33°54',", "line 2, column lat_deg: .*with the hemisphere"),
        ("33.9,", "33°61'N,", "line 2, column lat_deg: .*got"),
        ("33.9,", "３３.9,", "line 2.*got '３３.9'"),
    ],
)  # fmt: skip
def test_what_is_no_place_is_refused(tmp_path, old, new, said):
    with pytest.raises(InputError, match=said):
        read(tmp_path, LOG.replace(old, new))


@pytest.mark.parametrize(
    ("extra", "filled", "said"),
    [
        ("east_m,north_m,up_m", "1,2,3", "line 2, column east_m: .*beside degrees"),
        ("up_m", "3", "line 2, column up_m: .*got both"),
    ],
)
def test_metres_and_degrees_are_not_mixed(tmp_path, extra, filled, said):
    lines = LOG.splitlines()
    nothing = "," * filled.count(",")
    rows = [f"{lines[1]},{filled}", *(f"{line},{nothing}" for line in lines[2:])]
    with pytest.raises(InputError, match=said):
        read(tmp_path, "\n".join([f"{lines[0]},{extra}", *rows]))


# WGS84: semi-major axis and flattening, NIMA TR8350.2, table 3.1
A, F = 6378137.0, 1 / 298.257223563


def ecef(lat_deg, lon_deg, alt):
    """Earth-fixed point (Hofmann-Wellenhof et al., GPS Theory, eq. 10.2)."""
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    e2 = F * (2 - F)
    normal = A / np.sqrt(1 - e2 * np.sin(lat) ** 2)
    return np.array(
        [
            (normal + alt) * np.cos(lat) * np.cos(lon),
            (normal + alt) * np.cos(lat) * np.sin(lon),
            (normal * (1 - e2) + alt) * np.sin(lat),
        ]
    )


@settings(max_examples=50, deadline=None)
@given(
    st.floats(-90, 90), st.floats(-180, 180), st.floats(-400, 8000),
    st.floats(-30e3, 30e3), st.floats(-30e3, 30e3), st.floats(-500, 3000),
)  # fmt: skip
def test_there_and_back_is_within_a_micrometre(lat, lon, alt, east, north, up):
    frame = Frame(lat, lon, alt)
    place = frame.to_geodetic(np.array([east, north, up]))
    assert -90 <= place[0] <= 90
    assert -180 <= place[1] < 180
    assert frame.to_enu(*place) == pytest.approx([east, north, up], abs=1e-6)


@settings(max_examples=50, deadline=None)
@given(st.floats(-90, 90), st.floats(-180, 180), st.floats(-0.3, 0.3))
def test_distances_are_those_through_the_earth_fixed_frame(lat, lon, off):
    frame = Frame(lat, lon, 100.0)
    there = (np.clip(lat + off, -90, 90), lon + off, 250.0)
    apart = np.linalg.norm(ecef(*there) - ecef(lat, lon, 100.0))
    assert np.linalg.norm(frame.to_enu(*there)) == pytest.approx(apart, abs=1e-6)


def test_axes_point_east_north_and_up():
    frame = Frame(33.9, 35.5, 10.0)
    places = [[33.9, 33.901, 33.9], [35.501, 35.5, 35.5], [10.0, 10.0, 12.0]]
    east, north, up = frame.to_enu(*np.array(places))
    # radii of curvature at 33.9 degrees: prime vertical 6384.8 km, meridian 6355.2 km
    assert east == pytest.approx([6384793 * np.radians(1e-3) * 0.83001, 0, 0], abs=0.05)
    assert north == pytest.approx([0, 6355200 * np.radians(1e-3), 0], abs=0.05)
    assert up == pytest.approx([0, 0, 2], abs=1e-6)


def test_the_middle_over_the_date_line_and_the_pole_is_between():
    over = mean_frame(*np.array([[10.0, 10.0], [179.99, -179.99], [0.0, 20.0]]))
    assert abs(over.lon_deg) == pytest.approx(180.0)
    assert over.alt_m == 10.0
    both = np.array([[89.99, 89.99], [0.0, 180.0], [0.0, 0.0]])
    pole = mean_frame(*both)
    assert pole.lat_deg == pytest.approx(90.0)
    places = pole.to_enu(*both)
    assert np.linalg.norm(places[0] - places[1]) == pytest.approx(2 * 1117, abs=1)
