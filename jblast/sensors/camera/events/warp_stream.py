"""Frames to events on a GPU, in order of time, then of pixel.

The events are those of `stream_events`, in the same order. Frames may be NumPy arrays,
or JAX arrays that are on the GPU already and are not copied. Of a real camera's noise,
thresholds, leaks and the refractory period are calculated here.

Events are sorted on the device by two stable radix sorts, first by pixel, then by time.
From a GPU they come to the host through pinned memory, which is reused.
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
from jblast.sensors.camera.events.warp_kernels import (
    Camera,
    Found,
    HeldPixels,
    Loud,
    Pixels,
    Reset,
    begin,
    begin_reset,
    follow,
    follow_reset,
    screen_reset,
)

ROOM = 1 << 16
"""Events a block may have before it is done again with more room."""
THREADS = 128
"""Of a block of threads."""
FRAMES_PER_LAUNCH = 128
"""Frames followed in one launch. Longer ones are slower: threads drift apart in time,
and their frames lie in more pages than a GPU can look up at once."""


class EventKernel:
    """An event camera on one device; `advance` takes its next frames."""

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
        """Take what does not change.

        Args:
            shape: Height and width.
            thresholds: Positive and negative, as positive numbers; one for all pixels
                or an array (height, width).
            background: Grey light behind frames of RGBA, full scale 1.
            table: Logarithm of the light of each 8-bit value; else `grey_table()`.
            leak: How the pixels leak; by default they do not.
            refractory_s: So long a pixel is held in reset after an event [s].
            device: Warp's name of it; by default the first GPU, or the CPU.

        Raises:
            InputError: There is no such device, or a threshold is not positive.
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
        """Set the leaks of pixels, and the time for which they are held."""
        self.reset, self.reset.period = Reset(), refractory_s
        positive = self.camera.positive.numpy()
        for name, part in (("begun", "phase"), ("drift", "rate")):
            share = np.zeros(self.size) if leak is None else getattr(leak, part)
            each = np.asarray(share, float).ravel() * positive
            setattr(self.reset, name, wp.array(each, device=self.device))

    def advance(self, times: Float[np.ndarray, " frame"], frames: Any) -> int:
        """Take the next frames and return how many events there are in them.

        They lie on the device, in no order, as `found`; `in_order` fetches them. A
        block with more events than there is room for is done again with more.

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
        self._copy(self.pixels, self.spare)
        while True:
            self.found = self._room_for(Found, self.room)
            self._run(values, clock, times)
            count = int(self.found.count.numpy()[0])
            if count <= self.room:
                break
            self.room = 1 << (count - 1).bit_length()
            self._copy(self.spare, self.pixels)
        self.time, self.count = float(times[-1]), count
        return count

    def _run(self, values: wp.array, clock: wp.array, times) -> None:
        """Follow all pixels, part by part."""
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
        """Return frames as the device sees them: a row each, a word or byte a pixel."""
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
        """Return a struct whose arrays have that much room; counts are one zero."""
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
    """Return the events of each block of a stream, as `stream_events` does.

    Some hundred frames a block are the fastest; two blocks must fit on the device.

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


@wp.kernel(enable_backward=False)
@typing.no_type_check
def number(found: Found, pixel: wp.array[wp.int32], order: wp.array[wp.int32]):
    """Number events, and copy their pixels."""
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
    """Room for the ordering of events of one device."""

    def __init__(self, shape: tuple[int, int], device: Any):
        """Make room for a few.

        Args:
            shape: Height and width of the image.
            device: Where events lie.
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
        wp.utils.radix_sort_pairs(self.pixel, order, count, end_bit=self.bits)
        self._launch(times_of, count, found, order, kept["time"])
        wp.utils.radix_sort_pairs(kept["time"], order, count)
        places = kept["x"], kept["y"], kept["sign"]
        self._launch(places_of, count, found, order, self.width, *places)

    def _make(self, room: int) -> None:
        """Make room for so many events, twice where they are sorted."""

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
        wp.synchronize_stream(self.device)
        return self.pinned[name].numpy()[:count].copy()

    def _launch(self, kernel: Any, count: int, *inputs: Any) -> None:
        wp.launch(kernel, dim=count, inputs=inputs, device=self.device)
