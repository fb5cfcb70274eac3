"""Pictures of a fireball: columns, limbs, hidden parts, light, gradients."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from jblast.scene import Air, Charge, Scene
from jblast.sensors.camera.fireball import cloud, passage
from jblast.sensors.camera.geometry import Rays, Surfaces, pixel_rays
from jblast.sensors.camera.rendering import render
from jblast.sensors.camera.surroundings import sphere_factor
from jblast.waves.fireballs import fireball
from tests.sensors.camera.fireball_scenes import EYE, LUMPS, one_charge, small_camera

WHEN = 0.3


def layer_of(scene, camera, time=WHEN, **options):
    """Return red, green, blue and alpha, by the programs that `render` keeps."""
    return render(scene, camera, jnp.asarray([time]), alpha=True, **options)[0]


def premultiplied(layer):
    return layer.at[..., :3].multiply(layer[..., 3:])


def alpha_of(scene, camera, time=WHEN, **options):
    return np.asarray(layer_of(scene, camera, time, **options)[..., 3])


def ball_at(scene, time=WHEN):
    ball = fireball(
        scene.charge.mass_kg, time - scene.charge.time_s, scene.air.temperature
    )
    return float(ball.radius), float(scene.charge.up + ball.rise)


@pytest.mark.parametrize("ahead", [30.0, 3.0, -3.0, -30.0])
@pytest.mark.parametrize("farthest", [np.inf, 31.0, 2.0])
def test_the_column_is_the_integral_of_the_density(ahead, farthest):
    # ahead: of the camera, in the cloud before or behind its centre, and behind
    rng = np.random.default_rng(5)
    radius, offset = 7.0, np.array([ahead, 2.0, -1.0])
    units = np.stack([np.ones(8), *rng.normal(0, 0.15, (2, 8))])
    units = units / np.linalg.norm(units, axis=0)
    rays = Rays(jnp.zeros(3), jnp.asarray(units[:, None]), jnp.full((1, 8), farthest))
    found = passage(jnp.asarray(offset), jnp.asarray(radius), rays)
    for k, unit in enumerate(units.T):

        def density(s, unit=unit):
            place = s * unit - offset
            return max(0.0, 1.0 - place @ place / radius**2)

        end = min(farthest, 60.0)
        # along a diameter the integral is 4/3 of the radius
        whole, _ = quad(density, 0.0, end, limit=200, points=[min(25.0, end / 2)])
        assert found.column[0, k] == pytest.approx(whole / (4 / 3 * radius), abs=1e-7)


def test_the_limb_is_where_the_projected_sphere_ends():
    scene, camera = one_charge(up=20.0), small_camera(target=[0.0, 0.0, 20.0])
    radius, up = ball_at(scene)
    unit = np.moveaxis(np.asarray(pixel_rays(camera).direction), 0, -1)
    sight = np.array([0.0, 0.0, up]) - EYE
    along = unit @ sight
    apart = np.sqrt(sight @ sight - along**2)
    alpha = alpha_of(scene, camera)
    np.testing.assert_array_equal(alpha > 0, apart < radius)
    half = np.sqrt(np.clip(1 - (apart / radius) ** 2, 0, None))
    # N lumps along a diameter; thousands of optical depths of soot make all dark
    np.testing.assert_allclose(alpha, -np.expm1(-LUMPS * half**3), atol=1e-6)


def test_what_stands_before_the_fireball_hides_it():
    scene, camera = one_charge(), small_camera()
    free = alpha_of(scene, camera)
    assert free.max() > 0.99
    near = jnp.full((18, 24), 10.0)
    assert (alpha_of(scene, camera, depth=near) == 0).all()
    half = near.at[:, 12:].set(jnp.inf)
    seen = alpha_of(scene, camera, depth=half)
    np.testing.assert_array_equal(seen[:, 12:], free[:, 12:])
    assert (seen[:, :12] == 0).all()
    assert free[:, :12].max() > 0.5
    # a wall behind it changes nothing
    wall = alpha_of(scene, camera, depth=jnp.full((18, 24), 200.0))
    np.testing.assert_array_equal(wall, free)


def test_the_ground_hides_what_is_below_it():
    scene, camera = one_charge(up=0.0), small_camera()
    cut, whole = (alpha_of(scene, camera, ground=ground) for ground in (True, False))
    rays = pixel_rays(camera)
    hits = np.asarray(rays.farthest)
    np.testing.assert_array_equal(cut[hits == np.inf], whole[hits == np.inf])
    assert (cut <= whole + 1e-15).all()
    # rays that meet the ground before the sphere begins see it
    radius, _ = ball_at(scene)
    ends = hits[..., None] * np.moveaxis(np.asarray(rays.direction), 0, -1) + EYE
    early = (hits < np.inf) & (ends[..., 1] < -radius)
    assert (cut[early] == 0).all()
    assert (whole[early] > 0.9).any()


@pytest.mark.slow
def test_the_nearer_of_two_charges_hides_the_farther():
    near = Charge(mass_kg=30.0, position_m=(0.0, -10.0, 3.0))
    far = Charge(mass_kg=200.0, position_m=(0.0, 20.0, 3.0), time_s=0.25)
    camera = small_camera()
    one, two = (layer_of(Scene(charge), camera) for charge in (near, far))
    front, back = premultiplied(one), premultiplied(two)
    over = front + (1.0 - one[..., 3:]) * back
    for first, second in ((near, far), (far, near)):
        both = layer_of(Scene(charges=(first, second)), camera)
        np.testing.assert_allclose(premultiplied(both), over, atol=1e-12)
    assert ((one[..., 3] > 0.1) & (two[..., 3] > 0.1)).any()


def test_the_wind_carries_the_cloud_across_the_picture():
    still, camera = one_charge(), small_camera()
    blown = dataclasses.replace(
        still, air=Air(wind_east=jnp.asarray(12.0), wind_north=jnp.asarray(-3.0))
    )
    time = 1.2
    way = float(fireball(100.0, time).drift_time) * np.array([12.0, -3.0, 0.0])
    assert way[0] > 3.0
    ends = [
        cloud(s.charges[0], jnp.asarray(time), s.air, s.fireball_growth).centre
        for s in (still, blown)
    ]
    np.testing.assert_allclose(ends[1] - ends[0], way, rtol=1e-12)
    # a camera that goes with it sees the same
    goes = dataclasses.replace(camera, position=camera.position + way)
    np.testing.assert_allclose(
        layer_of(blown, goes, time), layer_of(still, camera, time), rtol=1e-9
    )


CAMERA = small_camera()
TIMES = jnp.array([0.012, 0.02, 0.3, 0.45])
UNKNOWN = jnp.concatenate(
    [jnp.array([0.5, 1.0, 2.0, 100.0, 0.01]), CAMERA.position, CAMERA.quaternion]
)
"""Charge east, north, up [m], mass [kg], start [s]; camera place [m], quaternion."""
WEIGHTS = np.random.default_rng(7).normal(size=(4, 18, 24, 3))


def frames(unknown, **options):
    east, north, up, mass, start = unknown[:5]
    charge = Charge(mass_kg=mass, position_m=(east, north, up), time_s=start)
    camera = dataclasses.replace(CAMERA, position=unknown[5:8], quaternion=unknown[8:])
    return render(Scene(charge), camera, TIMES, **options)


def weighted(unknown):
    return jnp.sum(jnp.asarray(WEIGHTS) * frames(unknown))


def central_differences(function, at, step=3e-8):
    """Return differences of fourth order.

    The step is short: at the limb of a bright fireball a pixel is of another colour
    within a microsecond.
    """

    def difference(k, h):
        move = jnp.zeros(len(at)).at[k].set(h)
        return (function(at + move) - function(at - move)) / (2 * h)

    steps = step * np.maximum(1.0, np.abs(at))
    found = [
        (4 * difference(k, h) - difference(k, 2 * h)) / 3 for k, h in enumerate(steps)
    ]
    return np.array(found)


gradient_of = jax.jit(jax.grad(weighted))


@pytest.mark.slow
def test_gradients_are_those_of_central_differences():
    gradient = np.asarray(gradient_of(UNKNOWN))
    expected = central_differences(jax.jit(weighted), UNKNOWN)
    assert (np.abs(expected) > 1e-3).all()  # each unknown matters
    np.testing.assert_allclose(gradient, expected, rtol=1e-4)


@pytest.mark.slow
def test_before_the_burst_gradients_are_zero_and_finite():
    late = UNKNOWN.at[4].set(9.0)
    gradient = gradient_of(late)
    np.testing.assert_array_equal(gradient, 0.0)


@jax.jit
def factor(offset, radius=1.0, tilt=0.0):
    """Of a sphere at an offset, for a surface that leans to the east."""
    normal = jnp.stack([jnp.sin(tilt), 0.0 * tilt, jnp.cos(tilt)])
    at = Surfaces(jnp.zeros((3, 1, 1)), normal[:, None, None], jnp.ones((1, 1), bool))
    return sphere_factor(jnp.asarray(offset, float), jnp.asarray(radius), at)[0, 0]


def integral(offset, tilt):
    """Sum over 2000 x 2000 directions of the hemisphere, of equal factors."""
    parts = (np.arange(2000) + 0.5) / 2000
    square, turn = np.meshgrid(parts, 2 * np.pi * parts)
    away = np.sqrt(square)
    x, y, z = away * np.cos(turn), away * np.sin(turn), np.sqrt(1 - square)
    east = np.cos(tilt) * x + np.sin(tilt) * z
    up = -np.sin(tilt) * x + np.cos(tilt) * z
    along = offset[0] * east + offset[1] * y + offset[2] * up
    met = (along > 0) & (np.sum(np.square(offset)) - along**2 < 1.0)
    return met.mean()


@pytest.mark.parametrize(
    ("offset", "tilt"),
    [
        ((2.0, 1.0, 1.5), 0.0),
        ((1.2, 0.0, 0.3), 0.0),
        ((1.2, 0.4, -0.3), 0.0),
        ((3.0, 0.0, 0.1), 0.7),
        ((-1.5, 0.2, 0.9), 0.4),
    ],
)
def test_it_is_the_part_of_the_hemisphere_weighed_by_the_cosine(offset, tilt):
    # the edge of the sphere goes through some 6000 of 4e6 cells
    expected = integral(np.array(offset), tilt)
    assert float(factor(offset, tilt=tilt)) == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("far", [1.5, 4.0, 100.0])
def test_a_sphere_seen_whole_falls_with_the_square_and_the_cosine(far):
    angle = 0.5 * np.arccos(1.0 / far)
    offset = far * np.array([np.sin(angle), 0.0, np.cos(angle)])
    expected = np.cos(angle) / far**2
    assert float(factor(offset)) == pytest.approx(expected, rel=1e-12)


def test_on_its_surface_and_within_it_depends_on_the_angle_alone():
    for length in (1.0, 0.5, 1e-3):
        for cosine in (-0.8, 0.0, 0.6):
            sine = np.sqrt(1 - cosine**2)
            offset = length * np.array([sine, 0.0, cosine])
            found = float(factor(offset))
            assert found == pytest.approx(0.5 + 0.5 * cosine, abs=1e-7)


@pytest.mark.parametrize(
    "offset", [(2.0, 1.0, 1.5), (1.2, 0.0, 0.3), (1.2, 0.4, -0.3), (0.1, 0.2, 0.3)]
)
def test_slopes_are_those_of_differences(offset):
    numbers = jnp.array([*offset, 1.0])

    def of(values):
        return factor(values[:3], values[3])

    slope, step = np.asarray(jax.grad(of)(numbers)), 1e-6
    for n in range(4):
        ends = [float(of(numbers.at[n].add(side * step))) for side in (-1, 1)]
        assert slope[n] == pytest.approx(np.diff(ends)[0] / (2 * step), abs=1e-7)


def test_slopes_are_numbers_everywhere():
    places = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (2.0, 0.0, 1.0)]
    for place in [*places, (2.0, 0.0, -1.0), (0.0, 0.0, -1.0)]:
        for radius in (0.0, 1.0):
            slope = jax.grad(factor, (0, 1))(jnp.array(place), radius)
            assert np.isfinite(np.concatenate([slope[0], slope[1][None]])).all()
