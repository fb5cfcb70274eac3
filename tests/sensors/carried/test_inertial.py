"""A vehicle's inertial unit: what it feels, and what it adds to that."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import FLIGHT_GRAVITY
from jblast.scene import Imu
from jblast.sensors.flight_sensors import (
    Biases,
    drawn_biases,
    felt_between,
    sampled,
    walked,
)
from jblast.vehicle import State

PERIOD = jnp.asarray(0.004)
NONE = Biases(jnp.zeros(3), jnp.zeros(3))
TURN_90 = jnp.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])


def state(velocity=(0.0, 0.0, 0.0), quaternion=(0.0, 0.0, 0.0, 1.0)) -> State:
    return State(
        jnp.zeros(3),
        jnp.array(velocity),
        jnp.array(quaternion),
        jnp.zeros(3),
        jnp.zeros(4),
    )


def test_at_rest_it_feels_the_ground_push_up():
    force, rate = felt_between(state(), state(), PERIOD)
    np.testing.assert_allclose(force, [0, 0, FLIGHT_GRAVITY], atol=1e-15)
    np.testing.assert_array_equal(rate, 0)


def test_a_push_within_a_sample_is_felt_whole_along_the_bodys_axes():
    # body x looks north after a quarter turn, body y west
    before, now = state(quaternion=TURN_90), state((0.4, 0.0, 0.0), TURN_90)
    force, _ = felt_between(before, now, PERIOD)
    np.testing.assert_allclose(force, [0, -100.0, FLIGHT_GRAVITY], atol=1e-12)


def test_its_rate_turns_one_attitude_into_the_next():
    angle = 0.01
    turned = (0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2))
    _, rate = felt_between(state(), state(quaternion=turned), PERIOD)
    np.testing.assert_allclose(rate, [0, 0, angle / 0.004], rtol=1e-12, atol=1e-12)


def test_white_noise_has_its_density_by_allans_deviation():
    imu = Imu(rate=250.0, bits=None)
    noise = jax.random.normal(jax.random.key(3), (50_000, 6))
    at_rest = (jnp.zeros(3), jnp.zeros(3))
    force, rate = jax.vmap(lambda six: sampled(six, imu, NONE, at_rest))(noise)
    for values, density in (
        (force, imu.accelerometer_noise),
        (rate, imu.gyroscope_noise),
    ):
        # at tau = 1 s, of a one-sided density N: N / sqrt(2 tau)
        means = np.asarray(values).reshape(-1, 250, 3).mean(axis=1)
        allan = np.sqrt(np.mean(np.diff(means, axis=0) ** 2) / 2)
        # 199 differences of three axes: 4 % is one standard error
        assert allan == pytest.approx(float(density) / np.sqrt(2), rel=0.16)


def test_what_it_is_off_by_is_drawn_and_walks_as_said():
    imu = Imu(rate=250.0)
    keys = jax.random.split(jax.random.key(5), 4000)
    drawn = jax.vmap(lambda key: drawn_biases(key, imu, 0.1))(keys)
    assert np.std(drawn.rate) == pytest.approx(
        0.1 * float(imu.gyroscope_bias), rel=0.03
    )
    noise = jax.random.normal(jax.random.key(6), (4000, 6))
    gone = jax.vmap(lambda six: walked(six, imu, NONE, jnp.asarray(4.0)))(noise)
    # in four seconds twice as far as in one
    assert np.std(gone.force) == pytest.approx(
        2 * float(imu.accelerometer_walk), rel=0.03
    )


def test_beyond_its_range_it_says_its_range():
    imu = Imu(rate=250.0)
    hit = (jnp.array([1e4, -1e4, 0.0]), jnp.zeros(3))
    force, _ = sampled(jnp.zeros(6), imu, NONE, hit)
    most = float(imu.accelerometer_range)
    np.testing.assert_allclose(force[:2], [most, -most])
