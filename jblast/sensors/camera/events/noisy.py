"""Frames to events by a camera with noise: under jit, or as a stream."""

from collections.abc import Iterable, Iterator

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, PRNGKeyArray

from jblast.sensors.camera.events.ideal import Events, continued_events, reset_events
from jblast.sensors.camera.events.log_intensity import (
    DARKEST,
    grey_table,
    log_intensity,
)
from jblast.sensors.camera.events.noise import (
    NoiseModel,
    leaked,
    leaks,
    low_passed,
    merged,
    mismatched,
    rested,
    shot_noise,
)
from jblast.sensors.camera.events.pixel import first_reference
from jblast.sensors.camera.events.stream import Block, stream_events


def noisy_events(
    key: PRNGKeyArray,
    log_frames: Float[Array, "frame height width"],
    times: Float[Array, " frame"],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    noise: NoiseModel,
    *,
    capacity: int,
) -> Events:
    """Return what a camera with noise sends; see `ideal_events`.

    Args:
        key: Of mismatch, hot pixels and noise.
        log_frames: Logarithm of the light.
        times: Of the frames [s], rising.
        thresholds: Positive and negative, as positive numbers.
        noise: Which effects, and how large.
        capacity: Room for events, before noise in refractory periods is left out.
    """
    shape = log_frames.shape[1], log_frames.shape[2]
    pixel, hot, shot = jax.random.split(key, 3)
    if noise.mismatch is not None:
        thresholds = mismatched(pixel, thresholds, noise.mismatch, shape)
    if noise.bandwidth_hz is not None:
        first = log_frames[0]
        log_frames = low_passed(log_frames, times, noise.bandwidth_hz, first)
    first = log_frames[0]
    if _leaks(noise):
        leak = leaks(hot, shape, noise)
        positive = jnp.broadcast_to(jnp.asarray(thresholds[0]), shape)
        first = first - leak.phase * positive
        log_frames = leaked(log_frames, times - times[0], leak.rate, positive)
    held = _held(noise)
    if held is not None:
        events = reset_events(
            log_frames, times, thresholds, held, first, capacity=capacity
        )
    else:
        seen = first_reference(first)
        events, _ = continued_events(
            log_frames, times, thresholds, seen, capacity=capacity
        )
    if noise.shot_hz is not None:
        span = times[0], times[-1]
        rate = noise.shot_hz
        extra = shot_noise(shot, rate, shape, *span, capacity=capacity)
        events = merged(events, extra, capacity)
    if noise.refractory_s is not None:
        never = jnp.full(shape, -jnp.inf, times.dtype)
        events, _ = rested(events, noise.refractory_s, never)
    return events


def _held(noise: NoiseModel) -> float | None:
    """Return how long a pixel is held in reset after an event [s], if it is."""
    return noise.refractory_s if noise.refractory == "reset" else None


def _leaks(noise: NoiseModel) -> bool:
    return (noise.leak_hz, noise.hot_fraction) != (None, None)


