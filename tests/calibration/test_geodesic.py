import pytest

from calibration.gauge_hrr5 import geodesic


def degrees(whole, minutes, seconds):
    return whole + minutes / 60 + seconds / 3600


def test_the_published_line_from_flinders_peak_to_buninyong_comes_out():
    # Geocentric Datum of Australia Technical Manual (GDA2020), Vincenty's inverse
    # formula: 54 972.271 m, 306 52 05.37, 127 10 25.07; GRS80 is WGS 84 to 0.1 mm.
    way = geodesic(
        -degrees(37, 57, 3.72030),
        degrees(144, 25, 29.52440),
        -degrees(37, 39, 10.15610),
        degrees(143, 55, 35.38390),
    )
    assert way.length == pytest.approx(54972.271, abs=1e-3)
    assert way.bearing == pytest.approx(degrees(306, 52, 5.37), abs=0.01 / 3600)
    assert way.back_bearing == pytest.approx(degrees(127, 10, 25.07), abs=0.01 / 3600)


def test_along_a_meridian_it_is_the_quarter_of_the_ellipse():
    way = geodesic(0.0, 10.0, 90.0, 10.0)
    # The quarter of WGS 84's meridian, 10 001 965.729 m.
    assert way.length == pytest.approx(10001965.729, abs=1e-3)
    assert way.bearing == pytest.approx(0.0, abs=1e-9)


def test_the_way_back_is_as_long_and_swaps_the_bearings():
    there, back = (
        geodesic(33.5, -106.3, 36.2, -105.9),
        geodesic(36.2, -105.9, 33.5, -106.3),
    )
    assert back.length == pytest.approx(there.length, abs=1e-6)
    assert back.bearing == pytest.approx(there.back_bearing, abs=1e-9)
