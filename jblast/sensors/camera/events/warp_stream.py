"""Frames to events on a GPU, in order of time, then of pixel.

The events are those of `stream_events`, in the same order. Frames may be NumPy arrays,
or JAX arrays that are on the GPU already and are not copied. Of a real camera's noise,
thresholds, leaks and the refractory period are included here.

Events are sorted on the device by two stable radix sorts, first by pixel, then by time.
They reach the host through pinned memory, which is reused.

The kernels screen all pixels and follow those that change. As in `events/stream.py`,
the extremes of a pixel's light over a run of frames are compared with the bounds within
which it stays quiet. The frames of a run are loaded together, because of the latency of
GPU memory. If a bound is exceeded, the same thread processes the run again, frame by
frame, with logarithms in float64: the run's values are then in a cache. Frames are grey
values of 8 bits, or words of RGBA that are first composited over a background, as by
`grey_composite`.

Pixels that leak or are held in reset are screened likewise, as `reset_events` has them.
A leak is a signal that rises, so the bounds of a quiet pixel fall with time. A pixel
that is held has no bounds, as its next reference is not known yet. Light, logarithm,
bounds and extremes are the same functions for both kinds. The kernels differ: an ideal
pixel counts steps of its level at each frame, and one that leaks or is held is followed
along the slope between two frames and may be released anywhere on it.
"""

import typing
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import warp as wp
from jaxtyping import ArrayLike, Float

from jblast.errors import InputError
from jblast.sensors.camera.events.ideal import Events, check_thresholds, grey_table
from jblast.sensors.camera.events.noise import Leak
from jblast.sensors.camera.image import LUMINANCE

ROOM = 1 << 16
"""Initial capacity of a block, in events. A block with more is repeated with a larger
one, which costs its time once."""
THREADS = 128
"""Threads of a thread block: four warps."""
FRAMES_PER_LAUNCH = 128
"""Frames followed in one launch. Longer ones are slower: threads drift apart in time,
and their frames lie in more pages than a GPU can look up simultaneously."""
SLACK = wp.constant(wp.float64(16.0 * 2.220446049250313e-16))
"""Factor of `ideal.rounding` in float64."""
FLOOR = wp.constant(wp.float64(0.5 / 255.0))
"""`ideal.EIGHT_BITS`: frames have 8 bits."""
CLOSE = wp.constant(wp.float64(16.0 * 1.1920928955078125e-07))
"""Relative margin by which bounds are narrowed for rounding in float32, so that no
event is missed. A larger one would only follow more quiet pixels."""
PART = wp.constant(wp.float32(1.0 / 255.0))
"""One step of 8 bits, full scale 1."""
RED, GREEN, BLUE = (wp.constant(wp.float32(w / 255.0)) for w in LUMINANCE)
"""Luminance weights of 8-bit colours."""
RUN = wp.constant(16)
"""Frames of a run, which are loaded together."""
NEVER = wp.constant(wp.float64(-1e300))
"""End of the reset of a pixel that is not held [s]."""


