"""Events of an event camera with noise: under jit, or as a stream.

The effects are mismatch of thresholds, a low-pass of the light, shot noise, leak
events, hot pixels and a refractory period. Each can be omitted.

References:
    Hu, Liu and Delbruck (2021), v2e: from video frames to realistic DVS events, for
    the effects, and the defaults of its program. Mismatch is 0.03 of a threshold of
    0.2 there, and leak rates are log-normal over 0.1 decades (`emulator.py`). Its
    noise per frame averages out as frames become shorter, and is omitted. Hot pixels
    are a choice of ours.
    Rebecq, Gehrig and Scaramuzza (2018), ESIM: its refractory period, read in the
    programs (`event_simulator.cpp`; `esim.cpp` of vid2e is the same).
"""

import math
from collections.abc import Iterable, Iterator
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, PRNGKeyArray

from jblast.sensors.camera.events.ideal import (
    DARKEST,
    Events,
    Thresholds,
    continued_events,
    first_reference,
    grey_table,
    log_intensity,
    reset_events,
)
from jblast.sensors.camera.events.stream import Block, padded_size, stream_events
from jblast.types import as_float_arrays


class NoiseModel(NamedTuple):
    """Imperfections of a real event camera; None omits an effect.

    Attributes:
        mismatch: Standard deviation of the logarithm of thresholds between pixels.
        bandwidth_hz: Bandwidth of the photoreceptor, a first-order low-pass.
        leak_hz: Rate of brighter events of a pixel in constant light, by a drifting
            reference: the mean of all pixels except hot ones, without refractory
            periods.
        leak_spread: Standard deviation of the logarithm of leak rates between pixels,
            hot pixels included.
        hot_fraction: Share of pixels that leak at `hot_hz`.
        hot_hz: Mean leak rate of hot pixels.
        shot_hz: Rate of noise events of a pixel, of either sign.
        refractory_s: Time after an event in which a pixel sends none.
        refractory: Behaviour in that period. "reset": the pixel is held in reset, and
            starts again from the light at the end. "esim": it continues, and its events
            are omitted, as in ESIM and vid2e. A noise event begins a period by the rule
            of ESIM in both: others within it are omitted, and it resets nothing.
    """

    mismatch: float | None = 0.15
    bandwidth_hz: float | None = 300.0
    leak_hz: float | None = 0.01
    leak_spread: float = 0.1 * math.log(10.0)
    hot_fraction: float | None = 1e-4
    hot_hz: float = 10.0
    shot_hz: float | None = 0.001
    refractory_s: float | None = 0.5e-3
    refractory: Literal["reset", "esim"] = "reset"


def noisy_events(
    key: PRNGKeyArray,
    log_frames: Float[Array, "frame height width"],
    times: Float[Array, " frame"],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    noise: NoiseModel,
    *,
    capacity: int,
) -> Events:
    """Return the events of a camera with noise; see `ideal_events`.

    Args:
        key: Random key of mismatch, hot pixels and noise.
        log_frames: Logarithm of the light.
        times: Times of the frames [s], rising.
        thresholds: Positive and negative, as positive numbers.
        noise: Effects and their sizes.
        capacity: Largest number of events, before the omission of noise in refractory
            periods.
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
        # a sinking reference equals a rising signal, which the ideal pixel can process
        log_frames = leaked(log_frames, times - times[0], leak.rate, positive)
    held = _reset_period(noise)
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


def _reset_period(noise: NoiseModel) -> float | None:
    """Return the time for which a pixel is held in reset [s], or None."""
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
    """Yield the events of each block of a stream; see `stream_events`.

    Noise is drawn block by block: it depends on the key and on the blocks.

    Args:
        key: Random key of mismatch, hot pixels and noise.
        blocks: Times [s] and frames of linear light, grey of 8 bits or floats.
        shape: Height and width.
        thresholds: Positive and negative, as positive numbers.
        noise: Effects and their sizes.
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
    blocks = _recording_spans(blocks, spans)
    if signal:
        drift = None
        if _leaks(noise):
            leak = leaks(hot, shape, noise)
            drift = leak.rate, jnp.asarray(positive)
            begun = np.asarray(leak.phase) * positive
        blocks = _signals(blocks, table, darkest, noise.bandwidth_hz, drift)
    held = _reset_period(noise)
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
            # mean plus ten standard deviations of the Poisson number: none is lost
            room = padded_size(int(mean + 10.0 * np.sqrt(mean) + 10.0))
            # one key per block, so that noise does not repeat
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


