"""The local frame against formulas that share no code with it."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.observations.places import Frame, mean_frame

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