class EventKernel:
    """An event camera on one device; `advance` processes its next frames."""

    def __init__(
        self,
        shape: tuple[int, int],
        thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
        *,
        background: Float[np.ndarray, "height width"] | None = None,
        table: Float[np.ndarray, "256"] | None = None,
        leak: Leak | None = None,
        refractory_s: float = 0.0,
        device: str | None = None,
    ):
        """Store the constants on the device.

        Args:
            shape: Height and width.
            thresholds: Positive and negative, as positive numbers; one for all pixels
                or an array (height, width).
            background: Grey light behind frames of RGBA, full scale 1.
            table: Logarithm of the light of each 8-bit value; else `grey_table()`.
            leak: Leak of the pixels; None for none.
            refractory_s: Time for which a pixel is held in reset after an event [s].
            device: Warp's device name; by default the first GPU, or the CPU.

        Raises:
            InputError: The device does not exist, or a threshold is not positive.
        """
        check_thresholds(thresholds)
        try:
            self.device = wp.get_device(device)
        except (RuntimeError, ValueError):
            names = ", ".join(str(known) for known in wp.get_devices())
            raise InputError(f"device: expected one of {names}, got {device}") from None
        self.shape, self.colour = shape, background is not None
        self.size = shape[0] * shape[1]
        table = grey_table() if table is None else table
        behind = np.zeros(shape) if background is None else background
        self.camera = Camera()
        fields = [
            *zip(("positive", "negative"), thresholds, strict=True),
            ("behind", behind),
        ]
        for name, value in fields:
            kind = np.float32 if name == "behind" else np.float64
            flat = np.broadcast_to(np.asarray(value, kind), shape).ravel()
            setattr(self.camera, name, wp.array(flat, device=self.device))
        self.camera.table = wp.array(table, dtype=wp.float64, device=self.device)
        # screening compares light in float32; logarithms are taken only for loud pixels
        lights = np.exp(table).astype(np.float32)
        self.camera.lights = wp.array(lights, device=self.device)
        self.is_ideal = leak is None and refractory_s == 0.0
        kind = Pixels if self.is_ideal else HeldPixels
        self.pixels, self.spare = (self._room_for(kind, self.size) for _ in range(2))
        self._set_reset(leak, refractory_s)
        self.loud = None if self.is_ideal else self._room_for(Loud, self.size)
        self.ordering = Ordering(shape, self.device)
        self.room, self.time = ROOM, -np.inf

    def _set_reset(self, leak: Leak | None, refractory_s: float) -> None:
        """Set the leaks of pixels, and the time of their reset."""
        self.reset, self.reset.period = Reset(), refractory_s
        positive = self.camera.positive.numpy()
        for name, part in (("begun", "phase"), ("drift", "rate")):
            share = np.zeros(self.size) if leak is None else getattr(leak, part)
            each = np.asarray(share, float).ravel() * positive
            setattr(self.reset, name, wp.array(each, device=self.device))

    def advance(self, times: Float[np.ndarray, " frame"], frames: Any) -> int:
        """Process the next frames and return the number of their events.

        The events are on the device, unordered, as `found`; `in_order` returns them. A
        block that exceeds the capacity is repeated with a larger one.

        Raises:
            InputError: Times do not rise, or frames are of another size or type.
        """
        self._check(times, frames)
        clock = wp.array(times, dtype=wp.float64, device=self.device)
        values = self._values(frames)
        if self.time == -np.inf:
            self.reset.origin = float(times[0])
            if self.is_ideal:
                self._launch(begin, values, self.camera, self.pixels)
            else:
                known = self.camera, self.reset
                self._launch(begin_reset, values, *known, self.pixels)
        # a block that exceeds the capacity is repeated from this state
        self._copy(self.pixels, self.spare)
        while True:
            self.found = self._room_for(Found, self.room)
            self._run(values, clock, times)
            count = int(self.found.count.numpy()[0])
            if count <= self.room:
                break
            # a power of two: capacities settle after a few blocks
            self.room = 1 << (count - 1).bit_length()
            self._copy(self.spare, self.pixels)
        self.time, self.count = float(times[-1]), count
        return count

    def _run(self, values: wp.array, clock: wp.array, times) -> None:
        """Follow all pixels, launch by launch."""
        starts = range(0, len(times), FRAMES_PER_LAUNCH)
        if self.loud is not None:
            self.loud.count = wp.zeros(len(starts), dtype=wp.int32, device=self.device)
        last = self.time if self.time > -np.inf else float(times[0])
        for part, start in enumerate(starts):
            stop = min(start + FRAMES_PER_LAUNCH, len(times))
            now = wp.float64(last)
            if self.is_ideal:
                state = self.camera, self.pixels, self.found
                self._launch(follow, values, clock, start, stop, now, *state)
            else:
                state = self.camera, self.reset, self.pixels, self.loud
                both = values, clock, start, stop, part, now, *state
                self._launch(screen_reset, *both)
                self._launch(follow_reset, *both, self.found)
            last = float(times[stop - 1])

    def _launch(self, kernel: Any, *inputs: Any) -> None:
        wp.launch(
            kernel,
            dim=self.size,
            inputs=inputs,
            device=self.device,
            block_dim=THREADS,
        )

    def _copy(self, source: Any, goal: Any) -> None:
        for name in (Pixels if self.is_ideal else HeldPixels).vars:
            wp.copy(getattr(goal, name), getattr(source, name))

    def in_order(self) -> Events:
        """Return the events of the last frames, in order of time, then of pixel."""
        return self.ordering.events(self.found, self.count)

    def _check(self, times, frames) -> None:
        if not (np.diff(times, prepend=self.time) > 0.0).all():
            raise InputError("frames: expected times that rise from frame to frame")
        shape = (len(times), *self.shape, *([4] if self.colour else []))
        if frames.shape != shape or frames.dtype != np.uint8:
            raise InputError(
                f"frames: expected 8-bit numbers of shape {shape}, got {frames.dtype} "
                f"of shape {frames.shape}"
            )

    def _values(self, frames: Any) -> wp.array:
        """Return frames on the device: a row per frame, a word or byte per pixel."""
        if isinstance(frames, np.ndarray):
            flat = np.ascontiguousarray(frames).reshape(len(frames), -1)
            flat = flat.view(np.uint32) if self.colour else flat
            return wp.array(flat, device=self.device)
        array = wp.from_jax(frames)
        kind = wp.uint32 if self.colour else wp.uint8
        return wp.array(
            ptr=array.ptr,
            dtype=kind,
            shape=(len(frames), self.size),
            device=array.device,
            copy=False,
        )

    def _room_for(self, kind: Any, size: int):
        """Return a struct with arrays of a capacity, and a single zero as its count."""
        struct = kind()
        for name, field in kind.vars.items():
            room = 1 if name == "count" else size
            zeros = wp.zeros(room, dtype=field.type.dtype, device=self.device)
            setattr(struct, name, zeros)
        return struct


