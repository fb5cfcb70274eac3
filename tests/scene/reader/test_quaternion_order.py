"""One order of a quaternion's numbers: (x, y, z, w), scalar last, as SciPy has it."""

import tomllib

import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from jblast.scene import Camera, look_at, matrix_quaternion, quaternion_matrix
from jblast.scene.reader.scene import read_camera
from jblast.sensors.camera.geometry import to_camera
from jblast.vehicle.state import four, rotation, three, times

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


def test_looking_north_is_a_quarter_turn_about_east():
    # the camera without rotation looks up with its foot to the north
    turn = Rotation.from_rotvec([-np.pi / 2, 0.0, 0.0]).as_quat()
    found = look_at(np.zeros(3), np.array([0.0, 9.0, 0.0]))
    np.testing.assert_allclose(found, turn, atol=1e-15)


def test_a_file_says_the_order_in_the_keys_name():
    read = read_camera(
        tomllib.loads(f"{CAMERA}quaternion_xyzw = [0, 0, 2, 2]"), "scene.toml"
    )
    assert read is not None
    np.testing.assert_allclose(read.quaternion, QUARTER, atol=1e-15)
