"""Flights in lockstep: ends, degrees, axes and motors."""

import dataclasses
import threading
import time
from functools import partial
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jblast.autopilot.lockstep import (
    PERIOD_S,
    PLACE,
    Lockstep,
    Rotors,
    compiled,
    fly_lockstep,
    messages_of,
    rotors_of,
    state_message,
    turns_of,
)
from jblast.autopilot.mavlink import Link, LinkLost, euler, message, scalar_first
from jblast.errors import InputError
from jblast.observations.places import Frame
from jblast.scene import Charge, Place, Scene, VehicleSpec
from jblast.vehicle import State, hold_of, named, simulate, vehicle_of
from tests.tools.mock_autopilot import RoundedHold, fly_mock, received, state_heard

ROTORS = Rotors(np.arange(4), 100.0)


class Counted:
    """Turns of a vehicle whose height counts them, with the speeds it received."""

    def __init__(self):
        self.speeds: list[float] = []

    def turn(self, carried: Any, goes: bool, speeds: Any) -> Any:
        if goes:
            self.speeds.append(speeds[0])
        up = np.array([0.0, 0.0, len(self.speeds)])
        return SimpleNamespace(state=SimpleNamespace(position_m=up)), None


class Scripted(Link):
    """A link whose other end answers by a script; "gone" hangs up, None is silent."""

    def __init__(self, script):
        self.script, self.sent, self.waiting = list(script), 0, []

    def send(self, *sent):
        stamp = sent[-1].time_usec
        self.sent += 1
        answer = self.script.pop(0) if self.script else None
        if answer == "gone":
            raise LinkLost("the connection was closed")
        for one in answer if isinstance(answer, list) else [answer]:
            if one is not None:
                values = {"time_usec": stamp, "mode": 129, "flags": 1} | one
                self.waiting.append(message("HIL_ACTUATOR_CONTROLS", **values))

    def receive(self, timeout_s):
        return self.waiting.pop(0) if self.waiting else None


def flown(script, **options) -> tuple[Lockstep, Counted]:
    counted = Counted()
    flight = fly_lockstep(
        counted.turn,
        None,  # type: ignore[arg-type]
        Scripted(script),
        ROTORS,
        lambda sample, state, stamp: [message("HIL_SENSOR", time_usec=stamp)],
        flight=Lockstep(),
        patience_s=0.05,
        **options,
    )
    return flight, counted


def test_each_turn_is_answered_and_flown():
    flight, counted = flown([{}] * 5, seconds=5 * PERIOD_S)
    assert (flight.turns, flight.flown, flight.late) == (5, 5, 0)
    assert flight.ended == "the time is over"
    assert flight.position_m[2] == len(counted.speeds) == 5


def test_before_it_is_armed_the_vehicle_stands():
    flight, counted = flown([None, None, {"mode": 1}, {}, {}, "gone"])
    assert (flight.turns, flight.flown, len(counted.speeds)) == (5, 2, 2)


def test_disarmed_in_flight_its_rotors_stand():
    half = {"controls": [0.5] * 16}
    _, counted = flown([half, half | {"mode": 1}, "gone"])
    assert counted.speeds == [50.0, 0.0]


def test_an_answer_to_an_earlier_turn_is_passed_over_and_counted():
    flight, _ = flown([{}, [{"time_usec": 4000}, {}], "gone"])
    assert (flight.late, flight.flown) == (1, 2)


ENDS = {
    "hung up": (["gone"], "the connection was closed"),
    "silent": ([None], "no answer came within 0.05 s"),
    "early": ([{"time_usec": 10**9}], "controls for 1000000000 us: messages out of"),
    "not in lockstep": ([{"flags": 0}], "an autopilot in lockstep, bit 0"),
}


@pytest.mark.parametrize("name", ENDS)
def test_what_ends_a_flight_is_said(name):
    script, words = ENDS[name]
    flight, _ = flown([{}, {}, *script], seconds=1.0)
    assert words in flight.ended
    assert flight.position_m[2] == flight.flown == 2


def in_lockstep(scene: Scene, spec: VehicleSpec, count: int):
    """Fly a scene with the mock over loopback; and the same hold without a network."""
    where = Place(47.0, 8.0, 300.0)
    turns, vehicle = turns_of(scene, spec, where, 3), vehicle_of(spec)
    rotors, hold = rotors_of(vehicle), hold_of(spec, integral=True)
    turn, carried = compiled(turns)
    frame, path = Frame(*where), []

    def recorded(*given):
        carried, sample = turn(*given)
        path.append(np.asarray(carried.state.position_m))
        return carried, sample

    link = Link("tcp", "127.0.0.1:0", "mavlink", (1, 51))
    rounded = RoundedHold(hold, frame, rotors.of_motor)
    other = threading.Thread(
        target=fly_mock, args=(link.address, rounded, vehicle, count)
    )
    other.start()
    while not link.connected:
        time.sleep(0.01)
    flight = fly_lockstep(
        recorded,
        carried,
        link,
        rotors,
        partial(messages_of, turns.suite, frame),
        flight=Lockstep(),
        seconds=count * PERIOD_S,
    )
    link.close()
    other.join()
    alone = simulate(
        vehicle,
        turns.initial,
        duration_s=count * PERIOD_S,
        step_s=PERIOD_S,
        control=RoundedHold(hold, frame, rotors.of_motor),
        wind=turns.simulator.wind,
        loads=turns.simulator.loads,
        ground_up_m=0.0,
        backend="jax",
    )
    return flight, link, np.array(path[-count - 1 :]), np.asarray(alone.position_m)


