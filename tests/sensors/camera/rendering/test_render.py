import dataclasses
from typing import Any, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.sensors.camera.fireball import Appearance, fireball_layer
from jblast.sensors.camera.image import BACKGROUND, over
from jblast.sensors.camera.rendering import render
from tests.sensors.camera.fireball_scenes import one_charge, small_camera

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


unchecked = getattr(render, "__wrapped__", render)
