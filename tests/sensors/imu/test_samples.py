"""True samples sum to the motion of a flight; errors have their declared sizes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jblast.constants import FLIGHT_GRAVITY
from jblast.scene import Imu
from jblast.sensors.imu import (
    Inertial,
    clipped,
    inertial_of,
    power_on_bias,
    rotation_between,
    rotation_quaternion,
    sampled,
    with_errors,
)
from tests.vehicle.flights import by_hand

LEVEL = jnp.array([0.0, 0.0, 0.0, 1.0])
TIMES = np.linspace(0.0, 0.4, 401)
EDGES = jnp.linspace(0.0, 0.4, 101)
STEP_S = 0.004


def samples_of(velocity, rotations: Rotation, rate, offset=(0.0, 0, 0), mount=LEVEL):
    zero = np.zeros((len(TIMES), 3))
    flight = by_hand(
        TIMES,
        zero,
        velocity_m_s=zero + velocity,
        quaternion=rotations.as_quat(),
        body_rate_rad_s=zero + rate,
    )
    return inertial_of(flight, EDGES, jnp.asarray(offset), jnp.asarray(mount))


def test_samples_integrate_to_the_change_of_velocity_and_attitude():
    # turning at 3 rad/s about a tilted axis while its velocity changes
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    turned = Rotation.from_rotvec(np.outer(3.0 * TIMES, axis))
    speed = np.stack([np.sin(20 * TIMES), 2 * TIMES**2, np.exp(TIMES)], axis=1)
    mount = Rotation.from_quat([0.1, -0.3, 0.2, 0.9])
    got = samples_of(speed, turned, 3.0 * axis, mount=mount.as_quat())
    # strapdown navigation: attitude from the rates, then the forces
    attitude, velocity = Rotation.identity(), speed[0].copy()
    for force, rate in zip(np.array(got.force), np.array(got.rate), strict=True):
        body_rate = mount.apply(rate)
        middle = attitude * Rotation.from_rotvec(body_rate * STEP_S / 2)
        velocity += STEP_S * middle.apply(mount.apply(force))
        velocity[2] -= STEP_S * FLIGHT_GRAVITY
        attitude *= Rotation.from_rotvec(body_rate * STEP_S)
    # rounding alone: samples are means
    np.testing.assert_allclose(velocity, speed[-1], atol=1e-9)
    assert (attitude.inv() * turned[-1]).magnitude() < 1e-9


def test_a_lever_arm_adds_the_centripetal_acceleration():
    turned = Rotation.from_rotvec(np.outer(3.0 * TIMES, [0.0, 0.0, 1.0]))
    got = samples_of(0.0, turned, [0.0, 0.0, 3.0], offset=(0.2, 0.0, 0.0))
    # w^2 r towards the centre; a chord over 4 ms is 6e-6 shorter than its arc
    expected = [[-9.0 * 0.2, 0.0, FLIGHT_GRAVITY]] * 100
    np.testing.assert_allclose(got.force, expected, atol=1e-4)


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


ZERO = Inertial(jnp.zeros((4000, 3)), jnp.zeros((4000, 3)))
NAMES = [
    f"{of}_{error}"
    for of in ("accelerometer", "gyroscope")
    for error in ("noise", "bias", "walk")
]


def imu_with(rate=100.0, bits=None, **errors) -> Imu:
    return Imu(rate=rate, bits=bits, **(dict.fromkeys(NAMES, 0.0) | errors))


def test_white_noise_has_its_density_by_the_allan_deviation():
    imu = imu_with(250.0, accelerometer_noise=0.02, gyroscope_noise=0.003)
    long = Inertial(*(jnp.zeros((50_000, 3)) for _ in ZERO))
    got = with_errors(jax.random.key(3), imu, long)
    for values, density in zip(got, (0.02, 0.003), strict=True):
        # at tau = 1 s, of a one-sided density N: N / sqrt(2 tau)
        means = np.asarray(values).reshape(-1, 250, 3).mean(axis=1)
        allan = np.sqrt(np.mean(np.diff(means, axis=0) ** 2) / 2)
        # 199 differences of three axes: 4 % is one standard error
        assert allan == pytest.approx(density / np.sqrt(2), rel=0.16)


@pytest.mark.slow
def test_a_bias_is_constant_and_walks_with_the_root_of_time():
    imu = imu_with(accelerometer_walk=0.5)
    keys = jax.random.split(jax.random.key(0), 60)
    ends = jax.vmap(lambda key: with_errors(key, imu, ZERO).force[-1])(keys)
    # 40 s; 180 numbers estimate an sd to 5 %: four of that
    assert float(jnp.std(ends)) == pytest.approx(0.5 * np.sqrt(40.0), rel=0.21)
    got = with_errors(jax.random.key(0), imu_with(accelerometer_bias=0.3), ZERO)
    assert jnp.ptp(got.force, axis=0).max() == 0.0
    assert jnp.abs(got.force).min() > 0.0
    assert jnp.abs(got.rate).max() == 0.0
    biased = imu_with(gyroscope_bias=0.2)
    many = jax.vmap(lambda key: power_on_bias(key, biased, 0.1).rate)
    drawn = many(jax.random.split(jax.random.key(5), 4000))
    assert np.std(drawn) == pytest.approx(0.1 * 0.2, rel=0.03)


@pytest.mark.parametrize("noise", [None, jnp.zeros((4000, 6))])
def test_a_record_and_a_loop_have_range_and_bits_alike(noise):
    imu = imu_with(accelerometer_range=16.0, bits=8)
    no_bias = Inertial(jnp.zeros((1, 3)), jnp.zeros((1, 3)))

    def read(true: Inertial) -> Inertial:
        if noise is None:
            return with_errors(jax.random.key(0), imu, true)
        return sampled(noise, imu, no_bias, true)

    got = read(Inertial(ZERO.force + 40.0, ZERO.rate))
    assert jnp.unique(got.force).tolist() == [16.0 - 16.0 / 128]
    assert clipped(got, imu).tolist() == [[True, False]] * 4000
    assert jnp.unique(read(Inertial(ZERO.force - 40.0, ZERO.rate)).force) == -16.0
    # a seventh and two thirds of a step
    some = Inertial(ZERO.force + 16.0 / 128 / 7, ZERO.rate + imu.gyroscope_range / 192)
    steps = read(some)
    np.testing.assert_array_equal(steps.force, 0.0)
    np.testing.assert_allclose(steps.rate, imu.gyroscope_range / 128, rtol=1e-12)
