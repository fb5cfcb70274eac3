"""Cameras that are carried, and where their rays end."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jblast.scene.camera import FORWARD, quaternion_matrix
from jblast.sensors.camera.geometry import (
    CameraPath,
    carried_camera,
    lens_rays,
    pixel_rays,
    surfaces_seen,
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
    found = turned_rays(lens_rays(on_body()), here)
    expected = pixel_rays(here)
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


EYE = np.array([0.0, -20.0, 3.0])
CAMERA = small_camera(EYE, (0.0, 0.0, 2.0))


def distance_to_plane(normal, through):
    """Return the distance along each ray of the camera to a plane."""
    way = np.asarray(pixel_rays(CAMERA, ground=False).direction)
    normal = np.asarray(normal, float)
    along = np.tensordot(normal, way, 1)
    return normal @ (np.asarray(through) - EYE) / along


def test_rays_that_go_down_end_at_level_ground_and_others_nowhere():
    rays = pixel_rays(CAMERA)
    ground = surfaces_seen(rays, image=False)
    down = np.asarray(rays.direction[2]) < 0
    np.testing.assert_array_equal(ground.solid, down)
    assert down.any()
    assert not down.all()
    np.testing.assert_allclose(
        EYE[2] + np.asarray(ground.place[2])[down], 0.0, atol=1e-12
    )
    np.testing.assert_array_equal(np.asarray(ground.normal[2])[down], 1.0)


@pytest.mark.parametrize("normal", [(0.0, -1.0, 0.0), (0.6, -0.8, 0.0), (0, -0.8, 0.6)])
def test_a_wall_faces_where_its_plane_does(normal):
    depth = distance_to_plane(normal, (0.0, 5.0, 0.0))
    rays = pixel_rays(CAMERA, depth, ground=False)
    wall = surfaces_seen(rays, image=True)
    assert np.asarray(wall.solid).all()
    expected = np.broadcast_to(np.array(normal)[:, None, None], wall.normal.shape)
    np.testing.assert_allclose(wall.normal, expected, atol=1e-10)


def test_a_pixel_alone_faces_the_camera_and_sky_has_no_surface():
    depth = np.full((18, 24), np.inf)
    depth[4, 7] = 12.0
    rays = pixel_rays(CAMERA, depth, ground=False)
    alone = surfaces_seen(rays, image=True)
    assert np.flatnonzero(alone.solid).tolist() == [4 * 24 + 7]
    np.testing.assert_allclose(
        alone.normal[:, 4, 7], -rays.direction[:, 4, 7], atol=1e-12
    )
    assert np.isfinite(np.asarray(alone.place)).all()


def test_the_ground_before_a_depth_image_is_level():
    # a wall stands on the ground: below its foot rays end at the plane
    depth = distance_to_plane((0.0, -1.0, 0.0), (0.0, 5.0, 0.0))
    rays = pixel_rays(CAMERA, depth)
    both = surfaces_seen(rays, image=True)
    level = EYE[1] + np.asarray(both.place[1]) < 5.0 - 1e-9
    assert level.any()
    np.testing.assert_array_equal(np.asarray(both.normal)[:, level][2], 1.0)
    upright = np.asarray(both.normal)[:, ~level]
    np.testing.assert_allclose(upright[1], -1.0, atol=1e-6)
