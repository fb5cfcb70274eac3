"""Where rays end: level ground, walls of a depth image, nothing."""

import numpy as np
import pytest

from jblast.sensors.camera.geometry import pixel_rays, surfaces_seen
from tests.sensors.camera.fireball_scenes import small_camera

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
    np.testing.assert_allclose(np.asarray(ground.place[2])[down], 0.0, atol=1e-12)
    np.testing.assert_array_equal(np.asarray(ground.normal[2])[down], 1.0)


@pytest.mark.parametrize("normal", [(0.0, -1.0, 0.0), (0.6, -0.8, 0.0), (0, -0.8, 0.6)])
def test_a_wall_faces_where_its_plane_does(normal):
    depth = distance_to_plane(normal, (0.0, 5.0, 0.0))
    rays = pixel_rays(CAMERA, depth, ground=False)
    wall = surfaces_seen(rays, image=True)
    assert np.asarray(wall.solid).all()
    expected = np.broadcast_to(np.array(normal)[:, None, None], wall.normal.shape)
    np.testing.assert_allclose(wall.normal, expected, atol=1e-10)


def test_an_edge_does_not_bend_the_surfaces_on_its_sides():
    near, far = (distance_to_plane((0, -1.0, 0), (0, y, 0)) for y in (-5.0, 30.0))
    depth = np.where(np.arange(24) < 10, near, far)
    walls = surfaces_seen(pixel_rays(CAMERA, depth, ground=False), image=True)
    expected = np.broadcast_to(
        np.array([0.0, -1.0, 0.0])[:, None, None], walls.normal.shape
    )
    np.testing.assert_allclose(walls.normal, expected, atol=1e-10)


def test_a_pixel_alone_faces_the_camera_and_sky_has_no_surface():
    depth = np.full((18, 24), np.inf)
    depth[4, 7] = 12.0
    rays = pixel_rays(CAMERA, depth, ground=False)
    alone = surfaces_seen(rays, image=True)
    assert np.flatnonzero(alone.solid).tolist() == [4 * 24 + 7]
    np.testing.assert_allclose(
        alone.normal[:, 4, 7], -np.asarray(rays.direction[:, 4, 7]), atol=1e-12
    )
    assert np.isfinite(np.asarray(alone.place)).all()


def test_the_ground_before_a_depth_image_is_level():
    # a wall stands on the ground: below its foot rays end at the plane
    depth = distance_to_plane((0.0, -1.0, 0.0), (0.0, 5.0, 0.0))
    rays = pixel_rays(CAMERA, depth)
    both = surfaces_seen(rays, image=True)
    level = np.asarray(both.place[1]) < 5.0 - 1e-9
    assert level.any()
    np.testing.assert_array_equal(np.asarray(both.normal)[:, level][2], 1.0)
    upright = np.asarray(both.normal)[:, ~level]
    np.testing.assert_allclose(upright[1], -1.0, atol=1e-6)
