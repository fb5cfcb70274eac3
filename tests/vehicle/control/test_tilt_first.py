"""The attitude error that rights a vehicle first, beside quaternions multiplied out."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jblast.vehicle.control.cascade import YAW_WEIGHT, attitude_error

FLAT = 1e-7


@jax.jit
def found(quaternion, pull, yaw):
    return jnp.stack(attitude_error(tuple(quaternion), tuple(pull), yaw))


def by_quaternions(attitude: Rotation, pull: np.ndarray, yaw: float) -> np.ndarray:
    """As the source writes it: shortest turn of z, then a share of what is left."""
    b_3 = pull / np.linalg.norm(pull)
    b_2 = np.cross(b_3, [np.cos(yaw), np.sin(yaw), 0.0])
    b_2 /= np.linalg.norm(b_2)
    wanted = Rotation.from_matrix(np.stack([np.cross(b_2, b_3), b_2, b_3], axis=1))
    z = attitude.apply([0.0, 0.0, 1.0])
    axis = np.cross(z, b_3)
    angle = np.arctan2(np.linalg.norm(axis), z @ b_3)
    tilt = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)) * attitude
    x, y, z, w = (tilt.inv() * wanted).as_quat()
    assert abs(x) + abs(y) < 1e-9  # a turn about z alone is left
    left = 2 * np.arctan2(z, w)
    left = (left + np.pi) % (2 * np.pi) - np.pi
    goal = tilt * Rotation.from_rotvec([0.0, 0.0, YAW_WEIGHT * left])
    error = (attitude.inv() * goal).as_quat()
    error *= np.sign(error[3])
    return 2 * error[:3] / [1.0, 1.0, YAW_WEIGHT]


def test_it_is_that_of_quaternions_multiplied_out():
    rng = np.random.default_rng(1)
    for _ in range(50):
        attitude = Rotation.from_quat(rng.normal(size=4))
        pull = rng.normal((0.0, 0.0, 2.0))
        yaw = rng.uniform(-np.pi, np.pi)
        got = found(jnp.asarray(attitude.as_quat()), jnp.asarray(pull), yaw)
        expected = by_quaternions(attitude, pull, yaw)
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize("about", range(3))
def test_a_small_error_is_the_turn_itself(about):
    turn = np.zeros(3)
    turn[about] = -1e-4
    level = Rotation.from_rotvec(turn).as_quat()
    got = found(jnp.asarray(level), jnp.array([0.0, 0.0, 9.81]), jnp.asarray(0.0))
    np.testing.assert_allclose(got, -turn, rtol=0, atol=FLAT)


def test_upside_down_it_is_finite_with_slopes_and_turns_over():
    upside_down = jnp.array([1.0, 0.0, 0.0, 0.0])
    pull = jnp.array([0.0, 0.0, 9.81])
    got = found(upside_down, pull, jnp.asarray(0.0))
    assert np.hypot(got[0], got[1]) == pytest.approx(2.0)
    slopes = jax.jacobian(found)(upside_down, pull, jnp.asarray(0.0))
    assert np.isfinite(slopes).all()
