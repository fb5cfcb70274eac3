"""What an IMU feels and adds: the sums of its samples are what the flight did."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jblast.constants import FLIGHT_GRAVITY
from jblast.scene import Imu
from jblast.sensors.imu import Felt, felt, read, rotation_between, rotation_quaternion
from jblast.vehicle import Trajectory

LEVEL = jnp.array([0.0, 0.0, 0.0, 1.0])
TIMES = np.linspace(0.0, 0.4, 401)
EDGES = jnp.linspace(0.0, 0.4, 101)


def flight(velocity, rotations: Rotation, rate) -> Trajectory:
    rows = len(TIMES)
    velocity, rate = (np.broadcast_to(x, (rows, 3)) for x in (velocity, rate))
    nothing = jnp.zeros((rows, 3))
    return Trajectory(
        jnp.asarray(TIMES),
        nothing,
        jnp.asarray(velocity),
        jnp.asarray(rotations.as_quat()),
        jnp.asarray(rate),
        jnp.zeros((rows, 4)),
        nothing,
        nothing,
        jnp.asarray(False),
    )


def level() -> Rotation:
    return Rotation.from_quat(np.tile(LEVEL, (len(TIMES), 1)))


def test_one_that_falls_freely_feels_nothing():
    falls = np.outer(TIMES, [0.0, 0.0, -FLIGHT_GRAVITY]) + np.array([3.0, 0, 1])
    got = felt(flight(falls, level(), 0.0), EDGES, jnp.zeros(3), LEVEL)
    np.testing.assert_allclose(got.force, 0.0, atol=1e-11)
    np.testing.assert_allclose(got.rate, 0.0, atol=1e-12)


def test_one_that_hovers_feels_its_thrust_alone():
    got = felt(flight(0.0, level(), 0.0), EDGES, jnp.zeros(3), LEVEL)
    np.testing.assert_allclose(got.force, [[0, 0, FLIGHT_GRAVITY]] * 100, atol=1e-12)


def test_samples_of_a_vehicle_that_turns_sum_to_its_change_of_velocity():
    # turning at 3 rad/s about a tilted axis while it is thrown about
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    turned = Rotation.from_rotvec(np.outer(3.0 * TIMES, axis))
    speed = np.stack([np.sin(20 * TIMES), 2 * TIMES**2, np.exp(TIMES)], axis=1)
    turn = Rotation.from_quat([0.1, -0.3, 0.2, 0.9])
    got = felt(
        flight(speed, turned, 3.0 * axis),
        EDGES,
        jnp.zeros(3),
        jnp.asarray(turn.as_quat()),
    )
    # what a strapdown navigator does: attitude from the rates, then the forces
    step, attitude = 0.004, Rotation.identity()
    velocity = speed[0].copy()
    for force, rate in zip(np.array(got.force), np.array(got.rate), strict=True):
        body_rate = turn.apply(rate)
        middle = attitude * Rotation.from_rotvec(body_rate * step / 2)
        velocity += step * middle.apply(turn.apply(force))
        velocity[2] -= step * FLIGHT_GRAVITY
        attitude *= Rotation.from_rotvec(body_rate * step)
    # rounding alone: the samples are means, whatever they are sampled at
    np.testing.assert_allclose(velocity, speed[-1], atol=1e-9)
    assert (attitude.inv() * turned[-1]).magnitude() < 1e-9


def test_an_instrument_aside_feels_the_pull_to_the_middle():
    turned = Rotation.from_rotvec(np.outer(3.0 * TIMES, [0.0, 0.0, 1.0]))
    turns = flight(0.0, turned, [0.0, 0.0, 3.0])
    got = felt(turns, EDGES, jnp.array([0.2, 0.0, 0.0]), LEVEL)
    # w^2 r towards the middle; a chord over 4 ms is 6e-6 shorter than its arc
    wanted = [[-9.0 * 0.2, 0.0, FLIGHT_GRAVITY]] * 100
    np.testing.assert_allclose(got.force, wanted, atol=1e-4)
    np.testing.assert_allclose(got.rate, [[0, 0, 3.0]] * 100, atol=1e-9)


@pytest.mark.parametrize("size", [0.0, 1e-12, 0.3, 3.1])
def test_rotation_vectors_are_those_of_scipy(size):
    vector = size * np.array([2.0, -1.0, 2.0]) / 3.0
    start = Rotation.from_quat([0.5, 0.1, -0.4, 0.7])
    end = start * Rotation.from_rotvec(vector)
    ours = rotation_quaternion(jnp.asarray(vector))
    np.testing.assert_allclose(
        Rotation.from_quat(ours).as_rotvec(), vector, rtol=1e-9, atol=1e-15
    )
    got = rotation_between(jnp.asarray(start.as_quat()), -jnp.asarray(end.as_quat()))
    np.testing.assert_allclose(got, vector, rtol=1e-7, atol=1e-15)


NOTHING = Felt(jnp.zeros((4000, 3)), jnp.zeros((4000, 3)))
STILL = {
    "accelerometer_bias": 0.0,
    "gyroscope_bias": 0.0,
    "accelerometer_walk": 0.0,
    "gyroscope_walk": 0.0,
}


def test_white_noise_has_half_the_rate_of_its_density():
    imu = Imu(rate=800.0, bits=None, **STILL)
    got = read(jax.random.key(1), imu, NOTHING)
    for column, density in (
        (got.force, imu.accelerometer_noise),
        (got.rate, imu.gyroscope_noise),
    ):
        # 12,000 numbers tell an sd to 0.65 %: four of that
        wanted = float(density) * np.sqrt(400.0)
        assert float(jnp.std(column)) == pytest.approx(wanted, rel=0.026)


def test_bias_stays_and_walks_by_the_root_of_time():
    quiet = {"accelerometer_noise": 0.0, "gyroscope_noise": 0.0}
    walks = STILL | {"accelerometer_walk": 0.5}
    imu = Imu(rate=100.0, bits=None, **(quiet | walks))
    ends = [read(jax.random.key(n), imu, NOTHING).force[-1] for n in range(60)]
    # 40 s; 180 numbers tell an sd to 5 %: four of that
    wanted = 0.5 * np.sqrt(40.0)
    assert float(jnp.std(jnp.stack(ends))) == pytest.approx(wanted, rel=0.21)
    off = STILL | {"accelerometer_bias": 0.3}
    got = read(jax.random.key(0), Imu(bits=None, **(quiet | off)), NOTHING)
    assert jnp.ptp(got.force, axis=0).max() == 0.0
    assert jnp.abs(got.force).min() > 0.0
    assert jnp.abs(got.rate).max() == 0.0


def test_a_range_clips_and_bits_are_steps_of_it():
    imu = Imu(accelerometer_range=16.0, bits=8)
    pushed = Felt(NOTHING.force + 40.0, NOTHING.rate)
    got = read(jax.random.key(0), imu, pushed)
    assert jnp.unique(got.force).tolist() == [16.0 - 16.0 / 128]
    steps = read(jax.random.key(0), imu, NOTHING).force / (16.0 / 128)
    np.testing.assert_allclose(steps, jnp.round(steps), atol=1e-12)
