"""Frames: background, fires in front of it, tiles, exposures, moving cameras."""

import dataclasses
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Air, Camera, Charge, Scene, look_at
from jblast.scene.camera import FORWARD, quaternion_product
from jblast.sensors.camera.fireball import Appearance
from jblast.sensors.camera.geometry import CameraPath, carried_camera, pixel_rays
from jblast.sensors.camera.image import BACKGROUND
from jblast.sensors.camera.rendering import frames, in_view, light_at, render, view_of
from jblast.sensors.camera.surroundings import landscape
from tests.sensors.camera.fireball_scenes import one_charge, small_camera

TIMES = np.array([0.0, 0.01, 0.3])
SIZE = (18, 24, 3)
unchecked = getattr(render, "__wrapped__", render)


def test_frames_are_the_fireball_over_the_background():
    scene, camera = one_charge(), small_camera()
    found = render(scene, camera, TIMES, appearance=Appearance(flash=False))
    layer = render(scene, camera, TIMES, alpha=True)
    assert layer.shape == (3, 18, 24, 4)
    assert float(layer[2, ..., 3].max()) > 0.9
    colour, alpha = layer[..., :3], layer[..., 3:]
    expected = alpha * colour + (1.0 - alpha) * BACKGROUND
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    np.testing.assert_array_equal(found[0], BACKGROUND)


@pytest.mark.slow
def test_an_exposure_is_the_mean_of_instants_in_the_middle_of_its_parts():
    scene, times = one_charge(), np.array([0.001, 0.004])
    still = small_camera()
    blurred = dataclasses.replace(still, exposure_s=jnp.asarray(0.002))
    middles = 0.002 * (np.arange(8) + 0.5) / 8
    instants = np.sort((times[:, None] + middles).ravel())
    parts = np.asarray(render(scene, still, instants)).reshape(2, 8, *SIZE)
    found = render(scene, blurred, times)
    np.testing.assert_allclose(found, parts.mean(axis=1), rtol=1e-12)
    assert np.ptp(parts, axis=1).max() > 0.1


WIDE = Scene(
    charges=(
        Charge(10.0, (0.0, 0.0, 0.0), 0.1, name="a"),
        Charge(1.0, (14.0, 5.0, 0.0), 0.2, name="b"),
        Charge(1.0, (0.0, 0.0, 0.0), np.inf, name="never"),
    ),
    air=Air(wind_east=3.0),
)


@pytest.mark.slow
@pytest.mark.parametrize("aim", [(0.0, 0.0, 3.0), (-29.0, 0.0, 22.0)])
def test_tiles_show_the_light_of_each_pixel_alone(aim):
    """In whole tiles, in those at the edge, and in single precision."""
    place = np.array([0.0, -60.0, 2.0])
    camera = Camera(
        position=place,
        quaternion=look_at(place, np.array(aim)),
        focal=np.full(2, 130.0),
        center=np.array([64.0, 48.0]),
        width=129,
        height=97,
    )
    view, times = view_of(WIDE, camera, 0.2), jnp.array([0.05, 0.3])
    y, x = (n.ravel() for n in np.mgrid[:97, :129])
    lanes = jnp.repeat(times, x.size), jnp.tile(x, 2), jnp.tile(y, 2)
    alone = jax.jit(light_at)(view, *lanes).reshape(2, 97, 129, 3)
    found = frames(view, times)
    np.testing.assert_allclose(found, alone, rtol=1e-9)
    assert np.ptp(found[1]) > 0.1
    film = view_of(WIDE, camera, 0.2, dtype=jnp.float32, reverse=False)
    shown = frames(film, times)
    assert shown.dtype == jnp.float32
    off = np.abs(np.log(np.asarray(shown) / np.asarray(found)))
    assert np.quantile(off, 0.9999) < 1e-4


@pytest.mark.slow
def test_a_charge_that_never_happens_is_not_seen_and_has_no_gradient():
    camera, real = small_camera(), one_charge().charges[0]
    other = Charge(mass_kg=60.0, position_m=(0.0, -20.0, 3.0), time_s=jnp.inf)

    @jax.jit
    def gradient(charges):
        return jax.grad(lambda c: jnp.sum(render(Scene(c), camera, TIMES)))(charges)

    of_real, of_never = gradient((real, other))
    assert {float(x) for x in jax.tree.leaves(of_never)} == {0.0}
    (expected,) = gradient((real,))
    for here, there in zip(*map(jax.tree.leaves, (of_real, expected)), strict=True):
        np.testing.assert_allclose(here, there, rtol=1e-9)
    assert abs(float(expected.mass_kg)) > 1e-6
    assert bool(in_view(Scene((real,)), camera))
    assert not bool(in_view(Scene((other,)), camera))


def carried(focal=60.0, tilt=0.0, roll=0.0) -> Camera:
    """Return a camera on a vehicle that looks forward and down by an angle, rolled."""
    turn = [0.0, np.sin(tilt / 2), 0.0, np.cos(tilt / 2)]
    lean = [np.sin(roll / 2), 0.0, 0.0, np.cos(roll / 2)]
    turn = quaternion_product(np.array(lean), np.array(turn))
    return dataclasses.replace(
        small_camera(focal=[focal, focal], center=[11.5, 8.5]),
        position=jnp.zeros(3),
        quaternion=quaternion_product(turn, np.array(FORWARD)),
        mount="vehicle",
    )


def standing(up=5.0) -> CameraPath:
    time = np.linspace(0.0, 1.0, 3)
    turn = np.tile([0.0, 0.0, np.sin(np.pi / 4), np.cos(np.pi / 4)], (3, 1))
    place = np.tile([0.0, 0.0, up], (3, 1))
    return CameraPath(*map(jnp.asarray, (time, place, turn)))


@pytest.mark.slow
def test_a_carried_camera_that_stands_sees_what_a_fixed_one_sees():
    eye, path, times = carried(tilt=0.2), standing(), np.array([0.02, 0.3])
    scene = Scene(Charge(mass_kg=5.0, position_m=(0.0, 40.0, 3.0)))
    still = carried_camera(eye, path, jnp.asarray(0.0))
    x, y = np.meshgrid(np.arange(64), np.arange(64))
    checker = np.where((x // 32 + y // 32) % 2 == 1, 0.4, 0.1)[..., None]
    ground = landscape(np.repeat(checker, 3, axis=-1), 4.0 / 32)
    light = ground.light(pixel_rays(still), jnp.asarray(1.0 / 60.0))
    expected = render(scene, still, times, background=jnp.moveaxis(light, 0, -1))
    found = render(scene, eye, times, background=ground, path=path)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert np.ptp(found) > 1.0


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
        ({"camera": small_camera([0.0, -60.0, -1.0])}, "camera position: .*up = -1 m"),
        ({"camera": carried()}, "camera mount: expected a fixed camera"),
        ({"path": standing()}, "camera mount: expected a mount on a vehicle"),
        (
            {"camera": carried(), "path": standing(), "times": np.array([0.5, 1.5])},
            r"path, 0 to 1 s, got 0\.5 to 1\.5 s",
        ),
    ],
)
def test_bad_input_is_refused_by_name(options, message):
    inputs = {"camera": small_camera(), "times": TIMES} | options
    # sizes are for the function to check, not for the type checker
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
