from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.sensors.camera.events import warp_stream
from jblast.sensors.camera.events.ideal import grey_table
from jblast.sensors.camera.events.noise import IDEAL, leaks
from jblast.sensors.camera.events.stream import stream_events
from jblast.sensors.camera.events.warp_stream import EventKernel, kernel_events

SHAPE = (40, 12, 17)
TIMES = np.arange(SHAPE[0]) / 500.0
BOTH = (0.2, 0.3)


def walk(channels):
    """Frames that go up and down everywhere, black and white included."""
    rng = np.random.default_rng(3)
    steps = rng.normal(0.0, 12.0, (*SHAPE, *channels))
    start = rng.uniform(0, 255, (*SHAPE[1:], *channels))
    return np.clip(np.round(np.cumsum(steps, axis=0) + start), 0, 255).astype(np.uint8)


def cut(frames, size):
    return [
        (TIMES[a : a + size], frames[a : a + size]) for a in range(0, SHAPE[0], size)
    ]


def joined(parts):
    parts = list(parts)
    return [
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("x", "y", "time", "polarity")
    ]


def same(ours, theirs):
    assert len(theirs[0]) > 300
    for field, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(field, other, rtol=0, atol=1e-14)


@pytest.mark.parametrize(("size", "together"), [(1, 64), (7, 3), (40, 64), (40, 9)])
def test_grey_frames_give_the_events_of_the_stream(size, together, monkeypatch):
    monkeypatch.setattr(warp_stream, "FRAMES_PER_LAUNCH", together)
    frames = walk(())
    ours = joined(kernel_events(cut(frames, size), SHAPE[1:], BOTH, device="cpu"))
    by_pixel = np.lexsort((ours[2], ours[0], ours[1]))
    theirs = joined(stream_events(cut(frames, 16), BOTH))
    other = np.lexsort((theirs[2], theirs[0], theirs[1]))
    same([f[by_pixel] for f in ours], [f[other] for f in theirs])
    assert (np.diff(ours[2]) >= 0.0).all()


