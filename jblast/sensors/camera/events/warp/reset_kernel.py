"""Warp kernels of pixels that leak and are held in reset, as in `reset_pixel`.

As in `kernels`, all pixels are screened and the few that are loud are followed.
A leak is a signal that rises: the bounds within which a pixel stays quiet sink. A pixel
that is held has none, as its next reference is not known yet. What is alike (light, its
logarithm, bounds, extremes) are functions of `kernels`; the kernels are two, as an
ideal pixel counts steps of its level at each frame, and one that leaks or is held is
followed along the slope between two frames and may be let go anywhere on it.
"""

import typing
from typing import Any

import warp as wp

from jblast.sensors.camera.events.warp.kernels import (
    SLACK,
    Camera,
    Found,
    Loud,
    bounds_of,
    light_of,
    log_of,
    span_of,
)


class _HeldPixels:
    """What pixels remember: see `reset_pixel.Held`; besides, their last value."""

    level: wp.array[wp.float64]
    until: wp.array[wp.float64]
    value: wp.array[wp.uint32]


class _Reset:
    """What does not change.

    Way to the first leak at the first frame, leak [1/s], time of the first frame [s],
    refractory period [s].
    """

    begun: wp.array[wp.float64]
    drift: wp.array[wp.float64]
    origin: wp.float64
    period: wp.float64


# not by decorators: the type checker of the tests takes what they return for functions
HeldPixels, Reset = wp.struct(_HeldPixels), wp.struct(_Reset)

NEVER = wp.constant(wp.float64(-1e300))
"""When a pixel is let go that is not held."""


@wp.kernel(enable_backward=False)
@typing.no_type_check
def begin_reset(
    frames: wp.array2d[Any], camera: Camera, reset: Reset, pixels: HeldPixels
):
    """See the first frame: it sets the reference and gives no event."""
    p = wp.tid()
    value = frames[0, p]
    light = light_of(value, camera.behind[p], camera.lights)
    pixels.level[p] = log_of(value, light, camera.table) - reset.begun[p]
    pixels.until[p] = NEVER
    pixels.value[p] = wp.uint32(value)


@wp.kernel(enable_backward=False)
@typing.no_type_check
def screen_reset(
    frames: wp.array2d[Any],
    times: wp.array[wp.float64],
    start: wp.int32,
    stop: wp.int32,
    part: wp.int32,
    last_time: wp.float64,
    camera: Camera,
    reset: Reset,
    pixels: HeldPixels,
    loud: Loud,
):
    """List a pixel if its light leaves the bounds in some frames, or if it is held."""
    p = wp.tid()
    seen = span_of(frames, p, start, stop, camera)
    level, drift = pixels.level[p], reset.drift[p]
    first = level - drift * (last_time - reset.origin)
    final = level - drift * (times[stop - 1] - reset.origin)
    lowest = bounds_of(first, camera.positive[p], camera.negative[p])[0]
    highest = bounds_of(final, camera.positive[p], camera.negative[p])[1]
    if pixels.until[p] > last_time or seen[1] > highest or seen[0] < lowest:
        loud.pixel[wp.atomic_add(loud.count, part, 1)] = p
    else:
        pixels.value[p] = wp.uint32(frames[stop - 1, p])


@wp.kernel(enable_backward=False)
@typing.no_type_check
def follow_reset(
    frames: wp.array2d[Any],
    times: wp.array[wp.float64],
    start: wp.int32,
    stop: wp.int32,
    part: wp.int32,
    last_time: wp.float64,
    camera: Camera,
    reset: Reset,
    pixels: HeldPixels,
    loud: Loud,
    found: Found,
):
    """Take one of the pixels listed through some frames; events go where is room."""
    if wp.tid() >= loud.count[part]:
        return
    p = loud.pixel[wp.tid()]
    rise = camera.positive[p]
    fall = camera.negative[p]
    behind = camera.behind[p]
    level = pixels.level[p]
    until = pixels.until[p]
    value = type(frames[0, p])(pixels.value[p])
    light = light_of(value, behind, camera.lights)
    early = last_time
    after = log_of(value, light, camera.table)
    after += reset.drift[p] * (early - reset.origin)
    room = found.pixel.shape[0]
    for k in range(start, stop):
        late = times[k]
        before = after
        value = frames[k, p]
        light = light_of(value, behind, camera.lights)
        after = log_of(value, light, camera.table)
        after += reset.drift[p] * (late - reset.origin)
        if late > early and until <= late:
            slope = (after - before) / (late - early)
            begin = early
            if until > early:
                begin = until
                level = before + slope * (until - early)
            until = NEVER
            slack = SLACK * (wp.float64(1.0) + wp.abs(after))
            sign = wp.int32(0)
            size = rise
            if after - level + slack >= rise:
                sign = 1
            if after - level - slack <= -fall:
                sign = -1
                size = -fall
            if sign != 0 and slope != wp.float64(0.0):
                first = early + (level + size - before) / slope
                first = wp.clamp(first, begin, late)
                pace = reset.period + wp.abs(size / slope)
                about = wp.max(wp.abs(early), wp.abs(late))
                left = late - first + SLACK * (wp.float64(1.0) + about)
                more = wp.max(wp.int32(wp.floor(left / pace)), 0)
                slot = wp.atomic_add(found.count, 0, 1 + more)
                for n in range(1 + more):
                    if slot + n < room:
                        time = first + wp.float64(n) * pace
                        found.pixel[slot + n] = p
                        found.time[slot + n] = wp.min(time, late)
                        found.sign[slot + n] = sign
                until = first + wp.float64(more) * pace + reset.period
                if until <= late:
                    level = before + slope * (until - early)
                    until = NEVER
        early = late
    pixels.level[p] = level
    pixels.until[p] = until
    pixels.value[p] = wp.uint32(value)
