"""When waves come to who stands and who moves: on one clock, by one law."""

from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Sensor
from jblast.sensors import Track
from jblast.vehicle import Trajectory
from jblast.waves.propagation import sound_speed_of
from jblast.world import arrivals_of, perceived, readings_of
from jblast.world.drawn import CAMERA
from jblast.world.perceived import out_of_view, waves_of
from tests.vehicle.flights import by_hand
from tests.world.worlds import VEHICLE, drawn

VELOCITY = np.array([30.0, -10.0, 5.0])
LIGHT_M_S = 299_792_458.0


@pytest.fixture(scope="module")
def world():
    return drawn()


@pytest.fixture(scope="module")
def met(world):
    """Arrivals at sensors of which one flies straight on, past all blasts."""
    start = np.array([5.2, 0.0, 3.1])
    times = jnp.array([0.0, 40.0])
    track = Track(times, jnp.stack([start, start + 40.0 * VELOCITY]))
    return arrivals_of(world.scene, {"mic": track}), track


def closed_form(charge, start, speed):
    """When sound of a charge meets a straight flight: |x + v t - q| = c (t - t0)."""
    away = start - np.array([float(x) for x in charge.position_m])
    origin = float(charge.time_s)
    away = away + origin * VELOCITY
    a = VELOCITY @ VELOCITY - speed**2
    b, c = 2.0 * away @ VELOCITY, away @ away
    return origin + (-b - np.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)


def test_sound_meets_a_sensor_that_flies_where_it_then_is(world, met):
    arrivals, track = met
    row = arrivals.entities.index("mic")
    speed = float(sound_speed_of(world.scene.air))
    times = arrivals.times_s["air_arrival_s"][row]
    start = np.asarray(track.position[0])
    expected = [closed_form(charge, start, speed) for charge in world.scene.charges]
    # rounding of times of some 10 s; a place taken at the detonation is ms off
    np.testing.assert_allclose(times, expected, rtol=0, atol=1e-11)
    where = np.asarray(track.at(jnp.asarray(times)))
    np.testing.assert_allclose(
        arrivals.places_m["air_arrival_s"][row], where, atol=1e-8
    )


def test_light_of_a_blast_is_seen_from_where_one_was_as_it_went_off(world, met):
    arrivals, _ = met
    row = arrivals.entities.index("light")
    for column, charge in enumerate(world.scene.charges):
        place = np.array([float(x) for x in charge.position_m])
        way = np.linalg.norm(place - [0.0, 900.0, 2.0])
        expected = float(charge.time_s) + way / LIGHT_M_S
        got = arrivals.times_s["flash_time_s"][row, column]
        # the law counts the speed of light in air
        assert got == pytest.approx(expected, abs=3e-9)


def test_each_sense_perceives_each_blast_once_and_in_order(world, met):
    seen, late = perceived(world.scene, met[0], 1e3)
    assert late == 0
    assert [one.time_s for one in seen] == sorted(one.time_s for one in seen)
    senses = {
        ("mic", "ground sound"),
        ("mic", "sound"),
        ("gauge", "pressure"),
        ("light", "flash"),
        ("vehicle", "force"),
    }
    assert {(one.entity, one.sense) for one in seen} == senses
    assert len(seen) == len(senses) * len(world.shots)


def test_what_comes_after_the_end_is_counted_and_not_perceived(world, met):
    middle = float(np.median(met[0].times_s["air_arrival_s"]))
    seen, late = perceived(world.scene, met[0], middle)
    assert late > 0
    assert len(seen) + late == 5 * len(world.shots)
    assert all(one.time_s < middle for one in seen)


def test_readings_are_the_arrivals_by_each_sensors_clock_and_place(world, met):
    arrivals, _ = met
    log, late = readings_of(world, arrivals, 1e3)
    assert log is not None
    assert late == 0
    assert len(log) == 4 * len(world.shots)
    ahead = {"gauge": 0.25}
    for row in range(len(log)):
        wave, who = log.quantity[row], arrivals.entities.index(log.sensor[row])
        column = world.shots.index(log.shot[row])
        time = arrivals.times_s[wave][who, column] + ahead.get(log.sensor[row], 0.0)
        # errors of 1 ns, whose tails (Student, 4) reach 13 of them once in 10,000
        assert log.value[row] == pytest.approx(time, abs=2e-8)
        place = arrivals.places_m[wave][who, column]
        np.testing.assert_allclose(log.position[row], place, atol=1e-9)


