"""The sun stands where it is put, and gives the day's light."""

import dataclasses
import math

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import look_at
from jblast.sensors.camera.geometry import Rays, pixel_rays, project
from jblast.sensors.camera.surroundings import GLARE, RADIUS, landscape, sun_at
from tests.sensors.camera.fireball_scenes import small_camera


def camera(focal=40.0):
    place = np.array([0.0, 0.0, 2.0])
    return dataclasses.replace(
        small_camera(width=64, height=48, focal=[focal, focal], center=[31.5, 23.5]),
        position=jnp.asarray(place),
        quaternion=jnp.asarray(look_at(place, place + np.array([1.0, 1.0, 0.5]))),
    )


@pytest.mark.parametrize(("azimuth", "elevation"), [(45.0, 20.0), (30.0, 35.0)])
def test_it_stands_where_it_projects(azimuth, elevation):
    eye, sun = camera(), sun_at(azimuth, elevation)
    light = landscape(sun=sun).light(pixel_rays(eye), jnp.asarray(1 / 40.0))
    row, column = np.unravel_index(np.argmax(np.asarray(light[1])), light[1].shape)
    level = math.cos(math.radians(elevation))
    far = 1e6 * np.array(
        [
            level * math.sin(math.radians(azimuth)),
            level * math.cos(math.radians(azimuth)),
            math.sin(math.radians(elevation)),
        ]
    )
    seen = project(eye, jnp.asarray(far) + eye.position)
    # the brightest pixel is within one of the middle
    assert np.hypot(*(np.asarray(seen.pixel) - [column, row])) < 1.0


def test_without_a_sun_the_sky_is_the_same():
    eye = camera()
    rays, pixel = pixel_rays(eye), jnp.asarray(1 / 40.0)
    plain = np.asarray(landscape().light(rays, pixel))
    lit = np.asarray(landscape(sun=sun_at(45.0, 20.0)).light(rays, pixel))
    ground = np.isfinite(np.asarray(rays.farthest))
    assert ground.any()
    np.testing.assert_array_equal(lit[:, ground], plain[:, ground])
    assert (lit[:, ~ground] > plain[:, ~ground]).all()


@pytest.mark.parametrize("pixel", [0.05 * RADIUS, RADIUS, 4.0 * RADIUS])
def test_its_disc_gives_the_light_of_the_day(pixel):
    # a small plane of rays around it, much finer than a pixel
    side = np.linspace(-1.0, 1.0, 801) * 2.0 * max(pixel, RADIUS)
    x, y = np.meshgrid(side, side)
    way = np.stack([x, y, np.ones_like(x)])
    way = jnp.asarray(way / np.linalg.norm(way, axis=0))
    light = np.asarray(sun_at(0.0, 90.0).light(way, jnp.asarray(pixel)))
    apart = np.degrees(np.maximum(np.hypot(x, y), RADIUS))
    disc = light - GLARE / apart**2
    # a white wall that faces it: light times solid angle over pi; rays cut its edge
    wall = disc.sum() * (side[1] - side[0]) ** 2 / math.pi
    assert wall == pytest.approx(1.0, rel=5e-3)


def test_the_glare_is_stiles_and_holladays():
    rays = Rays(
        jnp.zeros(3),
        jnp.array(
            [
                [[math.sin(math.radians(10.0))]],
                [[0.0]],
                [[math.cos(math.radians(10.0))]],
            ]
        ),
        jnp.full((1, 1), jnp.inf),
    )
    light = sun_at(0.0, 90.0).light(rays.direction, jnp.asarray(1e-3))
    # 10 E / theta^2 over E / pi, at ten degrees
    assert float(light[0, 0]) == pytest.approx(0.1 * math.pi, rel=1e-5)


@pytest.mark.parametrize(
    ("azimuth", "elevation"),
    [(math.nan, 10.0), (0.0, -1.0), (0.0, 91.0), (0.0, math.nan)],
)
def test_a_sun_that_is_nowhere_is_refused(azimuth, elevation):
    with pytest.raises(InputError, match="sun: expected"):
        sun_at(azimuth, elevation)
