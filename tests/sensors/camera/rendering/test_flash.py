"""The fire lights the ground and walls, by the laws of light."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Charge, Scene
from jblast.sensors.camera.events.scene import events, render_events
from jblast.sensors.camera.fireball import Appearance, cloud, fireball_layer, glow
from jblast.sensors.camera.geometry import pixel_rays, surfaces_seen
from jblast.sensors.camera.rendering import render
from jblast.sensors.camera.surroundings import disc_light, flash
from tests.sensors.camera.fireball_scenes import one_charge, small_camera

TIMES = np.array([0.0, 0.004, 0.02])
DARK = Appearance(flash=False)
PLATE = 0.18


@pytest.fixture(scope="module")
def scene():
    return one_charge(up=4.0)


@pytest.fixture(scope="module")
def frames(scene):
    return np.asarray(render(scene, small_camera(), TIMES))


def gained(frames, colour=0):
    return frames[..., colour] / PLATE - 1.0


def test_light_falls_on_the_ground_as_one_over_the_square_and_by_the_cosine(
    scene, frames
):
    surfaces = surfaces_seen(pixel_rays(small_camera()), image=False)
    ball = cloud(scene, scene.charge, jnp.asarray(TIMES[1]))
    up = float(ball.centre[2])
    assert float(ball.radius) > up  # it is cut by the ground: only far away it is not
    offset = np.asarray(surfaces.place) - np.array([[[0.0]], [[0.0]], [[up]]])
    far = np.sqrt(np.sum(offset**2, axis=0))
    look = Appearance()
    light = disc_light(ball, glow(ball.temperature, ball.air, look), look)
    # seen from above, a ball half in the ground gives at most what a whole one does
    most = float(light[0] / look.white) * (float(ball.radius) / far) ** 2
    solid = np.asarray(surfaces.solid)
    found = np.where(solid, np.asarray(gained(frames[1])), 0.0)
    clear = solid & (np.asarray(alpha(scene, TIMES[1])) == 0.0)
    assert clear.sum() > 50
    assert (found[clear] > 0.0).all()
    assert (found[clear] < most[clear]).all()


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


@pytest.mark.slow
def test_the_first_event_frame_is_a_flash_and_not_only_a_ball(scene):
    camera, clock = small_camera(), np.linspace(0.0, 5e-3, 11)
    lit = np.asarray(render(scene, camera, clock))
    ball = np.max([np.asarray(alpha(scene, t)) for t in clock], axis=0) > 0.0
    fired = events(scene, camera, clock, capacity=1 << 16)
    count = int(fired.count)
    where = np.zeros((18, 24), bool)
    where[np.asarray(fired.y)[:count], np.asarray(fired.x)[:count]] = True
    assert (where & ~ball).sum() > 20
    dark = events(scene, camera, clock, capacity=1 << 16, appearance=DARK)
    only = int(dark.count)
    inside = ball[np.asarray(dark.y)[:only], np.asarray(dark.x)[:only]]
    assert inside.all()
    outside = where & ~ball
    most = np.log(lit[..., 0] / PLATE).max(axis=0)
    assert most[outside].min() > 0.15  # of red; a threshold of luminance is 0.2


def test_the_sky_is_not_lit_and_nothing_is_before_detonation(scene, frames):
    sky = ~np.isfinite(np.asarray(pixel_rays(small_camera()).farthest))
    clear = sky & (np.asarray(alpha(scene, TIMES[2])) == 0.0)
    np.testing.assert_array_equal(frames[2][clear], PLATE)
    np.testing.assert_array_equal(frames[0], PLATE)


def test_it_can_be_left_out(scene, frames):
    dark = np.asarray(render(scene, small_camera(), TIMES, appearance=DARK))
    clear = np.asarray(alpha(scene, TIMES[1])) == 0.0
    np.testing.assert_array_equal(dark[1][clear], PLATE)
    assert (frames[1] >= dark[1]).all()


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


@pytest.mark.slow
def test_exact_events_are_those_of_the_lit_frames(scene):
    camera = dataclasses.replace(small_camera(), threshold=jnp.array([0.2, 0.2]))
    clock = np.linspace(0.0, 5e-3, 161)
    solved = render_events(scene, camera, np.linspace(0.0, 5e-3, 11))
    framed = events(scene, camera, clock, capacity=1 << 16)
    count = int(framed.count)
    assert int(solved.count) == count
    for name in ("x", "y", "polarity"):
        ours, theirs = (
            np.bincount(np.asarray(getattr(e, name))[:count] + 1)
            for e in (solved, framed)
        )
        np.testing.assert_array_equal(ours, theirs)
    order = [
        np.lexsort([np.asarray(v)[:count] for v in (e.time, e.polarity, e.x, e.y)])
        for e in (solved, framed)
    ]
    late = np.asarray(framed.time)[:count][order[1]] - np.asarray(solved.time)[order[0]]
    # a thirtieth of a millisecond apart, linear between
    assert np.abs(late).max() < 3.2e-5
    assert np.median(np.abs(late)) < 3e-6


@pytest.mark.slow
def test_slopes_of_the_light_on_the_ground_are_those_of_differences():
    numbers = jnp.array([100.0, 1.0, -2.0, 2.0, 1e-3])
    times = jnp.array([0.006, 0.2])
    weights = np.random.default_rng(3).random((2, 18, 24, 3))

    @eqx.filter_jit
    def total(values):
        charge = Charge(
            mass_kg=values[0],
            position_m=(values[1], values[2], values[3]),
            time_s=values[4],
        )
        frames = render(Scene(charge=charge), small_camera(), times)
        return jnp.sum(weights * frames)

    slope = np.asarray(jax.grad(total)(numbers))
    for n, step in enumerate((1e-4, 1e-5, 1e-5, 1e-5, 1e-8)):
        ends = [float(total(numbers.at[n].add(side * step))) for side in (-1, 1)]
        assert slope[n] == pytest.approx(np.diff(ends)[0] / (2 * step), rel=1e-4)
