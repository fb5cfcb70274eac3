"""Pictures of an explosion as cameras see them: size, light, place, time and side."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import ArrayLike

from jblast.scene import Air, Camera, Charge, Scene, look_at
from jblast.sensors.camera.explosion import low_passed
from jblast.sensors.camera.files.images import write_png
from jblast.sensors.camera.files.views import explosion_views
from jblast.sensors.camera.fireball import cloud
from jblast.sensors.camera.geometry import project
from jblast.sensors.camera.image import blackbody_light
from jblast.sensors.camera.rendering import render
from jblast.waves.fireballs import fireball, fireball_duration
from tests.sensors.camera.rendering.baked.noise_set import (
    PHASES,
    visible_radius,
    write_noise_set,
)

WIDTH, HEIGHT, FOCAL = 160, 120, 200.0


@pytest.fixture(scope="module")
def puffs(tmp_path_factory):
    """A set of puffs of noise."""
    folder = write_noise_set(tmp_path_factory.mktemp("set"), lossless=True)
    return explosion_views(folder)


@pytest.fixture(scope="module")
def photographs(tmp_path_factory):
    """Two frames of a square, a fifth and wholly opaque, from the south, of 15 kg."""
    folder = tmp_path_factory.mktemp("photographs")
    for number, share in enumerate((0.2, 1.0)):
        image = np.full((41, 41, 4), [0.5, 0.25, 0.0, share])
        write_png(folder / f"{number}.png", image)
    (folder / "views.toml").write_text(
        "frames_hz = 10.0\nmetres_per_pixel = 0.1\ncharge_mass_kg = 15.0\n"
        '[[view]]\nframes = "."\nazimuth_deg = 180.0\n'
    )
    return explosion_views(folder)


def camera(place=(0.0, -40.0, 2.0), aim=(0.0, 0.0, 3.0), focal=FOCAL, **changed):
    place = np.asarray(place, float)
    entries: dict[str, Any] = {
        "position": place,
        "quaternion": look_at(place, np.asarray(aim, float)),
        "focal": np.array([focal, focal]),
        "center": np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2]),
        "width": WIDTH,
        "height": HEIGHT,
    }
    return Camera(**entries | changed)


def scene_of(mass=15.0, place=(0.0, 0.0, 0.5), **changed):
    return Scene(Charge(mass_kg=mass, position_m=place, **changed), air=Air())


@eqx.filter_jit
def _layer(views, scene, eye, time, depth):
    return render(scene, eye, time[None], views=views, alpha=True, depth=depth)[0]


def layer(views, scene, eye, time, depth: ArrayLike = np.inf):
    """Return red, green, blue and straight alpha; one program serves all times."""
    depth = jnp.broadcast_to(jnp.asarray(depth, float), (HEIGHT, WIDTH))
    return np.asarray(_layer(views, scene, eye, jnp.asarray(time, float), depth))


@pytest.mark.slow
@pytest.mark.parametrize("mass", [1000.0])
def test_the_visible_radius_is_that_of_the_law_between_frames_too(puffs, mass):
    """Within 5 %: the silhouette is of pixels, and of two mixed pictures."""
    life = float(fireball_duration(mass))
    phases, off = np.asarray(PHASES), []
    for phase in (*phases[1:5], *np.sqrt(phases[:5] * phases[1:6])):
        radius = float(fireball(mass, phase * life).radius)
        far = 20.0 * radius
        eye = camera((0.6 * far, -0.8 * far, 0.1 * far), (0, 0, 0.0), focal=600.0)
        alpha = layer(puffs, scene_of(mass), eye, phase * life)[..., 3]
        distance = np.linalg.norm(np.asarray(eye.position))
        seen = visible_radius(alpha) * distance / 600.0 * np.cos(np.arcsin(0.05))
        off.append(seen / radius - 1.0)
    assert np.abs(off).max() < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("heat", [255, 127])
def test_texels_shine_as_the_law_has_it(puffs, heat):
    """A texel of full heat and opacity has the light of the law's temperature."""
    time, white, scene = 0.02, 3e4, scene_of()
    texels = jnp.zeros_like(puffs.frames).at[..., 20:50, 20:50, 0].set(heat)
    texels = texels.at[..., 20:50, 20:50, 4].set(255)
    hot = eqx.tree_at(lambda v: v.frames, puffs, texels)
    seen = layer(hot, scene, camera(), time)
    ball = cloud(scene.charges[0], jnp.asarray(time), scene.air)
    warm = ball.air + heat / 255 * (ball.temperature - ball.air)
    expected = np.asarray(blackbody_light(warm)) / white
    np.testing.assert_allclose(seen[..., :3].max((0, 1)), expected, rtol=1e-6)


