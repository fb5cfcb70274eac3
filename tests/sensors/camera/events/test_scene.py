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


def test_events_are_those_of_the_frames_at_instants(camera):
    found = events(SCENE, camera, TIMES, capacity=ROOM)
    instant = replace(camera, exposure_s=jnp.zeros(()))
    light = log_intensity(render(SCENE, instant, TIMES) @ jnp.array(LUMINANCE))
    expected = ideal_events(light, TIMES, (0.2, 0.2), capacity=ROOM)
    assert int(found.count) > 100
    for one, other in zip(*map(jax.tree.leaves, (found, expected)), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)


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
