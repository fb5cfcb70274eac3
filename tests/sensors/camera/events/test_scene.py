from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Camera, Charge, Scene
from jblast.scene.camera import look_at
from jblast.sensors.camera import (
    LUMINANCE,
    NoiseModel,
    events,
    ideal_events,
    log_intensity,
    render,
)

TIMES = jnp.linspace(0.0, 11e-3, 12)
SCENE = Scene(charge=Charge(mass_kg=100.0, position_m=(0.0, 0.0, 1.5), time_s=2.3e-3))
ROOM = 1024


@pytest.fixture(scope="module")
def camera():
    place = jnp.array([0.0, -80.0, 3.0])
    return Camera(
        position=place,
        quaternion=look_at(place, jnp.array([0.0, 0.0, 4.0])),
        focal=jnp.array([40.0, 40.0]),
        center=jnp.array([4.5, 3.5]),
        width=10,
        height=8,
        exposure_s=1e-3,  # of frames; events have none
    )


def with_mass(mass):
    return replace(SCENE, charge=replace(SCENE.charge, mass_kg=mass))


def test_events_are_those_of_the_frames_at_instants(camera):
    found = events(SCENE, camera, TIMES, capacity=ROOM)
    instant = replace(camera, exposure_s=jnp.zeros(()))
    light = log_intensity(render(SCENE, instant, TIMES) @ jnp.array(LUMINANCE))
    expected = ideal_events(light, TIMES, (0.2, 0.2), capacity=ROOM)
    assert int(found.count) > 100
    for one, other in zip(*map(jax.tree.leaves, (found, expected)), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)


def test_what_has_no_room_is_counted(camera):
    whole = events(SCENE, camera, TIMES, capacity=ROOM)
    few = events(SCENE, camera, TIMES, capacity=50)
    assert int(whole.lost) == 0
    assert int(few.count) == 50
    assert int(few.count) + int(few.lost) == int(whole.count)


@pytest.mark.slow
def test_a_batch_of_charges_is_its_own_loop_and_has_derivatives(camera):
    def late(mass):
        found = events(with_mass(mass), camera, TIMES, capacity=ROOM)
        when = jnp.where(jnp.isfinite(found.time), found.time, 0.0)
        return jnp.sum(when), found.count

    masses = jnp.array([60.0, 100.0])
    slopes, counts = jax.jit(jax.vmap(jax.grad(late, has_aux=True)))(masses)
    assert int(counts[1]) == int(late(masses[1])[1])
    step = 1e-5
    above, below = late(masses[1] + step), late(masses[1] - step)
    assert int(above[1]) == int(below[1])
    numeric = (above[0] - below[0]) / (2 * step)
    np.testing.assert_allclose(slopes[1], numeric, rtol=1e-5)  # step's own error


@pytest.mark.slow
def test_imperfections_draw_from_the_key(camera):
    flawed = NoiseModel()
    one, same, other = (
        events(
            SCENE,
            camera,
            TIMES,
            capacity=ROOM,
            noise=flawed,
            key=jax.random.key(seed),
        )
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one.time, same.time)
    assert not np.array_equal(one.time, other.time)
