"""Events of frames block by block, and of a scene, are those of the ideal converter."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from calibration.cases import HEIGHT, WIDTH
from jblast.errors import InputError
from jblast.sensors.camera import LUMINANCE, events as events_of_scene, render
from jblast.sensors.camera.events.exact import frameless_events
from jblast.sensors.camera.events.ideal import grey_table, ideal_events, log_intensity
from jblast.sensors.camera.events.stream import stream_events
from tests.sensors.camera.fireball_scenes import one_charge, small_camera

convert = jax.jit(ideal_events, static_argnames="capacity")
SHAPE = (40, 12, 17)
TIMES = np.arange(SHAPE[0]) / 500.0


def flicker(dtype):
    """Frames that go up and down everywhere, black and white included."""
    rng = np.random.default_rng(3)
    walk = np.cumsum(rng.normal(0.0, 12.0, SHAPE), axis=0) + rng.uniform(
        0, 255, SHAPE[1:]
    )
    grey = np.clip(np.round(walk), 0, 255).astype(np.uint8)
    return grey if dtype == np.uint8 else (grey / 255.0).astype(dtype)


def gathered(frames, size=7, times=TIMES, thresholds=(0.2, 0.3), **options):
    cuts = range(0, len(frames), size)
    blocks = [(times[a : a + size], frames[a : a + size]) for a in cuts]
    parts = list(stream_events(blocks, thresholds, **options))
    fields = ([part.x, part.y, part.time, part.polarity] for part in parts)
    return [np.concatenate(field) for field in zip(*fields, strict=True)]


def reference(logs, times=TIMES, thresholds=(0.2, 0.3)):
    events = convert(
        jnp.asarray(logs), jnp.asarray(times), thresholds, capacity=1 << 15
    )
    assert int(events.lost) == 0
    fields = events.x, events.y, events.time, events.polarity
    return [np.asarray(field)[: int(events.count)] for field in fields]


def same(ours, theirs):
    assert len(theirs[0]) > 600
    for events in (ours, theirs):
        assert (np.diff(events[2]) >= 0.0).all()
    # the last bit of a time decides the order of events that are simultaneous but for
    # rounding: compare pixel by pixel
    ours, theirs = (
        [field[np.lexsort((events[2], events[0], events[1]))] for field in events]
        for events in (ours, theirs)
    )
    for field, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(field, other, rtol=0, atol=1e-14)


@pytest.mark.parametrize("dtype", [np.uint8, np.float32, np.float64])
def test_the_stream_gives_the_events_of_the_ideal_converter(dtype):
    frames = flicker(dtype)
    logs = (
        grey_table()[frames]
        if dtype == np.uint8
        else log_intensity(jnp.asarray(frames, jnp.float64))
    )
    same(gathered(frames), reference(logs))


def test_cuts_and_threads_do_not_change_the_events():
    frames = flicker(np.uint8)
    whole = gathered(frames, size=len(frames), workers=1)
    for size, workers in ((1, 1), (16, 2), (39, 5)):
        for field, other in zip(
            gathered(frames, size, workers=workers), whole, strict=True
        ):
            np.testing.assert_array_equal(field, other)


def test_thresholds_may_differ_from_pixel_to_pixel():
    rng = np.random.default_rng(0)
    both = rng.uniform(0.1, 0.3, SHAPE[1:]), rng.uniform(0.1, 0.3, SHAPE[1:])
    frames = flicker(np.uint8)
    same(
        gathered(frames, thresholds=both),
        reference(grey_table()[frames], thresholds=both),
    )


def test_srgb_frames_are_decoded_by_their_table():
    frames, table = flicker(np.uint8), grey_table(srgb=True)
    same(gathered(frames, table=table), reference(table[frames]))


def test_times_that_do_not_rise_are_refused():
    frames = flicker(np.uint8)
    with pytest.raises(InputError, match="times that rise"):
        gathered(frames, times=TIMES[::-1])
    for times in ([1.0, 0.0], [1.0, 1.0], [0.0, np.nan]):
        with pytest.raises(InputError, match="times: expected times that rise"):
            ideal_events(jnp.zeros((2, 1, 1)), jnp.array(times), (0.2, 0.2), capacity=4)
    for times in ([0.0], [1.0, 0.0], [0.0, np.inf]):
        said = r"expected (two or more|finite rising times)"
        with pytest.raises(InputError, match=said):
            frameless_events(lambda t, x, y: t, (1, 1), np.array(times), (0.2, 0.2))
    blocks = [(TIMES[:4], frames[:4]), (TIMES[3:8], frames[3:8])]
    with pytest.raises(InputError, match="times that rise"):
        list(stream_events(blocks, (0.2, 0.2)))


@pytest.mark.parametrize("bad", [-0.2, 0.0, np.nan, np.inf])
def test_thresholds_that_are_not_positive_are_refused(bad):
    frames = flicker(np.float64)
    ways = {
        "stream": lambda both: list(stream_events([(TIMES, frames)], both)),
        "of frames": lambda both: ideal_events(
            jnp.asarray(frames), jnp.asarray(TIMES), both, capacity=9
        ),
        "without frames": lambda both: frameless_events(
            lambda time, x, y: time, (1, 1), TIMES, both
        ),
    }
    for way in ways.values():
        with pytest.raises(InputError, match=r"^negative threshold: expected positive"):
            way((0.2, bad))
        with pytest.raises(InputError, match=r"^positive threshold: expected positive"):
            way((np.full((HEIGHT, WIDTH), bad), 0.2))


def test_frames_of_another_size_are_refused():
    frames = flicker(np.uint8)
    blocks = [(TIMES[:4], frames[:4]), (TIMES[4:8], frames[4:8, :, 1:])]
    with pytest.raises(InputError, match="expected 17 x 12 pixels as in the first"):
        list(stream_events(blocks, (0.2, 0.2)))


def test_events_of_a_scene_are_those_of_the_frames_at_instants():
    times, room = jnp.linspace(0.0, 11e-3, 12), 1 << 13
    scene, instant = one_charge(up=1.5, time_s=2.3e-3), small_camera()
    exposed = replace(instant, exposure_s=1e-3)  # of frames; events have none
    found = events_of_scene(scene, exposed, times, capacity=room)
    light = log_intensity(render(scene, instant, times) @ jnp.array(LUMINANCE))
    expected = ideal_events(light, times, (0.2, 0.2), capacity=room)
    assert int(found.count) > 100
    for one, other in zip(*map(jax.tree.leaves, (found, expected)), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)
