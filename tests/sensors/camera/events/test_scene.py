from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from jblast.sensors.camera import (
    LUMINANCE,
    events,
    ideal_events,
    log_intensity,
    render,
)
from tests.sensors.camera.fireball_scenes import one_charge, small_camera

TIMES = jnp.linspace(0.0, 11e-3, 12)
ROOM = 1 << 13


def test_events_are_those_of_the_frames_at_instants():
    scene, instant = one_charge(up=1.5, time_s=2.3e-3), small_camera()
    exposed = replace(instant, exposure_s=1e-3)  # of frames; events have none
    found = events(scene, exposed, TIMES, capacity=ROOM)
    light = log_intensity(render(scene, instant, TIMES) @ jnp.array(LUMINANCE))
    expected = ideal_events(light, TIMES, (0.2, 0.2), capacity=ROOM)
    assert int(found.count) > 100
    for one, other in zip(*map(jax.tree.leaves, (found, expected)), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)
