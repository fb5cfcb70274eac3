"""The fire lights the ground and walls, by the laws of light."""

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.sensors.camera.fireball import Appearance, cloud, glow
from jblast.sensors.camera.geometry import pixel_rays, surfaces_seen
from jblast.sensors.camera.rendering import render
from jblast.sensors.camera.surroundings import disc_light
from tests.sensors.camera.fireball_scenes import EYE, one_charge, small_camera

pytestmark = pytest.mark.slow  # programs of their own

TIMES = np.array([0.0, 0.004, 0.02])
PLATE = 0.18
SCENE = one_charge(up=4.0)


def seen(scene=SCENE, times=TIMES, **options):
    return np.asarray(render(scene, small_camera(), times, **options))


@pytest.fixture(scope="module")
def frames():
    return seen()


@pytest.fixture(scope="module")
def clear():
    """Pixels that no fireball covers, at each time."""
    return seen(alpha=True)[..., 3] == 0.0


def gained(frames, colour=0):
    return frames[..., colour] / PLATE - 1.0


def test_a_high_burst_lights_the_ground_as_a_lambertian_sphere():
    high, time, look = one_charge(mass=1.0, up=30.0), 0.01, Appearance()
    surfaces = surfaces_seen(pixel_rays(small_camera()), image=False)
    ball = cloud(high.charges[0], jnp.asarray(time), high.air)
    places = np.asarray(surfaces.place) + EYE[:, None, None]
    offset = np.asarray(ball.centre)[:, None, None] - places
    square = np.sum(offset**2, axis=0)
    light = disc_light(ball, glow(ball.temperature, ball.air, look), look)
    factor = float(ball.radius) ** 2 * offset[2] / square**1.5
    expected = np.asarray(light) / float(look.white) * factor[..., None]
    found = seen(high, np.array([time]))[0] / PLATE - 1.0
    solid = np.asarray(surfaces.solid)
    np.testing.assert_allclose(found[solid], expected[solid], rtol=1e-9)
    np.testing.assert_array_equal(found[~solid], 0.0)


def test_the_light_that_falls_is_the_light_that_is_seen_there():
    # a camera that looks at the fire from where it falls sums what its pixels show
    size, focal = 360, 3600.0
    half = (size - 1) / 2
    camera = small_camera(
        (0.0, -200.0, 2.0),
        (0.0, 0.0, 2.0),
        width=size,
        height=size,
        focal=[focal, focal],
        center=[half, half],
    )
    dull = Appearance(smoke=1e-9)  # what the smoke gives back of the day is no flash
    high, time = one_charge(up=2.0), np.array([0.02])
    options = {"alpha": True, "ground": False, "appearance": dull}
    layer = np.asarray(render(high, camera, time, **options))[0]
    x, y = np.meshgrid(*[(np.arange(size) - half) / focal] * 2)
    angle = (1 + x**2 + y**2) ** -1.5 / focal**2
    total = np.sum(layer[..., :3] * layer[..., 3:] * angle[..., None], axis=(0, 1))
    ball = cloud(high.charges[0], jnp.asarray(0.02), high.air)
    light = disc_light(ball, glow(ball.temperature, ball.air, dull), dull)
    near = (float(ball.radius) / 200.0) ** 2
    expected = np.pi * np.asarray(light) / float(dull.white) * near
    # 150 rays a radius
    np.testing.assert_allclose(total, expected, rtol=1e-3)


def test_a_wall_of_a_depth_image_is_lit_where_it_faces_the_fire(clear):
    way = np.asarray(pixel_rays(small_camera(), ground=False).direction)
    behind = (40.0 + 60.0) / way[1]  # a wall 40 m north of the burst, facing south
    before = 30.0 / way[1]  # and one 30 m south of it, that turns its back to it
    lit, dark = (seen(depth=depth, ground=False)[2] for depth in (behind, before))
    assert (gained(lit)[clear[2]] > 0.01).all()
    np.testing.assert_array_equal(dark, PLATE)
