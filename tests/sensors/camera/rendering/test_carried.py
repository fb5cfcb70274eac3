"""A camera that moves sees the ground move, and sends events of it."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Charge, Scene
from jblast.scene.camera import FORWARD, quaternion_product
from jblast.sensors.camera.events.stream import stream_events
from jblast.sensors.camera.film import Film, subdivided
from jblast.sensors.camera.geometry import CameraPath, carried_camera, pixel_rays
from jblast.sensors.camera.image import luminance
from jblast.sensors.camera.rendering import render, render_carried
from jblast.sensors.camera.surroundings import landscape
from tests.sensors.camera.fireball_scenes import small_camera

NEVER = Scene(charge=Charge(mass_kg=1.0, time_s=jnp.inf))
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


def event_count(path, eye, texture, seconds=1.0):
    film = Film(
        NEVER,
        eye,
        np.linspace(0.0, seconds, 6),
        background=landscape(texture, 4.0 / 32),
        path=path,
    )
    blocks = subdivided(dataclasses.replace(film, scene=SOON), 0.2)
    return sum(len(part.time) for part in stream_events(blocks, (0.2, 0.2)))


SOON = Scene(charge=Charge(mass_kg=1e-3, position_m=(0.0, -900.0, 1.0), time_s=0.01))
"""A charge that nobody sees, behind the camera and far."""


def test_a_camera_that_stands_sees_what_one_that_stands_sees():
    eye, path, times = camera(tilt=0.2), yawing(0.0), np.array([0.02, 0.3])
    scene = Scene(charge=Charge(mass_kg=5.0, position_m=(0.0, 40.0, 3.0)))
    still = carried_camera(eye, path, jnp.asarray(0.0))
    ground = landscape(checker(), 4.0 / 32)
    light = ground.light(pixel_rays(still), jnp.asarray(1.0 / 60.0))
    expected = render(scene, still, times, background=jnp.moveaxis(light, 0, -1))
    found = render_carried(scene, eye, path, times, background=ground)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.slow
def test_a_camera_that_hovers_sends_nothing_and_one_that_yaws_what_edges_it_sweeps():
    eye = camera(tilt=0.3, width=40, height=8, focal=60.0)
    assert event_count(yawing(0.0), eye, checker()) == 0
    even = np.full((8, 8, 3), 0.2)
    assert event_count(yawing(0.5), eye, even) == 0
    # each edge that a pixel sweeps gives log(4)/0.2 = 6.9 events of one sign; how many
    # edges: those between the parities of the cells that its ray meets
    rate, fine = 0.2, np.linspace(0.0, 1.0, 4001)
    found = event_count(yawing(rate), eye, checker(), 1.0)
    rays = pixel_rays(carried_camera(eye, yawing(0.0), jnp.asarray(0.0)))
    way = np.asarray(rays.farthest)
    assert np.isfinite(way).all()
    east, north = (
        way * np.asarray(rays.direction[0]),
        way * np.asarray(rays.direction[1]),
    )
    angle = rate * fine[:, None, None]
    x = east * np.cos(angle) - north * np.sin(angle)
    y = east * np.sin(angle) + north * np.cos(angle)
    parity = (np.floor(x / 4.0) + np.floor(y / 4.0)).astype(int) % 2
    edges = int(np.abs(np.diff(parity, axis=0)).sum())
    assert edges > 200
    # texels and the pyramid soften the edges: where a pixel stays within one, or grazes
    # a corner, fewer thresholds are crossed
    assert 4.5 * edges < found < 7.0 * edges


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
