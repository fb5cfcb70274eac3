import math

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.missions import grid_plan, orbit_plan
from jblast.missions.mission import frame_of, geodetic, level
from jblast.scene import Place

HOME = Place(35.3075, -80.7353, 200.0)


def places(plan):
    frame = frame_of(plan)
    points = [one for one in plan.items if one.command in (16, 18)]
    return np.array(
        [
            level(frame, one.number_of(5), one.number_of(6), HOME.alt_m + one.params[6])
            for one in points
        ]
    )


def test_lanes_cover_a_field_and_turn_about():
    plan = grid_plan(HOME, width_m=60.0, depth_m=20.0, spacing_m=10.0, up_m=15.0)
    want = [(-30, -10), (30, -10), (30, 0), (-30, 0), (-30, 10), (30, 10)]
    assert [one.command for one in plan.items] == [22, *[16] * 6, 20]
    np.testing.assert_allclose(places(plan)[:, :2], want, atol=2e-4)  # 1e-9 degree
    np.testing.assert_allclose(places(plan)[:, 2], 15)


def test_lanes_are_no_further_apart_than_asked_for():
    plan = grid_plan(HOME, width_m=6.0, depth_m=25.0, spacing_m=10.0, up_m=15.0)
    norths = np.unique(places(plan)[:, 1].round(2))
    np.testing.assert_allclose(np.diff(norths), 25 / 3, atol=1e-2)
    with pytest.raises(InputError, match="at most 1000 lanes, got 2501"):
        grid_plan(HOME, width_m=6.0, depth_m=25.0, spacing_m=0.01, up_m=15.0)


def test_an_orbit_is_about_its_middle():
    plan = orbit_plan(HOME, radius_m=-20.0, turns=2.0, up_m=15.0, centre_m=(50.0, 5.0))
    np.testing.assert_allclose(places(plan)[0], (50, 5, 15), atol=2e-4)
    assert plan.items[1].params[:3] == (2, 0, -20)


def test_places_on_earth_and_level_places_are_each_others_inverse():
    frame = frame_of(
        grid_plan(HOME, width_m=6.0, depth_m=0.0, spacing_m=1.0, up_m=15.0)
    )
    there = np.array([[0.0, 0, 0], [3000, -4000, 120], [-15000, 9000, 40]])
    earth = geodetic(frame, there)
    np.testing.assert_allclose(earth[:, 2], there[:, 2] + 200)
    np.testing.assert_allclose(level(frame, *earth.T), there, atol=1e-3)
    # a degree of latitude on the meridian, WGS84 at 35.3 degrees: 110.95 km
    north = level(frame, HOME.lat_deg + 0.01, HOME.lon_deg, 200.0)
    assert math.isclose(north[1], 1109.5, abs_tol=0.5)
