"""Events of a device to the host, in order of time, then of pixel.

They are put in order where they lie: two stable sorts by radix, first by pixel, then by
time. On a GPU they come to the host through pinned memory, which is kept.
"""

import typing
from typing import Any

import numpy as np
import warp as wp

from jblast.sensors.camera.events.ideal import Events
from jblast.sensors.camera.events.warp.kernels import Found


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
