"""Where and how an autopilot is told the vehicle is: degrees, axes, motors."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jblast.autopilot import lockstep
from jblast.autopilot.flight_record import euler, scalar_first
from jblast.autopilot.lockstep import geodetic_of, origin_at, rotors_of
from jblast.errors import InputError
from jblast.missions.mission import geodetic
from jblast.observations.places import Frame
from jblast.scene import Place
from jblast.vehicle import named
from tests.tools.mock_autopilot import attitude_in, level_of

TO_NED = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
TO_FRD = np.diag([1.0, -1, -1])
ATTITUDES = Rotation.from_quat(np.random.default_rng(4).normal(size=(8, 4))).as_quat()


@pytest.mark.parametrize("place", [(1500.0, -2200.0, 35.0), (0.0, 0.0, -3.0)])
def test_degrees_are_those_of_missions_and_come_back(place):
    where = Place(47.4, 8.5, 400.0)
    origin = origin_at(where)
    found = geodetic_of(origin, jnp.array(place))
    # 1e-11 degrees are a thousandth of a millimetre
    expected = geodetic(Frame(*where), np.array(place))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found[:2], expected[:2], rtol=0, atol=1e-11)
    np.testing.assert_allclose(level_of(origin, found), place, atol=1e-6)


@pytest.mark.parametrize("attitude", ATTITUDES)
def test_attitudes_are_turned_as_matrices_say_and_come_back(attitude):
    told = np.asarray(lockstep.attitude_out(jnp.asarray(attitude)))
    expected = TO_NED @ Rotation.from_quat(attitude).as_matrix() @ TO_FRD
    found = Rotation.from_quat(np.roll(told, -1)).as_matrix()
    np.testing.assert_allclose(found, expected, atol=1e-14)
    back = Rotation.from_quat(np.asarray(attitude_in(jnp.asarray(told))))
    np.testing.assert_allclose(
        back.as_matrix(), Rotation.from_quat(attitude).as_matrix(), atol=1e-14
    )
    np.testing.assert_allclose(scalar_first(attitude), told, atol=1e-14)
    yaw, pitch, roll = Rotation.from_matrix(expected).as_euler("ZYX")
    np.testing.assert_allclose(euler(told), [roll, pitch, yaw], atol=1e-12)


def test_east_north_up_becomes_north_east_down_and_left_right():
    np.testing.assert_array_equal(lockstep.world(jnp.array([1.0, 2, 3])), [2, 1, -3])
    np.testing.assert_array_equal(lockstep.body(jnp.array([1.0, 2, 3])), [1, -2, -3])


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
