"""A camera that moves sees the ground move, and sends events of it."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Charge, Scene
from jblast.scene.camera import FORWARD, quaternion_product
from jblast.sensors.camera.geometry import CameraPath, carried_camera, pixel_rays
from jblast.sensors.camera.image import luminance
from jblast.sensors.camera.rendering import render, render_carried
from jblast.sensors.camera.surroundings import landscape
from tests.sensors.camera.fireball_scenes import small_camera

NEVER = Scene(Charge(mass_kg=1.0, time_s=jnp.inf))
DARK, BRIGHT = 0.1, 0.4


def camera(width=24, height=18, focal=60.0, tilt=0.0):
    """Return one that looks forward and down by an angle."""
    turn = [0.0, np.sin(tilt / 2), 0.0, np.cos(tilt / 2)]
    quaternion = quaternion_product(np.array(turn), np.array(FORWARD))
    return dataclasses.replace(
        small_camera(
            width=width,
            height=height,
            focal=[focal, focal],
            center=[(width - 1) / 2, (height - 1) / 2],
        ),
        position=jnp.zeros(3),
        quaternion=quaternion,
        threshold=jnp.array([0.2, 0.2]),
        mount="vehicle",
    )


def yawing(rate, seconds=1.0, up=5.0):
    time = np.linspace(0.0, seconds, 201)
    half = 0.5 * (rate * time + 0.5 * np.pi)
    turn = np.stack([0 * half, 0 * half, np.sin(half), np.cos(half)], axis=1)
    place = np.tile([0.0, 0.0, up], (201, 1))
    return CameraPath(jnp.asarray(time), jnp.asarray(place), jnp.asarray(turn))


def checker(cells=2):
    x, y = np.meshgrid(np.arange(32 * cells), np.arange(32 * cells))
    odd = (x // 32 + y // 32) % 2 == 1
    return np.repeat(np.where(odd, BRIGHT, DARK)[..., None], 3, axis=-1)


def test_a_camera_that_stands_sees_what_one_that_stands_sees():
    eye, path, times = camera(tilt=0.2), yawing(0.0), np.array([0.02, 0.3])
    scene = Scene(Charge(mass_kg=5.0, position_m=(0.0, 40.0, 3.0)))
    still = carried_camera(eye, path, jnp.asarray(0.0))
    ground = landscape(checker(), 4.0 / 32)
    light = ground.light(pixel_rays(still), jnp.asarray(1.0 / 60.0))
    expected = render(scene, still, times, background=jnp.moveaxis(light, 0, -1))
    found = render_carried(scene, eye, path, times, background=ground)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_times_off_the_path_are_refused_and_so_is_the_wrong_function():
    eye, path = camera(), yawing(0.0)
    with pytest.raises(InputError, match=r"path, 0 to 1 s, got 0\.5 to 1\.5 s"):
        render_carried(NEVER, eye, path, np.array([0.5, 1.5]))
    with pytest.raises(InputError, match=r"camera mount: expected a fixed camera"):
        render(NEVER, eye, np.array([0.5]))
    with pytest.raises(InputError, match="camera mount: expected a mount on a vehicle"):
        render_carried(NEVER, small_camera(), path, np.array([0.5]))


def test_a_far_texture_is_even_and_keeps_its_mean():
    image = np.random.default_rng(2).random((24, 31, 3))
    ground = landscape(image, 0.01)
    still = carried_camera(camera(), yawing(0.0, up=3000.0), jnp.asarray(0.0))
    rays = pixel_rays(still)
    light = np.asarray(ground.light(rays, jnp.asarray(1.0 / 60.0)))
    below = np.asarray(rays.direction[2]) < -0.02
    expected = image.mean(axis=(0, 1))[:, None]
    np.testing.assert_allclose(light[:, below] - expected, 0.0, atol=1e-12)


def test_a_texture_has_east_to_its_right_and_north_up():
    image = np.zeros((4, 4, 3))
    image[0, 3] = 1.0  # its corner in the north-east
    ground = landscape(image, 1.0)
    places = np.array([[1.5, 1.5], [-1.5, 1.5], [1.5, -1.5], [5.5, 1.5]])
    seen = []
    for east, north in places:
        down = dataclasses.replace(
            small_camera((east, north - 1e-9, 1.0), (east, north, 0.0), 1, 1),
            center=jnp.zeros(2),
        )
        light = ground.light(pixel_rays(down), jnp.asarray(1e-3))
        seen.append(float(luminance(light[:, 0, 0])))
    np.testing.assert_allclose(seen, [1.0, 0.0, 0.0, 1.0], atol=1e-6)
