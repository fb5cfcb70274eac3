"""Gradients of pixels and of event counts against central differences, float64."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Charge, Scene
from jblast.sensors.camera.events.ideal import log_intensity, smooth_counts
from jblast.sensors.camera.image import LUMINANCE
from jblast.sensors.camera.rendering import render
from tests.sensors.camera.fireball_scenes import one_charge, small_camera

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
    return render(Scene(charge=charge), camera, TIMES, **options)


def weighted(unknown):
    return jnp.sum(jnp.asarray(WEIGHTS) * frames(unknown, exposures=1))


def counted(unknown):
    grey = frames(unknown, exposures=1) @ jnp.array(LUMINANCE)
    up, down = smooth_counts(log_intensity(grey), (0.2, 0.25), 0.1, most=48)
    weights = jnp.asarray(WEIGHTS[1:, ..., 0])
    return jnp.sum(weights * up) - jnp.sum(weights[::-1] * down)


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


gradient_of = {f: jax.jit(jax.grad(f)) for f in (weighted, counted)}


@pytest.mark.parametrize(
    "function", [weighted, pytest.param(counted, marks=pytest.mark.slow)]
)
def test_gradients_are_those_of_central_differences(function):
    gradient = np.asarray(gradient_of[function](UNKNOWN))
    expected = central_differences(jax.jit(function), UNKNOWN)
    assert (np.abs(expected) > 1e-3).all()  # each unknown matters
    np.testing.assert_allclose(gradient, expected, rtol=1e-4)


@pytest.mark.slow  # a program of its own: lens, exposure and depth together
def test_gradients_go_through_exposure_lens_and_the_look():
    camera = dataclasses.replace(
        CAMERA,
        distortion=jnp.array([-0.1, 0.02, 0.001, -0.002, 0.0]),
        exposure_s=jnp.asarray(0.004),
    )
    scene = one_charge()

    def total(numbers):
        lens = dataclasses.replace(
            camera,
            focal=camera.focal * numbers[0],
            distortion=camera.distortion * numbers[1],
            exposure_s=camera.exposure_s * numbers[2],
        )
        options = {"exposures": 2, "supersample": 2, "background": 0.3 * numbers[3]}
        image = render(
            scene, lens, TIMES[:2], depth=jnp.full((18, 24), 59.0), **options
        )
        return jnp.sum(jnp.asarray(WEIGHTS[:2]) * image)

    at = jnp.ones(4)
    gradient = np.asarray(jax.jit(jax.grad(total))(at))
    expected = central_differences(jax.jit(total), at)
    # of a total of thousands, rounding leaves 1e-4 over so short a step
    np.testing.assert_allclose(gradient, expected, rtol=1e-4, atol=5e-4)


def test_before_the_burst_gradients_are_zero_and_finite():
    late = UNKNOWN.at[4].set(9.0)
    gradient = gradient_of[weighted](late)
    np.testing.assert_array_equal(gradient, 0.0)