def test_events_of_one_instant_are_in_order_of_their_pixels():
    frames = (
        np.zeros((3, *SHAPE[1:]), np.uint8)
        + np.array([9, 90, 30], np.uint8)[:, None, None]
    )
    blocks = [(TIMES[:3] - 0.1, frames)]  # before zero, too
    x, y, time, sign = joined(kernel_events(blocks, SHAPE[1:], BOTH, device="cpu"))
    pixel = y * SHAPE[2] + x
    assert len(time) == SHAPE[1] * SHAPE[2] * (11 + 3)
    assert (np.diff(time) >= 0.0).all()
    assert (np.diff(pixel)[np.diff(time) == 0.0] > 0).all()
    assert (sign[: len(sign) // 2] == 1).all()
    assert sign[-1] == -1


@pytest.mark.slow  # a kernel for itself
def test_colour_over_a_background_gives_the_events_of_the_stream():
    """Composited in float32 by two compilers: times differ by their rounding."""
    frames = walk((4,))
    behind = np.linspace(0.01, 0.9, SHAPE[1] * SHAPE[2], dtype=np.float32)
    behind = behind.reshape(SHAPE[1:])
    options = {"background": behind, "device": "cpu"}
    ours = joined(kernel_events(cut(frames, 16), SHAPE[1:], BOTH, **options))
    theirs = joined(stream_events(cut(frames, 16), BOTH, background=behind))
    assert len(ours[0]) == len(theirs[0]) > 300
    orders = [np.lexsort((e[2], e[0], e[1])) for e in (ours, theirs)]
    for field, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(
            field[orders[0]], other[orders[1]], rtol=0, atol=1e-6
        )


@pytest.mark.parametrize("parts", [(), pytest.param((4,), marks=pytest.mark.slow)])
def test_arrays_of_jax_are_taken_as_they_are(parts):
    frames = walk(parts)
    options: dict[str, Any] = {"device": "cpu"}
    if parts:
        options["background"] = np.full(SHAPE[1:], 0.2, np.float32)
    ours = joined(kernel_events(cut(frames, 40), SHAPE[1:], BOTH, **options))
    blocks = [(TIMES, jnp.asarray(frames))]
    same(joined(kernel_events(blocks, SHAPE[1:], BOTH, **options)), ours)


@pytest.mark.parametrize(("size", "together"), [(7, 3), (40, 64)])
def test_pixels_leak_and_are_held_as_those_of_the_stream(size, together, monkeypatch):
    """The same rates, phases and period: the JAX route has the leak in its frames."""
    monkeypatch.setattr(warp_stream, "FRAMES_PER_LAUNCH", together)
    frames = walk(())
    leaky = IDEAL._replace(leak_hz=30.0, hot_fraction=0.1, hot_hz=200.0)
    leak = leaks(jax.random.key(1), SHAPE[1:], leaky)
    options = {"leak": leak, "refractory_s": 0.0013, "device": "cpu"}
    ours = joined(kernel_events(cut(frames, size), SHAPE[1:], BOTH, **options))
    rise = 0.2 * np.asarray(leak.rate)
    logs = grey_table()[frames] + TIMES[:, None, None] * rise
    begun = 0.2 * np.asarray(leak.phase)
    blocks = [(TIMES[a : a + 9], logs[a : a + 9]) for a in range(0, SHAPE[0], 9)]
    held = {"in_logarithms": True, "begun": begun, "refractory_s": 0.0013}
    theirs = joined(stream_events(blocks, BOTH, **held))
    orders = [np.lexsort((e[2], e[0], e[1])) for e in (ours, theirs)]
    assert len(ours[0]) > 1000
    for field, other in zip(ours, theirs, strict=True):
        # sums in another order: last digits of a time and of a logarithm
        np.testing.assert_allclose(field[orders[0]], other[orders[1]], atol=1e-12)


def test_a_still_film_leaks_at_its_rate_without_being_followed_in_vain():
    still = np.full((40, 12, 17), 90, np.uint8)
    leak = leaks(jax.random.key(0), SHAPE[1:], IDEAL._replace(leak_hz=100.0))
    options = {"leak": leak, "device": "cpu"}
    events = joined(kernel_events([(TIMES, still)], SHAPE[1:], BOTH, **options))
    count = np.floor(TIMES[-1] * np.asarray(leak.rate) + np.asarray(leak.phase))
    each = np.bincount(events[1] * 17 + events[0], minlength=12 * 17)
    np.testing.assert_array_equal(each, count.ravel())
    # the first comes when the rest of the way is gone
    first = np.full(12 * 17, np.inf)
    np.minimum.at(first, events[1] * 17 + events[0], events[2])
    expected = ((1.0 - leak.phase) / leak.rate).ravel()
    np.testing.assert_allclose(first, expected, rtol=1e-9)


def test_a_block_with_more_events_than_room_is_done_again():
    frames = walk(())
    kernel = EventKernel(SHAPE[1:], BOTH, device="cpu")
    kernel.room = 10
    count = kernel.advance(TIMES, frames)
    whole = joined(stream_events([(TIMES, frames)], BOTH))
    assert count == len(whole[0])
    assert kernel.room >= count


def test_what_does_not_fit_is_refused():
    kernel = EventKernel((5, 6), BOTH, device="cpu")
    good = np.zeros((2, 5, 6), np.uint8)
    with pytest.raises(InputError, match="times that rise"):
        kernel.advance(np.array([1.0, 1.0]), good)
    with pytest.raises(InputError, match="expected 8-bit numbers of shape"):
        kernel.advance(np.array([0.0, 1.0]), good[..., None])
    with pytest.raises(InputError, match="device: expected one of cpu"):
        EventKernel((2, 2), (0.2, 0.2), device="cuda:77")
    with pytest.raises(InputError, match="negative threshold: expected positive"):
        EventKernel((2, 2), (0.2, -0.2), device="cpu")
