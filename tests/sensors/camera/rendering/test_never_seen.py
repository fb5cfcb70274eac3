"""A charge whose time is infinite is never seen, and hides nothing."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference.tuning.pixel_light import pixel_light
from jblast.scene import Charge, Scene
from jblast.sensors.camera.rendering import in_view
from jblast.sensors.camera.scene_events import events
from tests.sensors.camera.fireball_scenes import small_camera

CAMERA = small_camera()
REAL = Charge(mass_kg=100.0, position_m=(0.0, 0.0, 2.0), time_s=0.01, name="real")
OTHER = Charge(mass_kg=60.0, position_m=(0.0, -20.0, 3.0), time_s=0.005, name="other")
NEVER = dataclasses.replace(OTHER, time_s=jnp.inf)
ALONE = Scene(dataclasses.replace(REAL, name=""))
TIMES = jnp.linspace(0.0, 0.03, 4)


@jax.jit
def events_of(time):
    scene = Scene(charges=(REAL, dataclasses.replace(OTHER, time_s=time)))
    return events(scene, CAMERA, TIMES, capacity=4096)


@pytest.mark.slow
def test_its_events_are_those_of_the_scene_without_it():
    found, both = events_of(jnp.inf), events_of(OTHER.time_s)
    expected = events(ALONE, CAMERA, TIMES, capacity=4096)
    assert int(expected.count) > 100
    assert int(both.count) != int(expected.count)
    for here, there in zip(*map(jax.tree.leaves, (found, expected)), strict=True):
        np.testing.assert_allclose(here, there, rtol=1e-12)


@pytest.mark.slow
def test_gradients_are_those_without_it_and_none_is_its_own():
    def light(*charges):
        scene = Scene(charges=charges)
        at = jnp.array([0.012, 0.025])
        return jnp.sum(
            pixel_light(scene, CAMERA)(at, jnp.full(2, 11.0), jnp.full(2, 8.0))
        )

    of_real, of_never = jax.jit(jax.grad(light, (0, 1)))(REAL, NEVER)
    expected = jax.jit(jax.grad(light))(REAL)
    for here, there in zip(*map(jax.tree.leaves, (of_real, expected)), strict=True):
        np.testing.assert_allclose(here, there, rtol=1e-9)
    assert [float(x) for x in jax.tree.leaves(of_never)] == [0.0] * 5
    assert abs(float(expected.mass_kg)) > 1e-6


@pytest.mark.parametrize(("charge", "seen"), [(REAL, True), (NEVER, False)])
def test_it_is_not_in_view(charge, seen):
    assert bool(in_view(Scene(charge), CAMERA)) is seen
