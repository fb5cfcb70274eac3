"""Frames to events: an ideal event camera, under jit, vmap and grad.

First all events are counted, then as many as there is room for are written out, each
at the time the logarithm of the light, linear between two frames, crosses the
threshold. That time is second order in the frame interval, and differentiable.
"""

from collections.abc import Callable
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float, Int

from jblast.errors import InputError
from jblast.sensors.camera.events.pixel import (
    Reference,
    Thresholds,
    check_light,
    check_thresholds,
    count_events,
    first_reference,
)
from jblast.sensors.camera.events.reset_pixel import let_go, reset_runs
from jblast.types import as_float_array


class Events(eqx.Module):
    """Events in order of time, those of one time in order of pixel (row by row).

    Empty places stand at the end: x and y -1, time infinite, polarity 0. Light that is
    no number crosses no threshold: inside jit, where it cannot be refused, all times
    are NaN.

    Attributes:
        x: Column.
        y: Row, downwards.
        time: Seconds on the clock of the frames.
        polarity: +1 brighter, -1 darker.
        count: How many there are.
        lost: How many more there were than room.
    """

    x: Int[Array | np.ndarray, " event"]
    y: Int[Array | np.ndarray, " event"]
    time: Float[Array | np.ndarray, " event"]
    polarity: Int[Array | np.ndarray, " event"]
    count: Int[Array | np.ndarray, ""]
    lost: Int[Array | np.ndarray, ""]


def ideal_events(
    log_frames: Float[Array, "frame height width"],
    times: Float[Array, " frame"],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    *,
    capacity: int,
) -> Events:
    """Return what an ideal event camera sends: no event at the first frame.

    Args:
        log_frames: Logarithm of the light (`log_intensity`).
        times: Of the frames [s], rising.
        thresholds: Positive and negative, as positive numbers; one for all pixels or
            an array (height, width).
        capacity: Room for so many events. If there are more, those of the earliest
            intervals are kept and `lost` says how many are not.

    Raises:
        InputError: Outside jit: a threshold is not positive, times do not rise, or
            light is not finite.
    """
    return continued_events(
        log_frames, times, thresholds, first_reference(log_frames[0]), capacity=capacity
    )[0]


def continued_events(
    log_frames: Float[Array, "frame height width"],
    times: Float[Array, " frame"],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    reference: Reference,
    *,
    capacity: int,
) -> tuple[Events, Reference]:
    """Return the events of a part of a stream, and the reference for the next part.

    Parts give the events of the whole if each begins with the last frame of the one
    before. Arguments and errors as those of `ideal_events`.
    """
    log_frames, times, both = _fitting(log_frames, times, thresholds)
    counts, levels, after = count_events(log_frames, both, reference)
    pixels = log_frames[0].size
    flat = log_frames.reshape(-1, pixels)
    positive, negative = (threshold.ravel() for threshold in both)

    def when(cell, nth, sign):
        interval, pixel = cell // pixels, cell % pixels
        step = jnp.where(sign > 0, positive[pixel], -negative[pixel])
        before, after = flat[interval, pixel], flat[interval + 1, pixel]
        change = jnp.where(sign != 0, after - before, 1.0)
        target = levels.ravel()[cell] + nth.astype(step.dtype) * step
        part = jnp.clip((target - before) / change, 0.0, 1.0).astype(times.dtype)
        return times[interval] + part * (times[interval + 1] - times[interval])

    return _marked(_write_out(counts, when, capacity), log_frames), after


def reset_events(
    log_frames: Float[Array, "frame height width"],
    times: Float[Array, " frame"],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    refractory_s: Float[ArrayLike, ""],
    first: Float[Array, "height width"],
    *,
    capacity: int,
) -> Events:
    """Return the events of pixels that are held in reset after each of them.

    Arguments and errors as those of `ideal_events`; further:

    Args:
        log_frames: Logarithm of the light.
        times: Of the frames [s], rising.
        thresholds: Positive and negative.
        refractory_s: How long a pixel is held [s].
        first: Reference of the pixels at the first frame.
        capacity: Room for so many events.
    """
    log_frames, times, both = _fitting(log_frames, times, thresholds)
    dtype = jnp.promote_types(log_frames.dtype, times.dtype)  # a signal at any time
    log_frames, times, both, first = jax.tree.map(
        lambda v: v.astype(dtype), (log_frames, times, both, first)
    )
    period = as_float_array(refractory_s).astype(dtype)
    runs, _ = reset_runs(log_frames, times, both, period, let_go(first))

    def when(cell, nth, sign):
        del sign
        later = (nth - 1).astype(dtype) * runs.pace.ravel()[cell]
        return runs.first.ravel()[cell] + later

    return _marked(_write_out(runs.count, when, capacity), log_frames)


def _marked(events: Events, light: Float[Array, "frame height width"]) -> Events:
    """Return events without times where light was no number."""
    unknown = jnp.isnan(light).any()
    return replace(events, time=jnp.where(unknown, jnp.nan, events.time))


def _fitting(
    log_frames: Float[Array, "frame height width"],
    times: Float[Array, " frame"],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
) -> tuple[
    Float[Array, "two_or_more height width"], Float[Array, " two_or_more"], Thresholds
]:
    """Return frames with an interval between them, and thresholds of each pixel."""
    check_thresholds(thresholds)
    check_light(log_frames)
    clock_rises = isinstance(times, Tracer) or (np.diff(np.asarray(times)) > 0).all()
    if not clock_rises:
        raise InputError("times: expected times that rise from frame to frame")
    dtype, shape = log_frames.dtype, log_frames.shape[1:]
    if len(log_frames) == 1:  # no interval: one in which nothing happens
        log_frames = jnp.repeat(log_frames, 2, axis=0)
        times = jnp.stack([times[0], times[0] + 1.0])
    positive, negative = (
        jnp.broadcast_to(as_float_array(threshold).astype(dtype), shape)
        for threshold in thresholds
    )
    return log_frames, times, (positive, negative)


def _write_out(
    counts: Int[Array, "interval height width"],
    when: Callable[[Array, Array, Array], Float[Array, " event"]],
    capacity: int,
) -> Events:
    """Give each event counted its place, time and sign.

    Args:
        counts: Of each interval and pixel: +k brighter, -k darker.
        when: The time of an event: of which interval and pixel, the how-manieth, and
            of which sign.
        capacity: Room for so many.
    """
    width, pixels = counts.shape[2], counts.shape[1] * counts.shape[2]
    number = jnp.abs(counts).ravel()
    ends = jnp.cumsum(number)
    total = ends[-1]
    slot = jnp.arange(capacity, dtype=ends.dtype)
    valid = slot < total
    cell = jnp.searchsorted(ends, slot, side="right")
    cell = jnp.minimum(cell, number.size - 1)
    nth = slot - (ends[cell] - number[cell]) + 1
    pixel = cell % pixels
    sign = jnp.where(valid, jnp.sign(counts.ravel()[cell]), 0)
    time = jnp.where(valid, when(cell, nth, sign), jnp.inf)
    order = jnp.lexsort((pixel, time))
    x, y = (jnp.where(valid, at, -1) for at in (pixel % width, pixel // width))
    count = jnp.minimum(total, capacity)
    return Events(*(x[order], y[order], time[order], sign[order]), count, total - count)