def noisy_stream(
    key: PRNGKeyArray,
    blocks: Iterable[Block],
    shape: tuple[int, int],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    noise: NoiseModel,
    *,
    table: Float[np.ndarray, "256"] | None = None,
    darkest: float = DARKEST,
) -> Iterator[Events]:
    """Return the events of each block of a stream; see `stream_events`.

    Noise is drawn block by block: it depends on the key and on how the stream is cut.

    Args:
        key: Of mismatch, hot pixels and noise.
        blocks: Times [s] and frames of linear light, grey of 8 bits or floats.
        shape: Height and width.
        thresholds: Positive and negative, as positive numbers.
        noise: Which effects, and how large.
        table: Logarithm of the light of each 8-bit value; by default `grey_table()`.
        darkest: Floor of float frames, as a fraction of full scale.
    """
    table = grey_table() if table is None else table
    pixel, hot, shot = jax.random.split(key, 3)
    both = thresholds
    if noise.mismatch is not None:
        both = mismatched(pixel, thresholds, noise.mismatch, shape)
    positive, negative = (np.broadcast_to(np.asarray(t), shape) for t in both)
    spans: list[tuple[float, float]] = []
    signal = noise.bandwidth_hz is not None or _leaks(noise)
    begun = np.zeros(shape)
    blocks = _noted(blocks, spans)
    if signal:
        drift = None
        if _leaks(noise):
            leak = leaks(hot, shape, noise)
            drift = leak.rate, jnp.asarray(positive)
            begun = np.asarray(leak.phase) * positive
        blocks = _signals(blocks, table, darkest, noise.bandwidth_hz, drift)
    held = _held(noise)
    stream = stream_events(
        blocks,
        (positive, negative),
        table=table,
        in_logarithms=signal,
        begun=begun,
        refractory_s=held,
        darkest=darkest,
    )
    last = jnp.full(shape, -jnp.inf)
    for i, events in enumerate(stream):
        start, stop = spans[i]
        extra = None
        if noise.shot_hz is not None:
            mean = noise.shot_hz * shape[0] * shape[1] * (stop - start)
            # ten standard deviations: none is lost
            room = _room(int(mean + 10.0 * np.sqrt(mean) + 10.0))
            here = jax.random.fold_in(shot, i)
            extra = _shot_noise(here, noise.shot_hz, shape, start, stop, capacity=room)
        if extra is None and (held is not None or noise.refractory_s is None):
            yield events
            continue
        events = _padded(events)
        if extra is not None:
            events = _merged(events, extra, len(events.time) + len(extra.time))
        if noise.refractory_s is not None:
            events, last = _rested(events, noise.refractory_s, last)
        yield events


_shot_noise = jax.jit(shot_noise, static_argnames=("shape", "capacity"))
_merged = jax.jit(merged, static_argnames="capacity")
_rested = jax.jit(rested, donate_argnames="last")


def _noted(blocks: Iterable[Block], spans: list) -> Iterator[Block]:
    """Pass blocks on, and note from when to when each lasts."""
    begin = None
    for times, frames in blocks:
        if len(times):
            spans.append((times[0] if begin is None else begin, times[-1]))
            begin = times[-1]
            yield times, frames


def _signals(
    blocks: Iterable[Block], table, darkest, bandwidth_hz, drift
) -> Iterator[Block]:
    """Turn frames of light into the signal of the pixel."""
    before = signal = start = None
    for times, frames in blocks:
        logs = jnp.asarray(
            table[frames]
            if frames.dtype == np.uint8
            else log_intensity(frames.astype(float), darkest)
        )
        if before is None or signal is None or start is None:
            start = times[0]
            # the first frame before itself: the low-pass is at rest there
            before, signal = (times[0] - 1.0, logs[0]), logs[0]
        clock = jnp.asarray(np.append(before[0], times))
        held = jnp.concatenate([before[1][None], logs])
        answer, signal = _signal(held, clock, signal, bandwidth_hz, drift, start)
        before = times[-1], logs[-1]
        yield times, np.asarray(answer)


@jax.jit
def _signal(logs, times, signal, bandwidth_hz, drift, start):
    """Return the signal of a block and, before the leak, of its last frame."""
    if bandwidth_hz is not None:
        logs = low_passed(logs, times, bandwidth_hz, signal)
    last = logs[-1]
    if drift is not None:
        logs = leaked(logs, times - start, *drift)
    return logs[1:], last


def _room(count: int) -> int:
    """Return the next power of two, so that few programs are compiled."""
    return max(256, 1 << (count - 1).bit_length())


def _padded(events: Events) -> Events:
    """Return events on the device, with empty places at the end."""
    room = [(0, _room(len(events.time)) - len(events.time))]
    fill = {"x": -1, "y": -1, "time": np.inf, "polarity": 0}
    fields = {
        name: jnp.asarray(np.pad(getattr(events, name), room, constant_values=value))
        for name, value in fill.items()
    }
    return Events(
        **fields, count=jnp.asarray(events.count), lost=jnp.asarray(events.lost)
    )
