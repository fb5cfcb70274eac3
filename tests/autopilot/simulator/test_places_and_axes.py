"""Where and how an autopilot is told the vehicle is: degrees, axes, motors."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jblast.autopilot.lockstep import rotors_of, state_message
from jblast.autopilot.mavlink import euler, scalar_first
from jblast.errors import InputError
from jblast.observations.places import Frame
from jblast.vehicle import State, named
from tests.tools.mock_autopilot import received, state_heard

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