def shot_noise(
    key: PRNGKeyArray,
    rate_hz: Float[ArrayLike, ""],
    shape: tuple[int, int],
    start: Float[ArrayLike, ""],
    stop: Float[ArrayLike, ""],
    *,
    capacity: int,
) -> Events:
    """Return noise events: Poisson in time, at any pixel, of either sign.

    They do not change the reference.
    """
    number, where, when, which = jax.random.split(key, 4)
    start, stop = as_float_arrays(start, stop)
    pixels = shape[0] * shape[1]
    total = jax.random.poisson(number, rate_hz * pixels * (stop - start))
    valid = jnp.arange(capacity) < total
    pixel = jax.random.randint(where, (capacity,), 0, pixels)
    share = jax.random.uniform(when, (capacity,))
    sign = 2 * jax.random.bernoulli(which, shape=(capacity,)).astype(pixel.dtype) - 1
    time = start + share * (stop - start)
    count = jnp.minimum(total, capacity)
    x, y = pixel % shape[1], pixel // shape[1]
    return in_order(Events(x, y, time, sign, count, total - count), valid)


_shot_noise = jax.jit(shot_noise, static_argnames=("shape", "capacity"))


def merged(first: Events, second: Events, capacity: int) -> Events:
    """Return the events of two streams as one."""
    both = jax.tree.map(lambda a, b: jnp.append(a, b.astype(a.dtype)), first, second)
    count, lost = both.count.sum(), both.lost.sum()
    events = Events(both.x, both.y, both.time, both.polarity, count, lost)
    return in_order(events, events.polarity != 0, capacity)


_merged = jax.jit(merged, static_argnames="capacity")


def rested(
    events: Events,
    refractory_s: Float[ArrayLike, ""],
    last: Float[Array, "height width"],
) -> tuple[Events, Float[Array, "height width"]]:
    """Return events without those in the refractory period of a pixel's last event.

    Args:
        events: Ordered by time.
        refractory_s: The period [s].
        last: Time of each pixel's last event before these [s]; -inf if there is none.

    Returns:
        The remaining events, and the time of each pixel's last event.
    """
    # ordered by pixel, so that the loop carries two numbers instead of an image
    pixel = jnp.maximum(events.y * last.shape[1] + events.x, 0)
    one_by_one = jnp.argsort(pixel, stable=True)

    def step(carry, event):
        pixel, time, sign, before = event
        before = jnp.where(pixel == carry[0], carry[1], before)
        # padding has sign 0 and is never sent
        sent = (time - before >= refractory_s) & (sign != 0)
        return (pixel, jnp.where(sent, time, before)), sent

    fields = pixel, events.time, events.polarity, last.ravel()[pixel]
    begin = jnp.full_like(pixel[0], -1), jnp.full_like(events.time[0], -jnp.inf)
    ordered = jax.tree.map(lambda field: field[one_by_one], fields)
    _, sent = jax.lax.scan(step, begin, ordered)
    sent = jnp.zeros_like(sent).at[one_by_one].set(sent)
    when = jnp.where(sent, events.time, -jnp.inf)
    last = last.ravel().at[pixel].max(when).reshape(last.shape)
    # sent events first, in their order of time
    order = jnp.argsort(~sent, stable=True)
    kept = sent[order]
    x, y = (jnp.where(kept, field[order], -1) for field in (events.x, events.y))
    time = jnp.where(kept, events.time[order], jnp.inf)
    sign = jnp.where(kept, events.polarity[order], 0)
    count = kept.sum().astype(events.count.dtype)
    return Events(x, y, time, sign, count, events.lost), last


_rested = jax.jit(rested, donate_argnames="last")


def _recording_spans(blocks: Iterable[Block], spans: list) -> Iterator[Block]:
    """Yield the blocks, and append start and end of each to `spans`."""
    begin = None
    for times, frames in blocks:
        if len(times):
            spans.append((times[0] if begin is None else begin, times[-1]))
            begin = times[-1]
            yield times, frames


def _signals(
    blocks: Iterable[Block], table, darkest, bandwidth_hz, drift
) -> Iterator[Block]:
    """Yield the pixel's signal for frames of light."""
    before = signal = start = None
    for times, frames in blocks:
        logs = jnp.asarray(
            table[frames]
            if frames.dtype == np.uint8
            else log_intensity(frames.astype(float), darkest)
        )
        if before is None or signal is None or start is None:
            start = times[0]
            # one second of the first frame before it: the low-pass starts at rest
            before, signal = (times[0] - 1.0, logs[0]), logs[0]
        # the last frame of the block before continues the low-pass
        clock = jnp.asarray(np.append(before[0], times))
        held = jnp.concatenate([before[1][None], logs])
        answer, signal = _signal(held, clock, signal, bandwidth_hz, drift, start)
        before = times[-1], logs[-1]
        yield times, np.asarray(answer)


@jax.jit
def _signal(logs, times, signal, bandwidth_hz, drift, start):
    """Return the signal of a block and, before the leak, that of its last frame."""
    if bandwidth_hz is not None:
        logs = low_passed(logs, times, bandwidth_hz, signal)
    last = logs[-1]
    if drift is not None:
        logs = leaked(logs, times - start, *drift)
    return logs[1:], last


