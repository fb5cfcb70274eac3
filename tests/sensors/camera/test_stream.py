"""Events of frames block by block are those of whole frames."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from calibration.cases import HEIGHT, THRESHOLD, WIDTH, film
from jblast.errors import InputError
from jblast.sensors.camera.pixel import (
    EIGHT_BITS,
    NoiseModel,
    Pixel,
    grey_light,
    log_intensity,
    noisy_pixel,
    pixel_events,
)
from jblast.sensors.camera.stream import event_stream, joined

KEY = jax.random.key(0)
SHAPE = (40, 12, 17)
TIMES = np.arange(SHAPE[0]) / 500.0
PIXEL = Pixel(0.2, 0.3)
convert = jax.jit(pixel_events, static_argnames="capacity")


def flicker(dtype):
    """Frames that go up and down everywhere, black and white included."""
    rng = np.random.default_rng(3)
    walk = np.cumsum(rng.normal(0.0, 12.0, SHAPE), axis=0)
    walk += rng.uniform(0, 255, SHAPE[1:])
    grey = np.clip(np.round(walk), 0, 255).astype(np.uint8)
    return grey if dtype == np.uint8 else (grey / 255.0).astype(dtype)


def streamed(frames, pixel=PIXEL, size=7, times=TIMES, **options):
    cuts = range(0, len(frames), size)
    blocks = [(times[a : a + size], frames[a : a + size]) for a in cuts]
    return joined(event_stream(blocks, pixel, **options))


def whole(logs, pixel=PIXEL, times=TIMES):
    events, _ = convert(jnp.asarray(logs), jnp.asarray(times), pixel, capacity=1 << 15)
    assert int(events.lost) == 0
    return events


def fields(events):
    """Return column, row, polarity and time, by pixel and time."""
    count = int(events.count)
    columns = events.x, events.y, events.polarity, events.time
    found = np.array([np.asarray(column)[:count] for column in columns])
    return found[:, np.lexsort(found[[3, 0, 1]])]


def same(ours, theirs):
    assert int(theirs.count) > 600
    assert (np.diff(ours.time) >= 0.0).all()
    np.testing.assert_allclose(fields(ours), fields(theirs), rtol=0, atol=1e-12)


@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_the_stream_gives_the_events_of_whole_frames(dtype):
    frames = flicker(dtype)
    light = grey_light()[frames] if dtype == np.uint8 else frames.astype(float)
    floor = {"darkest": EIGHT_BITS} if dtype == np.uint8 else {}
    same(streamed(frames), whole(log_intensity(light, **floor)))


@pytest.mark.parametrize(
    "noise",
    [
        NoiseModel(leak_hz=5.0, hot_fraction=0.01, hot_hz=100.0, shot_hz=None),
        NoiseModel(bandwidth_hz=None, leak_hz=None, shot_hz=None, refractory_s=0.002),
    ],
)
def test_a_noisy_stream_gives_the_events_of_whole_frames(noise):
    times, logs = film(1000)
    pixel = noisy_pixel(KEY, (THRESHOLD, THRESHOLD), noise, (HEIGHT, WIDTH))
    same(streamed(np.exp(logs), pixel, 16, times), whole(logs, pixel, times))


def test_cuts_and_threads_do_not_change_the_events():
    frames = flicker(np.uint8)
    pixel = noisy_pixel(KEY, (0.2, 0.3), NoiseModel(shot_hz=None), SHAPE[1:])
    known = fields(streamed(frames, pixel, len(frames), workers=1))
    for size, workers in ((1, 1), (16, 2), (39, 5)):
        found = fields(streamed(frames, pixel, size, workers=workers))
        np.testing.assert_allclose(found, known, rtol=0, atol=1e-12)


def test_times_are_those_of_float64_without_the_setting_of_jax():
    """A clock of days, of which single precision resolves 8 ms."""
    times = 86400.0 + TIMES
    with jax.enable_x64(False):
        found = streamed(flicker(np.float32), times=times)
    known = streamed(flicker(np.float32))
    np.testing.assert_allclose(found.time - 86400.0, known.time, rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    ("blocks", "message"),
    [
        ([(slice(4), slice(4)), (slice(3, 8), slice(4, 9))], "times that rise"),
        ([(slice(4), slice(4))] * 2, "times that rise .* at frame 4"),
    ],
)
def test_frames_out_of_order_are_refused(blocks, message):
    frames = flicker(np.uint8)
    with pytest.raises(InputError, match=message):
        list(event_stream([(TIMES[a], frames[b]) for a, b in blocks], PIXEL))


def test_a_still_film_has_no_events():
    still = np.full((9, 4, 5), 0.5, np.float32)
    assert int(streamed(still, size=4, times=TIMES[:9]).count) == 0
    assert int(streamed(still[:1], times=TIMES[:1]).count) == 0
