"""Light that is no number is refused, or seen in the times: it is not darkness."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.sensors.camera.events.exact import frameless_events
from jblast.sensors.camera.events.ideal import ideal_events
from jblast.sensors.camera.events.scene import render_events
from jblast.sensors.camera.events.stream import stream_events
from tests.sensors.camera.fireball_scenes import one_charge, small_camera

TIMES = np.arange(3.0)
STEPS = (0.2, 0.2)


def frames(value):
    light = np.full((3, 2, 4), 0.5)
    light[2, 1, 1] = 1.0
    light[1:, 0, 3] = value
    return light


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_film_with_a_pixel_that_is_no_number_is_refused(value):
    where = f"got {value} in frame 1, row 0, column 3"
    with pytest.raises(InputError, match=where):
        ideal_events(jnp.asarray(frames(value)), jnp.asarray(TIMES), STEPS, capacity=9)
    blocks = [(TIMES, frames(0.5)), (TIMES + 3.0, frames(value))]
    with pytest.raises(InputError, match=where.replace("frame 1", "frame 4")):
        list(stream_events(blocks, STEPS, workers=1))


def test_inside_jit_no_event_has_a_time():
    @jax.jit
    def times(light):
        return ideal_events(light, jnp.asarray(TIMES), STEPS, capacity=9).time

    assert jnp.isnan(times(jnp.asarray(frames(np.nan)))).all()
    known = times(jnp.asarray(frames(0.5)))
    assert known[0] > 1.0
    assert not jnp.isnan(known).any()


def test_light_as_a_function_is_refused_where_it_is_no_number():
    def light(time, x, y):
        return jnp.where((x == 1) & (time > 0.5), jnp.nan, time)

    with pytest.raises(InputError, match="got nan at row 0, column 1, 1 s"):
        frameless_events(light, (1, 2), TIMES, STEPS)


def test_a_charge_without_a_mass_is_no_dark_scene():
    scene = one_charge(mass=50.0)
    broken = dataclasses.replace(
        scene, charges=(dataclasses.replace(scene.charge, mass_kg=np.nan),)
    )
    with pytest.raises(InputError, match="expected the logarithm of light"):
        render_events(broken, small_camera(), np.array([0.0, 0.01]))
