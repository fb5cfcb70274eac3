"""Event pixels as Warp kernels: screen all pixels, follow those that change.

As in `events/stream.py`, the extremes of a pixel's light over a run of frames are
compared with the bounds within which it stays quiet. The frames of a run are loaded
together, because of the latency of GPU memory. Where a bound is passed, the same thread
takes the pixel through the run once more, frame by frame, with logarithms in float64:
the run's values are in a cache by then. Frames are grey values of 8 bits, or words of
RGBA that are laid over a background first, as by `grey_composite`.

Pixels that leak or are held in reset are screened likewise, as `reset_events` has them.
A leak is a signal that rises, so the bounds of a quiet pixel fall with time. A pixel
that is held has no bounds, as its next reference is not known yet. Light, logarithm,
bounds and extremes are the same functions for both kinds; the kernels differ, as an
ideal pixel counts steps of its level at each frame, and one that leaks or is held is
followed along the slope between two frames and may be released anywhere on it.
"""

import typing
from typing import Any

import warp as wp

from jblast.sensors.camera.image import LUMINANCE

SLACK = wp.constant(wp.float64(16.0 * 2.220446049250313e-16))
"""As in `ideal.rounding`."""
FLOOR = wp.constant(wp.float64(0.5 / 255.0))
"""As `ideal.EIGHT_BITS`: frames have 8 bits."""
CLOSE = wp.constant(wp.float64(16.0 * 1.1920928955078125e-07))
"""Bounds are drawn in by this part: rounding of float32, so that none is overlooked."""
PART = wp.constant(wp.float32(1.0 / 255.0))
RED, GREEN, BLUE = (wp.constant(wp.float32(w / 255.0)) for w in LUMINANCE)
RUN = wp.constant(16)
"""Frames looked at together."""
NEVER = wp.constant(wp.float64(-1e300))
"""When a pixel is let go that is not held."""


@wp.func
@typing.no_type_check
def light_of(value: wp.uint8, behind: wp.float32, lights: wp.array[wp.float32]):
    """Return the light of a grey value, full scale 1."""
    return lights[wp.int32(value)]


@wp.func
@typing.no_type_check
def light_of(  # noqa: F811 - an overload, by type
    word: wp.uint32, behind: wp.float32, lights: wp.array[wp.float32]
):
    """Return the grey light of straight RGBA over a background, full scale 1."""
    low = wp.uint32(255)
    red = wp.float32(wp.int32(word & low))
    green = wp.float32(wp.int32((word >> wp.uint32(8)) & low))
    blue = wp.float32(wp.int32((word >> wp.uint32(16)) & low))
    alpha = wp.float32(wp.int32(word >> wp.uint32(24))) * PART
    grey = RED * red + GREEN * green + BLUE * blue
    return behind + alpha * (grey - behind)


@wp.func
@typing.no_type_check
def log_of(value: wp.uint8, light: wp.float32, table: wp.array[wp.float64]):
    """Return the logarithm of a grey value."""
    return table[wp.int32(value)]


@wp.func
@typing.no_type_check
def log_of(  # noqa: F811 - an overload, by type
    word: wp.uint32, light: wp.float32, table: wp.array[wp.float64]
):
    """Return the logarithm of composited light."""
    return wp.log(wp.max(wp.float64(light), FLOOR))


@wp.func
@typing.no_type_check
def bounds_of(level: wp.float64, rise: wp.float64, fall: wp.float64):
    """Return the least and greatest light at which a pixel surely stays quiet."""
    wide = CLOSE * (wp.float64(1.0) + wp.abs(level))
    lowest = wp.exp(level - fall + wide)
    if lowest < FLOOR:  # light below the floor is as dark as the floor, and no event
        lowest = wp.float64(0.0)
    return wp.vec2f(wp.float32(lowest), wp.float32(wp.exp(level + rise - wide)))


class _Pixels:
    """State of pixels: see `ideal.Reference`.

    Also the bounds of the light at which they stay quiet, and their last value.
    """

    first: wp.array[wp.float64]
    ups: wp.array[wp.int32]
    downs: wp.array[wp.int32]
    quiet: wp.array[wp.vec2f]
    value: wp.array[wp.uint32]


class _Camera:
    """Constants: thresholds, light of the background, light of each grey value."""

    positive: wp.array[wp.float64]
    negative: wp.array[wp.float64]
    behind: wp.array[wp.float32]
    lights: wp.array[wp.float32]
    table: wp.array[wp.float64]


class _Loud:
    """Pixels to be followed through a part, and how many in each part."""

    count: wp.array[wp.int32]
    pixel: wp.array[wp.int32]


class _Found:
    """Events in no order, and how many there are; more than room are only counted."""

    count: wp.array[wp.int32]
    pixel: wp.array[wp.int32]
    time: wp.array[wp.float64]
    sign: wp.array[wp.int32]


# not by decorators: the type checker of the tests takes what they return for functions
Pixels, Camera = wp.struct(_Pixels), wp.struct(_Camera)
Loud, Found = wp.struct(_Loud), wp.struct(_Found)


