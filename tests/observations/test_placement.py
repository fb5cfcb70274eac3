"""Places of a log, of cameras and of the scene: what goes together."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations import resolve_positions
from jblast.scene import Air, Camera, Charge, Scene, Sensor
from jblast.sensors import planned_layout

BARE = "sensor,quantity,value,sigma\n"
POSITION = "sensor,quantity,value,sigma,east_m,north_m,up_m\n"
RANGE = "sensor,quantity,value,sigma,range_m\n"


def scene(**sensors):
    return Scene(
        sensors=tuple(Sensor(name, np.array(at)) for name, at in sensors.items())
    )


def test_a_place_comes_from_the_scene_where_the_log_has_none(table):
    observations = table(POSITION + "a,air_arrival_s,1,,,,\nb,air_arrival_s,2,,4,5,6\n")
    placed = resolve_positions(observations, scene(a=[1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(placed.position, [[1, 2, 3], [4, 5, 6]])
    assert np.isnan(observations.position[0]).all()  # the log itself is unchanged


def test_a_place_given_twice_may_differ_by_less_than_a_millimetre(table):
    observations = table(POSITION + "a,air_arrival_s,1,,1,2,3\n")
    placed = resolve_positions(observations, scene(a=[1.0, 2.0, 3.0009]))
    np.testing.assert_array_equal(placed.position, [[1, 2, 3]])
    with pytest.raises(InputError) as caught:
        resolve_positions(observations, scene(a=[1.0, 2.0, 3.002]))
    for said in ("log.csv: line 2", "'a'", "[1, 2, 3] m", "[1, 2, 3.002] m"):
        assert said in str(caught.value)


def test_a_sensor_without_a_place_is_named(table):
    observations = table(BARE + "a,air_arrival_s,1,\nb,air_arrival_s,2,\n")
    with pytest.raises(InputError, match=r"line 3: expected east_m.*named 'b'"):
        resolve_positions(observations, scene(a=[1.0, 2.0, 3.0]))


def test_a_shock_radius_needs_no_place(table):
    text = "sensor,quantity,value,sigma,time_s\ncamera,shock_radius_m,11,,1e-4\n"
    assert np.isnan(resolve_positions(table(text), Scene()).position).all()


def test_one_sensor_needs_no_place_where_the_scene_gives_its_range(table):
    ranged = Scene(Charge(range_m=20.0))
    assert len(resolve_positions(table(BARE + "a,air_arrival_s,1,\n"), ranged)) == 1
    with pytest.raises(InputError, match=r"line 3: .*one sensor, 'a'; got 'b'"):
        resolve_positions(
            table(BARE + "a,air_arrival_s,1,\nb,air_arrival_s,2,\n"), ranged
        )


@pytest.mark.parametrize("name", ["charge_east_m", "charge_north_m"])
def test_a_range_beside_a_free_place_is_refused(table, name):
    with pytest.raises(InputError, match=f"line 2, column range_m.*{name}.*got range"):
        resolve_positions(table(RANGE + "a,air_arrival_s,1,,20\n"), Scene(), {name})


def test_a_range_in_the_log_and_in_the_scene_must_agree(table):
    observations = table(RANGE + "a,air_arrival_s,1,,20\n")
    assert len(resolve_positions(observations, Scene(Charge(range_m=20.0)))) == 1
    with pytest.raises(InputError, match=r"line 2, column range_m: got 20.*21\.0"):
        resolve_positions(observations, Scene(Charge(range_m=21.0)))
    with pytest.raises(InputError, match=r"line 2.*\[charge\] range_m.*not fixed"):
        resolve_positions(observations, Scene(Charge(range_m=20.0)), {"charge_range_m"})


def test_a_range_in_the_log_must_agree_with_a_sensor_of_the_scene(table):
    observations = table(RANGE + "a,air_arrival_s,1,,5\n")
    assert np.isnan(
        resolve_positions(observations, scene(a=[3.0, 4.0, 0.0])).position
    ).all()
    with pytest.raises(InputError, match=r"line 2, column range_m: got 5\.0.*10\.0"):
        resolve_positions(observations, scene(a=[6.0, 8.0, 0.0]))


SHOTS = RANGE.replace("\n", ",shot\n")


def test_several_shots_need_a_charge_named_for_each(table):
    rows = ["a,air_arrival_s,1,,20,one\n", "a,air_arrival_s,2,,20,two\n"]
    assert len(resolve_positions(table(SHOTS + rows[0]), Scene())) == 1
    observations = table(SHOTS + "".join(rows))
    message = r"line 3, column shot: expected 'one'.*got 'two'.*\[\[charge\]\]"
    with pytest.raises(InputError, match=message):
        resolve_positions(observations, Scene())
    two = Scene(charges=(Charge(name="one"), Charge(name="two", time_s=1.5)))
    assert len(resolve_positions(observations, two)) == 2
    other = Scene(charges=(Charge(name="one"), Charge(name="three")))
    with pytest.raises(InputError, match=r"line 3.*'one', 'three'; got 'two'"):
        resolve_positions(observations, other)


def test_each_charge_is_asked_about_its_own_origin_time(table):
    observations = table(
        SHOTS + "a,air_arrival_s,1,.1,20,one\na,air_arrival_s,2,.1,20,two\n"
    )
    late = Scene(charges=(Charge(name="one"), Charge(name="two", time_s=9.0)))
    with pytest.raises(InputError, match=r"line 3.*after the origin time, 9 s"):
        resolve_positions(observations, late)
    assert len(resolve_positions(observations, late, {"origin_time_s.two"})) == 2


def test_wind_needs_a_direction_but_only_for_what_it_changes(table):
    windy = Scene(air=Air(wind_north=4.0))
    with pytest.raises(
        InputError, match=r"line 2.*range alone, which has no direction"
    ):
        resolve_positions(table(RANGE + "a,air_arrival_s,1,,20\n"), windy)
    with pytest.raises(InputError, match="a free wind"):
        resolve_positions(
            table(RANGE + "a,air_arrival_s,1,,20\n"), Scene(), {"wind_east_m_s"}
        )
    assert (
        len(resolve_positions(table(RANGE + "a,peak_overpressure_pa,1,,20\n"), windy))
        == 1
    )


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