@pytest.mark.slow
def test_through_a_blast_the_path_is_that_of_the_same_hold_without_a_network():
    spec = VehicleSpec("iris", position=jnp.array([8.0, 0.0, 10.0]))
    scene = Scene(Charge(10.0, time_s=0.2), vehicle=spec)
    flight, link, path, alone = in_lockstep(scene, spec, 500)
    assert (flight.flown, flight.late, link.lost) == (500, 0, 0)
    assert np.linalg.norm(path - path[0], axis=1).max() > 0.03
    np.testing.assert_allclose(path, alone, rtol=0, atol=1e-6)


def test_a_vehicle_below_ground_is_refused():
    spec = VehicleSpec("iris", position=jnp.array([0.0, 0.0, -1.0]))
    with pytest.raises(InputError, match="expected a vehicle that is not below ground"):
        turns_of(Scene(Charge(1.0), vehicle=spec), spec, Place(0.0, 0.0), 0)


@pytest.mark.slow
def test_at_rest_on_the_ground_its_instruments_say_so():
    spec = VehicleSpec("iris", position=jnp.zeros(3))
    turns = turns_of(Scene(Charge(1.0), vehicle=spec), spec, PLACE, 0)
    turn, carried = compiled(turns)
    carried, sample = turn(carried, False, np.zeros(4))
    sent = messages_of(turns.suite, Frame(*PLACE), sample, carried.state, 4000)
    *_, state, sensor = sent
    # one sample, calibrated: 0.1 m/s2 is four standard deviations
    assert sensor.zacc == pytest.approx(-9.81, abs=0.12)
    assert sensor.abs_pressure == pytest.approx(1013.25, abs=0.06)
    assert sensor.pressure_alt == pytest.approx(0.0, abs=0.5)
    assert sensor.fields_updated == 0b1101111111111
    assert (state.lat, state.lon, state.alt) == (473977420, 85455940, 0)


TO_NED = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
TO_FRD = np.diag([1.0, -1, -1])
ATTITUDES = Rotation.from_quat(np.random.default_rng(4).normal(size=(8, 4))).as_quat()


def test_attitudes_are_turned_as_matrices_say():
    for attitude in ATTITUDES:
        told = scalar_first(attitude)
        expected = TO_NED @ Rotation.from_quat(attitude).as_matrix() @ TO_FRD
        found = Rotation.from_quat(np.roll(told, -1)).as_matrix()
        np.testing.assert_allclose(found, expected, atol=1e-14)
        yaw, pitch, roll = Rotation.from_matrix(expected).as_euler("ZYX")
        np.testing.assert_allclose(euler(told), [roll, pitch, yaw], atol=1e-12)


def test_a_state_comes_back_from_its_message():
    place, attitude = np.array([1500.0, -2200.0, 35.0]), ATTITUDES[0]
    vectors = place, np.array([1.0, 2.0, -3.0]), attitude, np.array([0.1, 0.2, 0.3])
    state = State(*map(jnp.asarray, (*vectors, np.zeros(4))))
    frame = Frame(47.4, 8.5, 400.0)
    sent = received(state_message(frame, state, 0))
    heard = state_heard(frame, sent)
    # 1e-7 degrees are 11 mm
    np.testing.assert_allclose(heard.position_m, place, atol=6e-3)
    np.testing.assert_allclose(heard.velocity_m_s, vectors[1], atol=1e-12)
    np.testing.assert_allclose(heard.body_rate_rad_s, vectors[3], atol=1e-7)
    turned = Rotation.from_quat(np.asarray(heard.quaternion)).inv()
    assert (turned * Rotation.from_quat(attitude)).magnitude() < 1e-6
    # a body that moves east and falls, seen by the autopilot: north, east, down
    assert (sent.vx, sent.vy, sent.vz) == (200, 100, 300)


@pytest.mark.parametrize("model", ["crazyflie", "hummingbird", "iris"])
def test_motors_are_px4s_by_place_and_by_turn(model):
    vehicle = named(model)
    rotors = rotors_of(vehicle)
    places = np.asarray(vehicle.rotor_position_m)[rotors.of_motor]
    ahead, left = np.sign(places[:, 0]), np.sign(places[:, 1])
    np.testing.assert_array_equal(ahead, [1, -1, 1, -1])
    np.testing.assert_array_equal(left, [-1, 1, 1, -1])
    # 1 and 2 turn counter-clockwise, which turns the body clockwise
    turns = np.asarray(vehicle.rotor_direction)[rotors.of_motor]
    np.testing.assert_array_equal(turns, [-1, -1, 1, 1])


def test_controls_are_shares_of_the_greatest_speed_and_nan_is_rest():
    rotors = rotors_of(named("iris"))
    speeds = rotors.speeds(np.array([0.5, np.nan, 2.0, -1.0]))
    np.testing.assert_allclose(speeds[rotors.of_motor], [550.0, 0.0, 1100.0, 0.0])


def test_rotors_that_stand_otherwise_are_refused():
    vehicle = named("iris")
    plus = jnp.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    with pytest.raises(InputError, match="expected rotors at the corners of an X"):
        rotors_of(dataclasses.replace(vehicle, rotor_position_m=plus))
