import dataclasses
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.sensors.camera.fireball import Appearance, fireball_layer
from jblast.sensors.camera.image import BACKGROUND, over
from jblast.sensors.camera.rendering import render
from tests.sensors.camera.fireball_scenes import EYE, one_charge, single, small_camera

TIMES = np.array([0.0, 0.01, 0.3])
SIZE = (18, 24, 3)


def test_frames_are_the_fireball_over_the_background():
    scene, camera = one_charge(), small_camera()
    frames = render(scene, camera, TIMES, appearance=Appearance(flash=False))
    layer = eqx.filter_jit(fireball_layer)(scene, camera, 0.3)
    expected = over(layer, jnp.full(SIZE, BACKGROUND))
    np.testing.assert_allclose(frames[2], expected, rtol=1e-12)
    np.testing.assert_array_equal(frames[0], BACKGROUND)
    alone = render(scene, camera, TIMES, alpha=True)
    np.testing.assert_allclose(alone[2], layer, rtol=1e-12)
    assert frames.shape == (3, *SIZE)
    assert alone.shape == (3, 18, 24, 4)


@pytest.mark.slow
def test_every_kind_of_background_is_the_same_behind():
    scene, camera = one_charge(), small_camera()
    colour = jnp.array([0.1, 0.2, 0.3])
    image = jnp.broadcast_to(colour, SIZE)
    expected = render(scene, camera, TIMES, background=colour)
    for same in (image, jnp.stack([image] * 3), lambda time: image):
        frames = render(scene, camera, TIMES, background=same)
        np.testing.assert_allclose(frames, expected, rtol=1e-14)


def test_a_frame_source_is_asked_for_each_time_and_so_is_a_list_of_images():
    camera, nothing = small_camera(), one_charge(time_s=9.0)
    moving = render(nothing, camera, TIMES, background=lambda t: jnp.full(SIZE, t))
    np.testing.assert_allclose(
        moving, np.broadcast_to(TIMES[:, None, None, None], moving.shape)
    )
    images = np.random.default_rng(1).random((3, *SIZE))
    np.testing.assert_array_equal(
        render(nothing, camera, TIMES, background=images), images
    )


def test_an_exposure_is_the_mean_of_instants_in_the_middle_of_its_parts():
    scene, times = one_charge(), np.array([0.001, 0.004])
    still = small_camera()
    blurred = dataclasses.replace(still, exposure_s=jnp.asarray(0.002))
    for count in (1, 4):
        frames = render(scene, blurred, times, exposures=count)
        middles = 0.002 * (np.arange(count) + 0.5) / count
        parts = [render(scene, still, times + middle) for middle in middles]
        np.testing.assert_allclose(frames, np.mean(parts, axis=0), rtol=1e-12)
    assert np.abs(frames - render(scene, still, times)).max() > 0.1


@pytest.mark.slow
def test_supersampling_is_the_mean_of_the_rays():
    scene = one_charge()
    fine = small_camera(width=72, height=54, focal=[120.0, 123.0], center=[35.5, 25.0])
    camera = small_camera()  # a third of all: x' = 3 x + 1
    dark = Appearance(flash=False)  # which lights a pixel by its middle
    rays = np.asarray(render(scene, fine, TIMES, exposures=1, appearance=dark))
    mean = rays.reshape(3, 18, 3, 24, 3, 3).mean((2, 4))
    frames = render(scene, camera, TIMES, supersample=3, appearance=dark)
    np.testing.assert_allclose(frames, mean, rtol=1e-9)


@pytest.mark.slow
def test_batches_of_scenes_cameras_and_times_are_their_own_loops():
    masses, starts = jnp.array([20.0, 100.0]), jnp.array([0.0, 0.05])
    places = jnp.array([[3.0, -60.0, 4.0], [-20.0, -50.0, 2.0]])

    @jax.jit
    @jax.vmap
    def frames(mass, start, place):
        camera = small_camera_at(place)
        times = start + jnp.array([0.01, 0.3])
        return render(one_charge(mass), camera, times, alpha=True)

    def small_camera_at(place):
        return eqx.tree_at(lambda c: c.position, small_camera(), place)

    batch = frames(masses, starts, places)
    for i in range(2):
        camera, times = small_camera_at(places[i]), starts[i] + jnp.array([0.01, 0.3])
        alone = render(one_charge(masses[i]), camera, times, alpha=True)
        np.testing.assert_allclose(batch[i], alone, rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_single_precision_gives_the_same_picture():
    scene, camera = one_charge(), small_camera()
    double = render(scene, camera, TIMES, supersample=2)
    times = jnp.asarray(TIMES, jnp.float32)
    frames = render(
        single(scene),
        single(camera),
        times,
        supersample=2,
        background=jnp.float32(BACKGROUND),
        appearance=single(Appearance()),
    )
    assert frames.dtype == jnp.float32
    # seven digits of 60 m leave 1e-5 of a radius: at the limb 1e-4 of the light
    np.testing.assert_allclose(frames, double, rtol=2e-3)


@pytest.mark.slow
def test_a_camera_may_be_made_inside_jit():
    def total(place):
        return render(one_charge(), small_camera_moved(place), TIMES).sum()

    def small_camera_moved(place):
        return dataclasses.replace(small_camera(), position=place)

    expected = render(one_charge(), small_camera(), TIMES).sum()
    assert float(jax.jit(total)(jnp.asarray(EYE))) == pytest.approx(float(expected))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"times": np.array([0.0, 0.2, 0.1])}, "times: .* order, got 0.1 s after 0.2"),
        ({"times": np.array([0.0, np.nan])}, "times: expected finite"),
        ({"times": np.zeros((2, 2))}, "times: expected a list"),
        ({"depth": np.full((18, 24), -1.0)}, "depth: .*got -1 at row 0"),
        ({"depth": np.full((18, 24), np.nan)}, "depth: .*got nan at row 0"),
        ({"depth": np.ones((24, 18))}, r"depth: expected shape \(18, 24\)"),
        ({"background": np.ones((18, 24, 4))}, "background: .* got .18, 24, 4"),
        ({"background": lambda t: jnp.ones((2, 2, 3))}, "background: .* got .2, 2, 3"),
        ({"supersample": 0}, "supersample: expected at least 1, got 0"),
        ({"exposures": 0}, "exposures: expected at least 1, got 0"),
        ({"camera": small_camera([0.0, -60.0, -1.0])}, "camera position: .*up = -1 m"),
    ],
)
def test_bad_input_is_refused_by_name(options, message):
    inputs = {"camera": small_camera(), "times": TIMES} | options
    # sizes are for the function to judge, not for the type checker
    with pytest.raises(InputError, match=message):
        unchecked(one_charge(), inputs.pop("camera"), inputs.pop("times"), **inputs)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("white", 0.0), ("lumps", np.inf), ("rim", 1.2), ("smoke", -1)),
        ("illuminance", 0.0),
    ],
)
def test_a_look_that_cannot_be_is_refused(name, value):
    with pytest.raises(
        InputError, match=f"appearance {name}: expected a number above 0"
    ):
        Appearance(**cast(Any, {name: float(value)}))


def test_below_the_ground_is_allowed_where_there_is_none():
    camera = small_camera([0.0, -60.0, -1.0])
    assert render(one_charge(), camera, TIMES, ground=False).max() > 1.0


unchecked = getattr(render, "__wrapped__", render)
