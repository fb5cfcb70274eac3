"""Explosion sets as cameras see them: size, light, place and time by the laws."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Air, Camera, Charge, Scene, look_at
from jblast.sensors.camera.baked_explosion import low_passed
from jblast.sensors.camera.files.views import explosion_views
from jblast.sensors.camera.fireball import Appearance, cloud
from jblast.sensors.camera.geometry import pixel_rays
from jblast.sensors.camera.image import blackbody_light
from jblast.sensors.camera.rendering import in_view, render
from jblast.waves.fireball import fireball, fireball_duration
from tests.sensors.camera.rendering.baked.noise_set import (
    PHASES,
    visible_radius,
    write_noise_set,
)


@pytest.fixture(scope="module")
def puffs(tmp_path_factory):
    """A set of puffs of noise."""
    folder = write_noise_set(tmp_path_factory.mktemp("set"), lossless=True)
    return explosion_views(folder)


WIDTH, HEIGHT, FOCAL = 160, 120, 200.0


def camera(place=(0.0, -40.0, 2.0), aim=(0.0, 0.0, 3.0), focal=FOCAL, **changed):
    place = np.asarray(place, float)
    entries = {
        "position": place,
        "quaternion": look_at(place, np.asarray(aim, float)),
        "focal": np.array([focal, focal]),
        "center": np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2]),
        "width": WIDTH,
        "height": HEIGHT,
    }
    return Camera(**entries | changed)


def scene_of(mass=15.0, place=(0.0, 0.0, 0.5), **changed):
    charge = Charge(mass_kg=mass, position_m=place, **changed)
    return Scene(charge, air=Air())


@eqx.filter_jit
def _layer(views, scene, eye, time):
    rays = pixel_rays(eye, ground=False)
    return jnp.moveaxis(views.seen(scene, rays, time, Appearance()), 0, -1)


def layer(views, scene, eye, time):
    """Of any time by one program: as a float it would be a constant of its own."""
    return _layer(views, scene, eye, jnp.asarray(time, float))


@pytest.mark.parametrize("mass", [0.1, 15.0, 1000.0])
def test_the_visible_radius_is_that_of_the_law_between_frames_too(puffs, mass):
    """Within 5 %: the silhouette is of pixels, and of two mixed pictures."""
    life = float(fireball_duration(mass))
    phases = np.asarray(PHASES)
    off = []
    for phase in (*phases[1:5], *np.sqrt(phases[:5] * phases[1:6])):
        radius = float(fireball(mass, phase * life).radius)
        far = 20.0 * radius
        eye = camera((0.6 * far, -0.8 * far, 0.1 * far), (0, 0, 0.0), focal=600.0)
        alpha = np.asarray(layer(puffs, scene_of(mass), eye, phase * life))[..., 3]
        distance = np.linalg.norm(np.asarray(eye.position))
        seen = visible_radius(alpha) * distance / 600.0 * np.cos(np.arcsin(0.05))
        off.append(seen / radius - 1.0)
    assert np.abs(off).max() < 0.05


@pytest.mark.slow
def test_the_hottest_texels_shine_as_the_law_has_it(puffs):
    """A texel of full heat and opacity has the light of the law's temperature."""
    time, white = 0.02, 3e4
    scene = scene_of()
    texels = jnp.zeros_like(puffs.frames).at[..., 20:50, 20:50, 0].set(255)
    texels = texels.at[..., 20:50, 20:50, 4].set(255)
    hot = eqx.tree_at(lambda v: v.frames, puffs, texels)
    seen = np.asarray(layer(hot, scene, camera(), time))
    ball = cloud(scene, scene.charge, jnp.asarray(time))
    expected = np.asarray(blackbody_light(ball.temperature)) / white
    np.testing.assert_allclose(seen[..., :3].max((0, 1)), expected, rtol=1e-6)
    cooler = eqx.tree_at(
        lambda v: v.frames, hot, texels.at[..., 0].set(texels[..., 0] // 2)
    )
    seen = np.asarray(layer(cooler, scene, camera(), time))
    warm = ball.air + 127 / 255 * (ball.temperature - ball.air)
    expected = np.asarray(blackbody_light(warm)) / white
    np.testing.assert_allclose(seen[..., :3].max((0, 1)), expected, rtol=1e-6)


def test_before_the_burst_there_is_nothing_and_in_the_end_it_fades(puffs):
    scene, eye = scene_of(time_s=1.0), camera()
    assert float(jnp.max(layer(puffs, scene, eye, 0.999))) == 0.0
    life = float(fireball_duration(15.0))
    last = PHASES[-1] * life
    assert float(puffs.duration(scene.charge)) == pytest.approx(last)
    whole, half, gone = (
        np.asarray(layer(puffs, scene, eye, 1.0 + part * last))[..., 3]
        for part in (1.0, 1.25, 1.5)
    )
    assert half.max() == pytest.approx(0.5 * whole.max(), rel=0.01)
    assert gone.max() < 1e-12
    never = scene_of(time_s=jnp.inf)
    assert float(jnp.max(layer(puffs, never, eye, 1.0))) == 0.0


def test_a_small_picture_keeps_its_light_wherever_pixels_fall(puffs):
    """Of a radius of two pixels; what the low pass spreads past its edge is lost."""
    sums = []
    for shift in np.linspace(0.0, 1.0, 7):
        eye = camera(place=(0.0, -450.0, 2.0), focal=FOCAL)
        eye = replace(eye, center=eye.center + shift * jnp.array([1.0, 0.7]))
        sums.append(float(jnp.sum(layer(puffs, scene_of(), eye, 0.1)[..., 3])))
    assert np.ptp(sums) / np.mean(sums) < 0.1
    near = float(jnp.sum(layer(puffs, scene_of(), camera(focal=400.0), 0.1)[..., 3]))
    ratio = (450.0 / 40.0 * 400.0 / FOCAL) ** 2
    assert np.mean(sums) * ratio == pytest.approx(near, rel=0.05)


@pytest.mark.slow
def test_the_foot_stays_and_the_middle_goes_with_the_wind(puffs):
    time = 0.6
    windy = replace(scene_of(), air=Air(wind_east=jnp.asarray(10.0)))
    still, blown = (
        np.asarray(layer(puffs, scene, camera(), time))[..., 3]
        for scene in (scene_of(), windy)
    )
    drift = cloud(windy, windy.charge, jnp.asarray(time)).centre[0]

    def middle(alpha):
        return (alpha.sum(0) @ np.arange(WIDTH)) / alpha.sum()

    moved = (middle(blown) - middle(still)) * 40.0 / FOCAL
    assert moved == pytest.approx(float(drift), rel=0.15)
    foot = np.flatnonzero(still.sum(1) > 1.0)[-1]
    assert middle(blown[[foot]]) == pytest.approx(middle(still[[foot]]), abs=1.0)


def test_in_view_knows_where_pictures_are(puffs):
    scene = scene_of()
    assert bool(in_view(scene, camera(), puffs))
    assert not bool(in_view(scene, camera(aim=(0.0, -80.0, 2.0)), puffs))
    assert not bool(in_view(scene, camera(aim=(40.0, 0.0, 2.0)), puffs))
    far = camera(place=(0.0, -5000.0, 2.0), aim=(0.0, 0.0, 2.0))
    assert bool(in_view(scene, far, puffs))  # smaller than a pixel


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
        seen = render(scene, eye, z[7:], views=puffs, ground=False)
        return jnp.sum(weights * seen)

    gradient = np.asarray(jax.jit(jax.grad(light))(UNKNOWN))
    both = jax.vmap(light)(jnp.stack([UNKNOWN, 1.01 * UNKNOWN]))
    np.testing.assert_allclose(both[1], light(1.01 * UNKNOWN), rtol=1e-9)
    steps = 1e-7 * np.maximum(1.0, np.abs(UNKNOWN))
    steps[7] = 1e-9
    for k, step in enumerate(steps):
        move = jnp.zeros(8).at[k].set(step)
        slope = float((light(UNKNOWN + move) - light(UNKNOWN - move)) / (2 * step))
        assert gradient[k] == pytest.approx(slope, rel=1e-4), k


@pytest.mark.parametrize("pitch", [0.3, 1.0, 1.5, 2.0, 3.3, 8.0])
def test_a_point_is_spread_to_the_variance_of_a_tent(pitch):
    size = 65
    point = jnp.zeros((size, size, 1)).at[32, 32, 0].set(1.0)
    spread = np.asarray(low_passed(point, jnp.asarray(pitch)))[..., 0]
    assert spread.sum() == pytest.approx(1.0)
    x = np.arange(size) - 32.0
    for axis in (0, 1):
        along = spread.sum(axis)
        assert along @ x == pytest.approx(0.0, abs=1e-5)
        expected = max(pitch**2 - 1.0, 0.0) / 6.0
        assert along @ x**2 == pytest.approx(expected, abs=1e-4)