def kernel_events(
    blocks: Iterable[tuple[Float[np.ndarray, " _"], Any]],
    shape: tuple[int, int],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    **options: Any,
) -> Iterator[Events]:
    """Yield the events of each block of a stream, as `stream_events` does.

    About 100 frames per block are the fastest; two blocks must fit on the device.

    Args:
        blocks: Times [s], rising through the stream, and frames of 8 bits: grey values
            of linear light, or with a `background` RGBA.
        shape: Height and width.
        thresholds: Positive and negative, as positive numbers.
        **options: `background`, `table`, `leak`, `refractory_s` and `device` of
            `EventKernel`.

    Raises:
        InputError: As `EventKernel` and its `advance`.
    """
    kernel = EventKernel(shape, thresholds, **options)
    for times, frames in blocks:
        if len(times):
            kernel.advance(times, frames)
            yield kernel.in_order()


class _Found:
    """Unordered events and their number; those beyond the capacity are only counted."""

    count: wp.array[wp.int32]
    pixel: wp.array[wp.int32]
    time: wp.array[wp.float64]
    sign: wp.array[wp.int32]


class _Loud:
    """Pixels to be followed through a launch, and their number in each launch."""

    count: wp.array[wp.int32]
    pixel: wp.array[wp.int32]


Loud, Found = wp.struct(_Loud), wp.struct(_Found)


@wp.kernel(enable_backward=False)
@typing.no_type_check
def number(found: Found, pixel: wp.array[wp.int32], order: wp.array[wp.int32]):
    """Number the events, and copy their pixels."""
    i = wp.tid()
    order[i] = i
    pixel[i] = found.pixel[i]


@wp.kernel(enable_backward=False)
@typing.no_type_check
def times_of(found: Found, order: wp.array[wp.int32], time: wp.array[wp.float64]):
    """Copy the times of events in an order."""
    i = wp.tid()
    time[i] = found.time[order[i]]


