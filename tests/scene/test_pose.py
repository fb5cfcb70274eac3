import tomllib

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from jax.test_util import check_grads
from scipy.spatial.transform import Rotation

from jblast.scene import Camera, look_at, matrix_quaternion, quaternion_matrix
from jblast.scene.reader import scene_from_document
from jblast.sensors.camera.geometry import to_camera
from jblast.vehicle.state import four, rotation, three, times

turned_to = jax.jit(lambda p, t: quaternion_matrix(look_at(p, t)))
COORDINATE = st.floats(-100.0, 100.0).map(lambda x: x if abs(x) > 1e-100 else 0.0)
"""Squares of smaller ones vanish, and with them the way from one place to another."""
PLACE = st.tuples(COORDINATE, COORDINATE, COORDINATE).map(np.array)
# Half turns about each axis and between them are where a root of the trace fails.
HALF_TURNS = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0.6, -0.8, 0, 0], [0, 0, 0, 1]]
NORMAL = np.random.default_rng(1).normal(size=(20, 4))
RANDOM = (NORMAL / np.linalg.norm(NORMAL, axis=-1, keepdims=True)).tolist()


@pytest.mark.parametrize("quaternion", HALF_TURNS + RANDOM)
def test_matrix_is_that_of_scipy_and_gives_the_quaternion_back(quaternion):
    expected = Rotation.from_quat(quaternion).as_matrix()
    matrix = quaternion_matrix(3.0 * np.array(quaternion))  # its length is ignored
    np.testing.assert_allclose(matrix, expected, atol=1e-15)
    back = matrix_quaternion(matrix)
    assert back[3] >= 0
    # q and -q are one rotation; products of unit quaternions tell the angle between.
    assert abs(back @ jnp.array(quaternion, float)) == pytest.approx(1, abs=1e-15)


@pytest.mark.parametrize("quaternion", HALF_TURNS + RANDOM[:3])
def test_gradients_of_a_rotation_are_those_of_finite_differences(quaternion):
    quaternion = jnp.array(quaternion, float)
    check_grads(jax.jit(quaternion_matrix), (quaternion,), order=1)
    # away from w = 0, where the sign changes, and from two largest numbers: differences
    # leave the rotations, where the rows of the outer product agree
    turned = quaternion_matrix(quaternion + jnp.array([0.1, 0.2, 0.15, 0.05]))
    check_grads(jax.jit(matrix_quaternion), (turned,), order=1)


@settings(deadline=None)
@given(PLACE, PLACE)
def test_a_camera_that_looks_at_a_place_is_level_and_has_it_ahead(position, target):
    offset = target - position
    if not (abs(offset) >= np.finfo(float).tiny).any():  # XLA takes less for zero
        assert jnp.isnan(look_at(position, target)).all()
        return
    matrix = turned_to(position, target)
    right, down, forward = np.asarray(matrix).T
    # rounding of the quaternion
    assert abs(right[2]) < 1e-14
    assert down[2] < 1e-14
    largest = abs(offset).max()
    forward_there = (offset / largest) / np.linalg.norm(offset / largest)
    np.testing.assert_allclose(forward, forward_there, atol=1e-14)
    assert jnp.linalg.det(matrix) == pytest.approx(1, abs=1e-14)


@pytest.mark.parametrize(
    ("target", "right", "down"),
    [
        ([0, 9, 0], [1, 0, 0], [0, 0, -1]),  # north
        ([9, 0, 0], [0, -1, 0], [0, 0, -1]),  # east
        ([0, 0, 9], [1, 0, 0], [0, 1, 0]),  # the zenith
        ([0, 0, -9], [1, 0, 0], [0, -1, 0]),  # the nadir: a map, north at the top
    ],
)
def test_right_and_down_are_where_the_field_has_them(target, right, down):
    matrix = quaternion_matrix(look_at(np.zeros(3), np.array(target, float)))
    np.testing.assert_allclose(matrix[:, 0], right, atol=1e-15)
    np.testing.assert_allclose(matrix[:, 1], down, atol=1e-15)


def test_looking_straight_up_is_the_end_of_tilting_up_from_north():
    straight = look_at(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    tilted = look_at(np.zeros(3), np.array([0.0, 1e-9, 1.0]))
    np.testing.assert_allclose(tilted, straight, atol=1e-9)


@pytest.mark.parametrize(
    "target", [[3.0, 4.0, 5.0], [-20.0, 0.1, -0.3], [0.0, -7.0, 0.0]]
)
def test_gradients_of_looking_are_those_of_finite_differences(target):
    position = jnp.array([1.0, 2.0, 0.5])
    check_grads(turned_to, (position, jnp.array(target)), order=1)


@pytest.mark.parametrize(
    "target", [[0.0, 0.0, 5.0], [0.0, 0.0, -5.0], [0.0, 0.0, 0.0], [1e-200, 0.0, 3.0]]
)
def test_gradients_are_finite_where_the_heading_is_not_defined(target):
    for derivative in (jax.jacfwd, jax.jacrev):
        slopes = jax.jit(derivative(look_at, argnums=(0, 1)))
        assert jnp.isfinite(jnp.stack(slopes(jnp.zeros(3), jnp.array(target)))).all()


QUARTER = np.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])
"""A quarter turn to the left about up: from east to north, from north to west."""
CAMERA = """[camera]
position_m = [0, 0, 0]
width = 3
height = 3
focal_px = 1
"""


def test_a_quarter_turn_means_the_same_to_a_camera_and_a_vehicle():
    expected = Rotation.from_rotvec([0.0, 0.0, np.pi / 2]).as_matrix()
    np.testing.assert_allclose(
        Rotation.from_quat(QUARTER).as_matrix(), expected, atol=1e-15
    )
    of_camera = quaternion_matrix(QUARTER)
    of_vehicle = rotation(four(jnp.asarray(QUARTER)))
    np.testing.assert_allclose(of_camera, expected, atol=1e-15)
    np.testing.assert_allclose(jnp.array(of_vehicle), expected, atol=1e-15)
    np.testing.assert_allclose(matrix_quaternion(expected), QUARTER, atol=1e-15)
    camera = Camera(
        position=np.zeros(3),
        quaternion=QUARTER,
        focal=np.ones(2),
        center=np.ones(2),
        width=3,
        height=3,
    )
    # the camera's and the vehicle's first axis both point north
    np.testing.assert_allclose(
        to_camera(camera, jnp.array([0.0, 1.0, 0.0])), [1.0, 0.0, 0.0], atol=1e-15
    )
    forward = times(of_vehicle, three(jnp.array([1.0, 0.0, 0.0])))
    np.testing.assert_allclose(jnp.array(forward), [0.0, 1.0, 0.0], atol=1e-15)


def test_a_file_says_the_order_in_the_keys_name():
    document = tomllib.loads(f"{CAMERA}quaternion_xyzw = [0, 0, 2, 2]")
    read = scene_from_document(document, "scene.toml").scene.camera
    assert read is not None
    np.testing.assert_allclose(read.quaternion, QUARTER, atol=1e-15)