@pytest.mark.slow
def test_before_the_burst_there_is_nothing_and_in_the_end_it_fades(puffs):
    scene, eye = scene_of(time_s=1.0), camera()
    assert layer(puffs, scene, eye, 0.999).max() == 0.0
    last = PHASES[-1] * float(fireball_duration(15.0))
    assert float(puffs.duration(scene.charges[0])) == pytest.approx(last)
    whole, half, gone = (
        layer(puffs, scene, eye, 1.0 + part * last)[..., 3].max()
        for part in (1.0, 1.25, 1.5)
    )
    assert half == pytest.approx(0.5 * whole, rel=0.01)
    assert gone < 1e-12
    assert layer(puffs, scene_of(time_s=jnp.inf), eye, 1.0).max() == 0.0


UNKNOWN = jnp.array([15.0, 0.3, 0.4, 0.5, 0.7, -40.0, 6.0, 0.013])
"""Mass [kg], charge [m], camera [m], time [s]."""


@pytest.mark.slow
def test_gradients_are_those_of_differences(puffs):
    weights = jnp.asarray(np.random.default_rng(0).random((1, HEIGHT, WIDTH, 3)))
    still = camera(focal=400.0)

    @jax.jit
    def light(z):
        scene = scene_of(z[0], (z[1], z[2], z[3]))
        eye = eqx.tree_at(lambda c: c.position, still, z[4:7])
        return jnp.sum(weights * render(scene, eye, z[7:], views=puffs))

    gradient = np.asarray(jax.jit(jax.grad(light))(UNKNOWN))
    steps = 1e-7 * np.maximum(1.0, np.abs(UNKNOWN))
    steps[7] = 1e-9
    for k, step in enumerate(steps):
        move = jnp.zeros(8).at[k].set(step)
        slope = float((light(UNKNOWN + move) - light(UNKNOWN - move)) / (2 * step))
        assert gradient[k] == pytest.approx(slope, rel=1e-4), k


@pytest.mark.parametrize("pitch", [0.3, 1.0, 1.5, 2.0, 3.3, 8.0])
def test_a_point_is_spread_to_the_variance_of_a_tent(pitch):
    point = jnp.zeros((65, 65, 1)).at[32, 32, 0].set(1.0)
    spread = np.asarray(low_passed(point, jnp.asarray(pitch)))[..., 0]
    assert spread.sum() == pytest.approx(1.0)
    x, expected = np.arange(65) - 32.0, max(pitch**2 - 1.0, 0.0) / 6.0
    for axis in (0, 1):
        along = spread.sum(axis)
        assert along @ x == pytest.approx(0.0, abs=1e-5)
        assert along @ x**2 == pytest.approx(expected, abs=1e-4)


def extent(alpha):
    """Return rows and columns of the visible part."""
    rows, columns = (np.flatnonzero(alpha.max(axis) > 0.5) for axis in (1, 0))
    return (rows[0], rows[-1]), (columns[0], columns[-1])


@pytest.mark.slow
def test_a_photograph_has_its_own_size_light_and_place(photographs):
    eye, scene = camera(), scene_of(place=(3.0, 0.0, 4.0))
    seen = layer(photographs, scene, eye, 0.1)
    pixel = np.asarray(project(eye, np.array([3.0, 0.0, 4.0])).pixel)
    middle = seen[tuple(pixel[::-1].round().astype(int))]
    # 8 bits of sRGB: at most a step and a half
    np.testing.assert_allclose(middle, [0.5, 0.25, 0.0, 1.0], atol=5e-3)
    half = 2.05 * FOCAL / 40.0
    found = extent(seen[..., 3])
    for at, (first, last) in zip(pixel[::-1], found, strict=True):
        np.testing.assert_allclose([first, last], [at - half, at + half], atol=1.5)


@pytest.mark.slow
@pytest.mark.parametrize("burst", [(0.0, -40.0, 2.0)])
def test_behind_and_at_the_camera_nothing_is_shown_and_all_is_finite(
    photographs, burst
):
    def light(place):
        scene = Scene(Charge(mass_kg=15.0, position_m=tuple(place)))
        return jnp.sum(render(scene, camera(), jnp.array([0.1]), views=photographs))

    value, slope = jax.jit(jax.value_and_grad(light))(jnp.asarray(burst))
    assert float(value) == pytest.approx(0.18 * HEIGHT * WIDTH * 3, rel=1e-9)
    np.testing.assert_array_equal(slope, 0.0)