def test_light_tells_a_camera_the_direction_and_sound_an_array():
    lines = (("bearing_rad", 0.01), ("elevation_rad", 0.01))
    for first, wave in (
        ("fireball_radius_px", "flash_time_s"),
        ("flash_time_s", "flash_time_s"),
        ("air_arrival_s", "air_arrival_s"),
    ):
        sensor = Sensor("one", (0.0, 0.0, 0.0), records=((first, 0.01), *lines))
        assert set(waves_of(sensor).values()) == {wave}


def test_a_longer_world_leaves_the_readings_of_its_first_blasts_as_they_are():
    rate = {"rate_hz": 0.5, "time_s": [0, 6]}
    alone = {
        "name": "mic",
        "position_m": [60, 0, 2],
        "records": {"air_arrival_s": 1e-4},
    }
    only: dict[str, Any] = {"sensor": [alone]}
    short = drawn(world=rate, **only)
    long = drawn(world=rate | {"time_s": [0, 12]}, **only)
    assert 0 < len(short.shots) < len(long.shots)
    few, more = (readings_of(w, arrivals_of(w.scene), 1e3)[0] for w in (short, long))
    assert few is not None
    assert more is not None
    np.testing.assert_array_equal(few.value, more.value[: len(few)])
    assert few.shot == more.shot[: len(few)]


def test_who_flies_as_fast_as_sound_is_refused(world):
    track = Track(jnp.array([0.0, 1.0]), jnp.array([[0.0, 0, 1], [400.0, 0, 1]]))
    with pytest.raises(InputError, match=r"less than the .* of sound"):
        arrivals_of(world.scene, {"mic": track})


def test_without_a_flight_what_rides_stands_where_the_vehicle_holds(world):
    arrivals = arrivals_of(world.scene)
    row = arrivals.entities.index("mic")
    places = arrivals.places_m["air_arrival_s"][row]
    np.testing.assert_allclose(places, [VEHICLE["position_m"]] * len(world.shots))


@pytest.mark.parametrize("name", ["²", "007", "4294967296"])
def test_a_name_that_resembles_a_number_is_a_name(world, met, name):
    """Errors of a blast with a name depend on its place among the blasts."""
    arrivals, _ = met
    first, *others = world.scene.charges
    logs = []
    for one in (name, "first"):
        scene = replace(
            world.scene,
            charges=(replace(first, name=one), *others),
        )
        log, _ = readings_of(world._replace(scene=scene), arrivals, 1e3)
        assert log is not None
        logs.append(log.value[np.array(log.shot) == one])
    np.testing.assert_array_equal(*logs)


EYE = {"width": 24, "height": 16, "focal_px": 12.0}
ONE = {"count": 1, "time_s": 1.0, "mass_kg": 5.0}
EAST = ONE | {"region_m": {"box": [[44, -1, 0], [46, 1, 0]]}}


def looking(**camera):
    return drawn(world=EAST, camera=EYE | camera).scene


def turned(about_up_rad: float) -> Trajectory:
    """A vehicle that stands still, turned to the left of east."""
    half, held = 0.5 * about_up_rad, np.array([5.0, 0.0, 3.0])
    turn = [0.0, 0.0, np.sin(half), np.cos(half)]
    return by_hand([0.0, 5.0], [held, held], quaternion=[turn, turn])


@pytest.mark.parametrize(
    ("look_at_m", "seen"), [([45, 0, 2], True), ([-45, 0, 2], False)]
)
def test_a_camera_that_stands_sees_what_it_looks_at(look_at_m, seen):
    scene = looking(position_m=[0, 0, 2], look_at_m=look_at_m)
    assert (out_of_view(scene) == ()) == seen


def test_a_camera_that_rides_along_looks_where_the_vehicle_is_turned():
    scene = looking(mount="vehicle")
    assert out_of_view(scene) == out_of_view(scene, turned(0.0)) == ()
    assert out_of_view(scene, turned(3.0)) == ("1",)


def test_what_is_out_of_view_is_not_perceived_by_the_camera_alone():
    scene = looking(mount="vehicle")
    arrivals = arrivals_of(scene)
    everything, late = perceived(scene, arrivals, 1e3)
    seen, as_late = perceived(scene, arrivals, 1e3, ("1",))
    missing = set(everything) - set(seen)
    assert {(one.entity, one.sense) for one in missing} == {(CAMERA, "flash")}
    assert late == as_late == 0
