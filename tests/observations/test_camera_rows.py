"""What a log says of a camera, and the scene with it: what goes together."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations import resolve_positions
from jblast.scene import Camera, Charge, Scene, Sensor
from jblast.sensors import planned_layout

HEADER = "sensor,quantity,value,sigma,time_s\n"
PLACED = "sensor,quantity,value,sigma,east_m,north_m,up_m,time_s\n"
RADIUS = "c,fireball_radius_px,30,1,0.004\n"


def camera(*position: float) -> Camera:
    at = np.array(position or (0.0, -100.0, 2.0))
    ahead = np.array([1.0, 0.0, 0.0, 0.0])
    return Camera(at, ahead, np.full(2, 900.0), np.array([320, 240]), 640, 480)


def test_a_radius_in_an_image_is_seen_from_the_camera(table):
    placed = resolve_positions(table(HEADER + RADIUS), Scene(camera=camera()))
    np.testing.assert_array_equal(placed.position, [[0.0, -100.0, 2.0]])


def test_a_radius_in_metres_needs_neither_place_nor_camera(table):
    text = HEADER + "c,fireball_radius_m,4,,0.004\n"
    assert np.isnan(resolve_positions(table(text), Scene()).position).all()


SEEN = "c,bearing_rad,-0.1,0.01,3,4,0,\n"
BAD = {
    "no camera": (HEADER + RADIUS, Scene(), ["line 2", "[camera]", "got none"]),
    "another place": (
        PLACED + "c,fireball_radius_px,30,1,5,0,0,0.004\n",
        Scene(camera=camera()),
        ["line 2", "'c'", "[5, 0, 0] m", "expected [0, -100, 2] m"],
    ),
    "on the charge": (
        HEADER + RADIUS,
        Scene(camera=camera(0.0, 0.0, 0.0)),
        ["line 2", "where the charge is"],
    ),
    "before the explosion": (
        HEADER + RADIUS.replace("0.004", "-0.004"),
        Scene(camera=camera()),
        ["line 2", "column time_s", "-0.004", "after the origin time, 0 s"],
    ),
    "metres at the explosion": (
        HEADER + "c,fireball_radius_m,30,1,2\n",
        Scene(Charge(time_s=2.0)),
        ["line 2", "column time_s", "after the origin time, 2 s"],
    ),
    "a direction beside a range": (
        PLACED + SEEN,
        Scene(Charge(range_m=5.0)),
        ["line 2", "bearing_rad", "no direction"],
    ),
    "a direction from nowhere": (
        HEADER + "c,elevation_rad,0.1,0.01,\n",
        Scene(),
        ["line 2", "east_m, north_m, up_m"],
    ),
}


@pytest.mark.parametrize(("text", "scene", "said"), BAD.values(), ids=BAD)
def test_what_does_not_go_together_is_refused(table, text, scene, said):
    with pytest.raises(InputError) as error:
        resolve_positions(table(text), scene)
    for words in said:
        assert words in str(error.value)


def test_a_free_origin_time_may_come_before_it_all(table):
    text = HEADER + RADIUS.replace("0.004", "-0.004")
    resolve_positions(table(text), Scene(camera=camera()), ["origin_time_s"])


PLANS = {
    "no times": ({}, None, ["'c' records fireball_radius_m", "times_s", "got none"]),
    "times before it": (
        {"times_s": (-1.0, 1.0)},
        None,
        ["after the origin time", "got -1"],
    ),
    "no camera": (
        {"records": (("fireball_radius_px", 0.1),), "times_s": (1.0,)},
        None,
        ["'c'", "[camera]", "got none"],
    ),
    "a range": (
        {"records": (("bearing_rad", 0.1),)},
        5.0,
        ["'c' records bearing_rad", "no direction"],
    ),
}


@pytest.mark.parametrize(("changed", "distance", "said"), PLANS.values(), ids=PLANS)
def test_a_plan_that_cannot_be_recorded_is_refused(changed, distance, said):
    given = {"records": (("fireball_radius_m", 0.1),)} | changed
    sensor = Sensor("c", np.array([3.0, 4.0, 0.0]), **given)
    scene = Scene(Charge(range_m=distance), sensors=(sensor,))
    with pytest.raises(InputError) as error:
        planned_layout(scene)
    for words in said:
        assert words in str(error.value)


def test_a_plan_has_a_row_for_each_time():
    records = (("fireball_radius_px", 0.1), ("flash_time_s", 1e-3))
    sensor = Sensor("c", np.full(3, np.nan), records=records, times_s=(0.1, 0.2))
    scene = Scene(Charge(range_m=5.0), sensors=(sensor,), camera=camera())
    layout, sigma, _ = planned_layout(scene)
    np.testing.assert_array_equal(layout.time, [0.1, 0.2, np.nan])
    np.testing.assert_array_equal(sigma, [0.1, 0.1, 1e-3])