def _padded(events: Events) -> Events:
    """Return events on the device, padded with empty entries."""
    room = [(0, padded_size(len(events.time)) - len(events.time))]
    fill = {"x": -1, "y": -1, "time": np.inf, "polarity": 0}
    fields = {
        name: jnp.asarray(np.pad(getattr(events, name), room, constant_values=value))
        for name, value in fill.items()
    }
    return Events(
        **fields, count=jnp.asarray(events.count), lost=jnp.asarray(events.lost)
    )


IDEAL = NoiseModel(
    mismatch=None,
    bandwidth_hz=None,
    leak_hz=None,
    hot_fraction=None,
    hot_hz=0.0,
    shot_hz=None,
    refractory_s=None,
)
"""Noise model without any effect."""


def mismatched(
    key: PRNGKeyArray,
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    mismatch: Float[ArrayLike, ""],
    shape: tuple[int, int],
) -> Thresholds:
    """Return thresholds of each pixel, log-normal about the given ones."""
    positive, negative = (
        jnp.asarray(threshold) * jnp.exp(mismatch * jax.random.normal(one, shape))
        for threshold, one in zip(thresholds, jax.random.split(key), strict=True)
    )
    return positive, negative


def low_passed(
    log_frames: Float[Array, "frame ..."],
    times: Float[Array, " frame"],
    bandwidth_hz: Float[ArrayLike, ""],
    first: Float[Array, "..."],
) -> Float[Array, "frame ..."]:
    """Return the signal after a first-order low-pass.

    Exact for light whose logarithm is linear between frames, so that the frame rate
    may be below the bandwidth.

    Args:
        log_frames: Logarithm of the light.
        times: Times of the frames [s].
        bandwidth_hz: Frequency at which the amplitude falls to 1 / sqrt 2.
        first: Signal at the first of these frames.
    """

    def step(signal, frame):
        before, after, elapsed = frame
        # solution of signal' = rate * (light - signal) for light linear in time
        lag = (after - before) / (rate * elapsed)
        signal = after - lag + (signal - before + lag) * jnp.exp(-rate * elapsed)
        return signal, signal

    rate = 2.0 * np.pi * bandwidth_hz
    frames = log_frames[:-1], log_frames[1:], jnp.diff(times)
    _, signals = jax.lax.scan(step, first, frames)
    return jnp.concatenate([first[None], signals])


class Leak(NamedTuple):
    """Drift of the references of pixels.

    Attributes:
        rate: Rate of leak events of each pixel in constant light [Hz].
        phase: Share of the interval to its next leak event that a pixel has completed
            at the first frame, 0 to 1, so that pixels leak at different times. 0
            without leaks.
    """

    rate: Float[Array, "height width"]
    phase: Float[Array, "height width"]


def leaks(key: PRNGKeyArray, shape: tuple[int, int], noise: NoiseModel) -> Leak:
    """Return the leak of each pixel, hot pixels included."""
    hot_key, rate_key, phase_key = jax.random.split(key, 3)
    hot = jax.random.uniform(hot_key, shape) < (noise.hot_fraction or 0.0)
    mean = jnp.where(hot, noise.hot_hz, noise.leak_hz or 0.0)
    spread = noise.leak_spread
    # a log-normal factor of mean one: its median is exp(-spread^2 / 2)
    own = jnp.exp(spread * jax.random.normal(rate_key, shape) - 0.5 * spread**2)
    phase = jnp.where(mean > 0.0, jax.random.uniform(phase_key, shape), 0.0)
    return Leak(mean * own, phase)


def leaked(
    log_frames: Float[Array, "frame height width"],
    since: Float[Array, " frame"],
    rates: Float[Array, "height width"],
    positive: Float[Array, "height width"],
) -> Float[Array, "frame height width"]:
    """Return the signal relative to references that drift downwards.

    Args:
        log_frames: Signal.
        since: Time since the first frame of the stream [s].
        rates: Rates of leak events [Hz].
        positive: Positive threshold.
    """
    return log_frames + since[:, None, None] * (rates * positive)[None]


def in_order(events: Events, valid, capacity: int | None = None) -> Events:
    """Return the valid events in order.

    Args:
        events: In any order.
        valid: Mask of the events that count.
        capacity: Largest number; default: as before. Excess events are added to `lost`.
    """
    time = jnp.where(valid, events.time, jnp.inf)
    order = jnp.lexsort((events.x, events.y, time))[:capacity]
    kept = valid[order]
    x, y = (jnp.where(kept, field[order], -1) for field in (events.x, events.y))
    sign = jnp.where(kept, events.polarity[order], 0)
    count = kept.sum().astype(events.count.dtype)
    out = (valid.sum() - kept.sum()).astype(events.lost.dtype)
    return Events(x, y, time[order], sign, count, events.lost + out)
