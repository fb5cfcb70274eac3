"""The fire lights the ground and walls, by the laws of light."""

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Camera, Charge, Scene, look_at
from jblast.sensors.camera.fireball import Appearance, cloud, fireball_layer, glow
from jblast.sensors.camera.geometry import pixel_rays, surfaces_seen
from jblast.sensors.camera.rendering import render
from jblast.sensors.camera.surroundings import brightened, disc_light, flash, lit_rows
from tests.sensors.camera.fireball_scenes import one_charge, small_camera

TIMES = np.array([0.0, 0.004, 0.02])
PLATE = 0.18


@pytest.fixture(scope="module")
def scene():
    return one_charge(up=4.0)


@pytest.fixture(scope="module")
def frames(scene):
    return np.asarray(render(scene, small_camera(), TIMES))


def gained(frames, colour=0):
    return frames[..., colour] / PLATE - 1.0


def alpha(scene, time):
    return fireball_layer(scene, small_camera(), time)[..., 3]


def test_a_high_burst_lights_the_ground_as_a_lambertian_sphere():
    high = one_charge(mass=1.0, up=30.0)
    camera = small_camera()
    surfaces = surfaces_seen(pixel_rays(camera), image=False)
    time, look = jnp.asarray(0.01), Appearance()
    ball = cloud(high, high.charge, time)
    offset = np.asarray(ball.centre)[:, None, None] - np.asarray(surfaces.place)
    square = np.sum(offset**2, axis=0)
    light = disc_light(ball, glow(ball.temperature, ball.air, look), look)
    factor = float(ball.radius) ** 2 * offset[2] / square**1.5
    expected = np.asarray(light)[:, None, None] / float(look.white) * factor
    found = flash(high, surfaces, time, look)
    solid = np.asarray(surfaces.solid)
    np.testing.assert_allclose(
        np.asarray(found)[:, solid], expected[:, solid], rtol=1e-12
    )
    np.testing.assert_array_equal(np.asarray(found)[:, ~solid], 0.0)


def test_the_light_that_falls_is_the_light_that_is_seen_there():
    # a camera that looks at the fire from where it falls sums what its pixels show
    camera = small_camera(
        (0.0, -200.0, 2.0),
        (0.0, 0.0, 2.0),
        width=60,
        height=60,
        focal=[600.0, 600.0],
        center=[29.5, 29.5],
    )
    dull = Appearance(smoke=1e-9)  # what the smoke gives back of the day is no flash
    high, time = one_charge(up=2.0), jnp.asarray(0.02)
    layer = np.asarray(
        fireball_layer(
            high, camera, time, ground=False, supersample=6, appearance=dull
        ),
    )
    x, y = np.meshgrid((np.arange(60) - 29.5) / 600, (np.arange(60) - 29.5) / 600)
    angle = (1 + x**2 + y**2) ** -1.5 / 600**2
    seen = np.sum(layer[..., :3] * layer[..., 3:] * angle[..., None], axis=(0, 1))
    ball = cloud(high, high.charge, time)
    light = disc_light(ball, glow(ball.temperature, ball.air, dull), dull)
    near = (float(ball.radius) / 200.0) ** 2
    expected = np.pi * np.asarray(light) / float(dull.white) * near
    # six rays along each pixel, of 25 a radius
    np.testing.assert_allclose(seen, expected, rtol=1e-3)


def test_the_sky_is_not_lit_and_nothing_is_before_detonation(scene, frames):
    sky = ~np.isfinite(np.asarray(pixel_rays(small_camera()).farthest))
    clear = sky & (np.asarray(alpha(scene, TIMES[2])) == 0.0)
    np.testing.assert_array_equal(frames[2][clear], PLATE)
    np.testing.assert_array_equal(frames[0], PLATE)


def test_at_dusk_the_same_fire_gives_more_and_smoke_gives_back_less(scene, frames):
    dusk = Appearance(illuminance=1e5 / 10)
    found = np.asarray(render(scene, small_camera(), TIMES, appearance=dusk))
    clear = np.asarray(alpha(scene, TIMES[1])) == 0.0
    ratio = 3e4 / (1e4 / np.pi)
    np.testing.assert_allclose(
        gained(found[1])[clear], ratio * gained(frames[1])[clear], rtol=1e-9, atol=1e-14
    )
    late = jnp.asarray(1.5)
    day, dim = (
        fireball_layer(scene, small_camera(), late, appearance=look)
        for look in (Appearance(), dusk)
    )
    smoke = np.asarray(day[..., 3]) > 0.5
    assert (np.asarray(dim)[smoke] < np.asarray(day)[smoke]).any(axis=-1).all()


def test_a_wall_of_a_depth_image_is_lit_where_it_faces_the_fire(scene):
    camera, time = small_camera(), TIMES[2:]
    way = np.asarray(pixel_rays(camera, ground=False).direction)
    behind = (40.0 + 60.0) / way[1]  # a wall 40 m north of the burst, facing south
    before = 30.0 / way[1]  # and one 30 m south of it, that turns its back to it
    lit, dark = (
        np.asarray(render(scene, camera, time, depth=depth, ground=False))[0]
        for depth in (behind, before)
    )
    clear = np.asarray(alpha(scene, TIMES[2])) == 0.0
    assert (gained(lit)[clear] > 0.01).all()
    np.testing.assert_array_equal(dark, PLATE)


SCENE = Scene(Charge(mass_kg=15.0))
SIZE = 41, 30


def seen(aim):
    place = np.array([0.0, -40.0, 3.0])
    camera = Camera(
        position=place,
        quaternion=look_at(place, np.array([0.0, 0.0, aim])),
        focal=np.full(2, 40.0),
        center=np.array([14.5, 20.0]),
        width=SIZE[1],
        height=SIZE[0],
    )
    return surfaces_seen(pixel_rays(camera), image=False)


@pytest.mark.parametrize("aim", [3.0, 12.0, -12.0, 60.0])
def test_the_light_is_that_of_the_whole_image(aim):
    """At the horizon, above it, on the ground, into the sky."""
    surfaces, time = seen(aim), jnp.asarray(0.02)
    behind = jnp.asarray(np.random.default_rng(0).uniform(size=(*SIZE, 3)))
    gained = flash(SCENE, surfaces, time, Appearance())
    whole = behind * (1.0 + jnp.moveaxis(gained, 0, -1))
    found = brightened(behind, lit_rows(surfaces), SCENE, time, Appearance())
    np.testing.assert_allclose(found, whole, rtol=1e-14)
    assert bool((whole > behind).any()) == bool(surfaces.solid.any())


def test_sky_is_left_out_and_what_is_lit_is_not():
    surfaces = seen(8.0)
    part = lit_rows(surfaces)
    height = part.surfaces.solid.shape[0]
    assert height < SIZE[0] - 10
    assert int(part.surfaces.solid.sum()) == int(surfaces.solid.sum())
    rows = slice(int(part.first), int(part.first) + height)
    np.testing.assert_array_equal(part.surfaces.place, surfaces.place[:, rows])
