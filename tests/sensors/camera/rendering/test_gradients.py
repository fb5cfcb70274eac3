"""Gradients of pixels against central differences, float64."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from jblast.scene import Charge, Scene
from jblast.sensors.camera.rendering import render
from tests.sensors.camera.fireball_scenes import small_camera

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


def test_gradients_are_those_of_central_differences():
    gradient = np.asarray(gradient_of(UNKNOWN))
    expected = central_differences(jax.jit(weighted), UNKNOWN)
    assert (np.abs(expected) > 1e-3).all()  # each unknown matters
    np.testing.assert_allclose(gradient, expected, rtol=1e-4)


def test_before_the_burst_gradients_are_zero_and_finite():
    late = UNKNOWN.at[4].set(9.0)
    gradient = gradient_of(late)
    np.testing.assert_array_equal(gradient, 0.0)
