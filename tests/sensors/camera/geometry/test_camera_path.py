import dataclasses

import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from jblast.scene.camera import FORWARD, quaternion_matrix
from jblast.sensors.camera.geometry import (
    CameraPath,
    camera_rays,
    carried_camera,
    pixel_rays,
    pixels_moved,
    turned_rays,
)
from tests.sensors.camera.fireball_scenes import small_camera


def on_body():
    camera = small_camera()
    return dataclasses.replace(
        camera,
        position=jnp.array([0.3, -0.1, 0.2]),
        quaternion=jnp.array(FORWARD),
        mount="vehicle",
    )


def path_of(turns, places, step=0.5):
    clock = step * np.arange(len(turns))
    return CameraPath(*(jnp.asarray(v, float) for v in (clock, places, turns)))


def test_a_camera_on_a_body_goes_and_turns_with_it():
    turn = Rotation.from_euler("z", 90, degrees=True)  # from east to north
    path = path_of([turn.as_quat()] * 2, [[5.0, 6.0, 7.0]] * 2)
    here = carried_camera(on_body(), path, jnp.asarray(0.2))
    # forward is north, left is west
    np.testing.assert_allclose(here.position, [5.1, 6.3, 7.2], atol=1e-12)
    right, down, ahead = np.asarray(quaternion_matrix(here.quaternion)).T
    np.testing.assert_allclose(right, [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(down, [0.0, 0.0, -1.0], atol=1e-12)
    np.testing.assert_allclose(ahead, [0.0, 1.0, 0.0], atol=1e-12)
    assert here.mount == ""


def test_rays_of_a_lens_that_are_turned_are_those_of_the_camera():
    turn = Rotation.from_euler("zyx", [40, 15, -10], degrees=True).as_quat()
    path = path_of([turn] * 2, [[1.0, 2.0, 9.0]] * 2)
    here = carried_camera(on_body(), path, jnp.asarray(0.1))
    found = turned_rays(camera_rays(on_body(), 2), here)
    expected = pixel_rays(here, supersample=2)
    for name in ("origin", "direction", "farthest"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(expected, name), rtol=1e-12, atol=1e-12
        )


def test_between_rows_it_turns_the_shorter_way_at_an_even_pace():
    angles = np.radians([0.0, 2.0])
    turns = [[0.0, 0.0, np.sin(a / 2), np.cos(a / 2)] for a in angles]
    path = path_of([turns[0], [-v for v in turns[1]]], [[0.0, 0, 5], [2.0, 0, 5]])
    place, turn = path.at(jnp.asarray(0.125))
    np.testing.assert_allclose(place, [0.5, 0.0, 5.0])
    # a chord of 2 degrees: its quarter is off by 1e-5 of that
    np.testing.assert_allclose(
        2 * np.arctan2(turn[2], turn[3]), 0.25 * angles[1], rtol=2e-4
    )
    for time in (-1.0, 9.0):
        np.testing.assert_allclose(path.at(jnp.asarray(time))[0][2], 5.0)


def test_pixels_moved_are_focal_lengths_times_the_angle():
    angles = np.linspace(0.0, 1.0, 11)
    turns = [[0.0, 0.0, np.sin(a / 2), np.cos(a / 2)] for a in angles]
    moved = pixels_moved(on_body(), path_of(turns, np.full((11, 3), 4.0)))
    np.testing.assert_allclose(moved, 41.0 * angles, rtol=1e-9)