@wp.func
@typing.no_type_check
def span_of(
    frames: wp.array2d[Any],
    p: wp.int32,
    start: wp.int32,
    stop: wp.int32,
    camera: Camera,
):
    """Return the least and the greatest light of a pixel in some frames."""
    behind = camera.behind[p]
    top = wp.float32(0.0)
    low = wp.float32(1e30)
    for k in range(start, stop, RUN):
        for j in range(RUN):  # loaded together: latency of GPU memory
            value = frames[wp.min(k + j, stop - 1), p]
            light = light_of(value, behind, camera.lights)
            top = wp.max(top, light)
            low = wp.min(low, light)
    return wp.vec2f(low, top)


@wp.kernel(enable_backward=False)
@typing.no_type_check
def begin(frames: wp.array2d[Any], camera: Camera, pixels: Pixels):
    """See the first frame: it sets the reference and gives no event."""
    p = wp.tid()
    value = frames[0, p]
    light = light_of(value, camera.behind[p], camera.lights)
    level = log_of(value, light, camera.table)
    pixels.first[p] = level
    pixels.ups[p] = 0
    pixels.downs[p] = 0
    pixels.quiet[p] = bounds_of(level, camera.positive[p], camera.negative[p])
    pixels.value[p] = wp.uint32(value)


@wp.func
@typing.no_type_check
def take(
    frames: wp.array2d[Any],
    times: wp.array[wp.float64],
    p: wp.int32,
    run: wp.int32,
    end: wp.int32,
    start: wp.int32,
    last_time: wp.float64,
    camera: Camera,
    pixels: Pixels,
    found: Found,
):
    """Take a pixel through a run; events go where is room. Return its new bounds.

    The run begins with the frame `run` and ends before `end`. The frame before `start`
    is known by `pixels.value`; it was at `last_time` [s].
    """
    rise = camera.positive[p]
    fall = camera.negative[p]
    behind = camera.behind[p]
    first = pixels.first[p]
    up = pixels.ups[p]
    down = pixels.downs[p]
    quiet = pixels.quiet[p]
    value = type(frames[0, p])(pixels.value[p])
    earlier = last_time
    if run > start:
        value = frames[run - 1, p]
        earlier = times[run - 1]
    light = light_of(value, behind, camera.lights)
    level = first + wp.float64(up) * rise - wp.float64(down) * fall
    room = found.pixel.shape[0]
    for k in range(run, end):
        then, then_light = value, light
        value = frames[k, p]
        light = light_of(value, behind, camera.lights)
        if light > quiet[1] or light < quiet[0]:
            now = log_of(value, light, camera.table)
            change = now - level
            slack = SLACK * (wp.float64(1.0) + wp.abs(now))
            more = wp.max(wp.int32(wp.floor((change + slack) / rise)), 0)
            less = wp.max(wp.int32(wp.floor((slack - change) / fall)), 0)
            number = more + less
            if number > 0:
                before = log_of(then, then_light, camera.table)
                step = wp.where(more > 0, rise, -fall)
                slot = wp.atomic_add(found.count, 0, number)
                for n in range(number):
                    if slot + n < room:
                        target = level + wp.float64(n + 1) * step
                        share = (target - before) / (now - before)
                        share = wp.clamp(share, wp.float64(0.0), wp.float64(1.0))
                        found.pixel[slot + n] = p
                        found.time[slot + n] = earlier + share * (times[k] - earlier)
                        found.sign[slot + n] = wp.where(more > 0, 1, -1)
                up += more
                down += less
                level = first + wp.float64(up) * rise - wp.float64(down) * fall
                quiet = bounds_of(level, rise, fall)
        earlier = times[k]
    pixels.ups[p] = up
    pixels.downs[p] = down
    pixels.quiet[p] = quiet
    return quiet


@wp.kernel(enable_backward=False)
@typing.no_type_check
def follow(
    frames: wp.array2d[Any],
    times: wp.array[wp.float64],
    start: wp.int32,
    stop: wp.int32,
    last_time: wp.float64,
    camera: Camera,
    pixels: Pixels,
    found: Found,
):
    """Follow a pixel through some frames, run by run."""
    p = wp.tid()
    quiet = pixels.quiet[p]
    for run in range(start, stop, RUN):
        end = wp.min(run + RUN, stop)
        seen = span_of(frames, p, run, end, camera)
        if seen[1] > quiet[1] or seen[0] < quiet[0]:
            quiet = take(
                frames, times, p, run, end, start, last_time, camera, pixels, found
            )
    pixels.value[p] = wp.uint32(frames[stop - 1, p])


class _HeldPixels:
    """State of pixels: see `ideal.Held`; also their last value."""

    level: wp.array[wp.float64]
    until: wp.array[wp.float64]
    value: wp.array[wp.uint32]


class _Reset:
    """Constants of pixels that leak or are held.

    Way to the first leak at the first frame, leak [1/s], time of the first frame [s],
    refractory period [s].
    """

    begun: wp.array[wp.float64]
    drift: wp.array[wp.float64]
    origin: wp.float64
    period: wp.float64


# not by decorators: the type checker of the tests takes what they return for functions
HeldPixels, Reset = wp.struct(_HeldPixels), wp.struct(_Reset)


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