@wp.kernel(enable_backward=False)
@typing.no_type_check
def places_of(
    found: Found,
    order: wp.array[wp.int32],
    width: wp.int32,
    x: wp.array[wp.int32],
    y: wp.array[wp.int32],
    sign: wp.array[wp.int32],
):
    """Copy columns, rows and signs of events in an order."""
    i = wp.tid()
    pixel = found.pixel[order[i]]
    y[i] = pixel // width
    x[i] = pixel - width * (pixel // width)
    sign[i] = found.sign[order[i]]


class Ordering:
    """Buffers for the ordering of events of one device."""

    def __init__(self, shape: tuple[int, int], device: Any):
        """Allocate buffers for a few events.

        Args:
            shape: Height and width of the image.
            device: Device of the events.
        """
        self.width, self.device = shape[1], device
        self.bits = max(int(shape[0] * shape[1] - 1).bit_length(), 1)
        self._make(1 << 10)

    def events(self, found: Any, count: int) -> Events:
        """Return the first `count` of the events found, in order, on the host."""
        if count > self.room:
            self._make(1 << (count - 1).bit_length())
        if count:
            self._sort(found, count)
        x, y, time, sign = (self._fetched(name, count) for name in self.kept)
        return Events(x, y, time, sign, np.asarray(count), np.asarray(0))

    def _sort(self, found: Any, count: int) -> None:
        kept, order = self.kept, self.order
        self._launch(number, count, found, self.pixel, order)
        # only the bits that pixel numbers have
        wp.utils.radix_sort_pairs(self.pixel, order, count, end_bit=self.bits)
        self._launch(times_of, count, found, order, kept["time"])
        wp.utils.radix_sort_pairs(kept["time"], order, count)
        places = kept["x"], kept["y"], kept["sign"]
        self._launch(places_of, count, found, order, self.width, *places)

    def _make(self, room: int) -> None:
        """Allocate buffers for a number of events, twice that for sorted fields."""

        def empty(size, kind, **where):
            return wp.empty(size, dtype=kind, **(where or {"device": self.device}))

        kinds = {
            "x": wp.int32,
            "y": wp.int32,
            "time": wp.float64,
            "sign": wp.int32,
        }
        self.room = room
        self.pixel, self.order = (empty(2 * room, wp.int32) for _ in range(2))
        self.kept = {
            name: empty(2 * room if name == "time" else room, kind)
            for name, kind in kinds.items()
        }
        self.pinned = {}
        if self.device.is_cuda:
            at = {"device": "cpu", "pinned": True}
            self.pinned = {n: empty(room, kind, **at) for n, kind in kinds.items()}

    def _fetched(self, name: str, count: int) -> np.ndarray:
        if not self.pinned:
            return self.kept[name].numpy()[:count].copy()
        wp.copy(self.pinned[name], self.kept[name], count=count)
        # the copy to pinned memory is asynchronous
        wp.synchronize_stream(self.device)
        return self.pinned[name].numpy()[:count].copy()

    def _launch(self, kernel: Any, count: int, *inputs: Any) -> None:
        wp.launch(kernel, dim=count, inputs=inputs, device=self.device)


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
    """Return the smallest and largest light at which a pixel certainly stays quiet."""
    wide = CLOSE * (wp.float64(1.0) + wp.abs(level))
    lowest = wp.exp(level - fall + wide)
    if lowest < FLOOR:  # light below the floor counts as the floor, and gives no event
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


# not as decorators: the tests' type checker would treat the structs as functions
Pixels, Camera = wp.struct(_Pixels), wp.struct(_Camera)


@wp.func
@typing.no_type_check
def span_of(
    frames: wp.array2d[Any],
    p: wp.int32,
    start: wp.int32,
    stop: wp.int32,
    camera: Camera,
):
    """Return the smallest and the largest light of a pixel in some frames."""
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
    """Set the reference from the first frame, which causes no event."""
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
    """Follow a pixel through a run; return its new bounds.

    The run begins with the frame `run` and ends before `end`. The value of the frame
    before `start` is `pixels.value`; its time is `last_time` [s]. Events beyond the
    capacity are only counted.
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

    Signal above the reference at the first frame, leak [1/s], time of the first frame
    [s], refractory period [s].
    """

    begun: wp.array[wp.float64]
    drift: wp.array[wp.float64]
    origin: wp.float64
    period: wp.float64


# not as decorators: the tests' type checker would treat the structs as functions
HeldPixels, Reset = wp.struct(_HeldPixels), wp.struct(_Reset)


@wp.kernel(enable_backward=False)
@typing.no_type_check
def begin_reset(
    frames: wp.array2d[Any], camera: Camera, reset: Reset, pixels: HeldPixels
):
    """Set the reference from the first frame, which causes no event."""
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
    """Follow a listed pixel through some frames; excess events are only counted."""
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
