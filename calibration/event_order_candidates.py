"""Ways of a GPU's events to the host in order of time, then of pixel.

Part of `calibration.event_kernel_candidates`; needs CuPy. Each way is held to the
events of the first.
"""

import importlib
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from jblast.sensors.camera.events.stream import Found, gathered

cupy: Any = importlib.import_module("cupy")

FPS, WIDTH = 1000.0, 640
BLOCK = 512
"""Frames that are followed while the events of those before are fetched."""
REPEATS = 5

Fields = tuple[np.ndarray, ...]


def ordered(
    events: Any, film: Any, seconds: Callable[[Callable[[], Any]], float]
) -> Iterator[tuple[str, float]]:
    """Measure each way.

    Args:
        events: A candidate that keeps its events on the device.
        film: Frames, on the device.
        seconds: Measures a run on the device [s].

    Yields:
        What was measured, and how long it took [s].
    """
    times = cupy.arange(len(film)) / FPS

    def followed() -> None:
        events.run(film, times)

    yield "followed alone", seconds(followed)
    known = _by_host(events)
    ways: dict[str, Callable[[], Fields]] = {
        "three copies, sorted by NumPy (as EventKernel)": lambda: _by_host(events),
        "sorted on the device, three copies": lambda: _by_device(events, pinned=False),
        "sorted on the device, pinned memory": lambda: _by_device(events, pinned=True),
    }
    for label, way in ways.items():
        yield (
            label + _checked(way(), known),
            _clocked(lambda w=way: (followed(), w())),
        )
    label = f"the same, while the next {BLOCK} frames are followed"
    blocks = Blocks(events, film, times)
    yield label + _checked(blocks.run(), known), _clocked(blocks.run)
    yield (
        "   of which the sort alone",
        _clocked(lambda: _order(events, count_of(events))),
    )


def count_of(events: Any) -> int:
    """Return how many events lie on the device."""
    return int(events.found[0])


def _checked(found: Fields, known: Fields) -> str:
    """Return a word where the events are others."""
    alike = all(
        len(a) == len(b) and np.allclose(a, b, rtol=0, atol=1e-9)
        for a, b in zip(found, known, strict=True)
    )
    return "" if alike else " (OTHER EVENTS)"


def _clocked(run: Callable[[], Any]) -> float:
    """Return the median time of a run by the host's clock [s]."""
    took = []
    for _ in range(REPEATS + 1):
        cupy.cuda.Device().synchronize()
        begin = time.perf_counter()
        run()
        cupy.cuda.Device().synchronize()
        took.append(time.perf_counter() - begin)
    return float(np.median(took[1:]))


def _by_host(events: Any) -> Fields:
    """Return pixel, time and sign as `EventKernel.in_order` gets them."""
    count = count_of(events)
    fields = (a[:count].get() for a in (events.pixel, events.time, events.sign))
    found = gathered([Found(*fields)], WIDTH)
    return (
        np.asarray(found.y) * WIDTH + np.asarray(found.x),
        np.asarray(found.time),
        np.asarray(found.polarity),
    )


def _order(events: Any, count: int) -> Any:
    """Return the order of events by time, then pixel: two stable sorts by radix."""
    by_pixel = cupy.argsort(events.pixel[:count], kind="stable")
    time_bits = events.time[:count][by_pixel].view(np.int64)
    return by_pixel[cupy.argsort(time_bits, kind="stable")]


def _by_device(events: Any, *, pinned: bool) -> Fields:
    count = count_of(events)
    order = _order(events, count)
    fields = [a[:count][order] for a in (events.pixel, events.time, events.sign)]
    if not pinned:
        return tuple(field.get() for field in fields)
    return _fetched(fields, _PINNED, 0)


def _fetched(fields: list[Any], kept: dict, half: int) -> Fields:
    """Return fields in pinned memory, which is kept for the next time."""
    out = []
    for number, field in enumerate(fields):
        key = number, half
        if key not in kept or kept[key][0].nbytes < field.nbytes:
            size = max(1 << 20, 1 << (field.nbytes - 1).bit_length())
            memory = cupy.cuda.alloc_pinned_memory(size)
            kept[key] = (np.frombuffer(memory, np.uint8, size), memory)
        host = kept[key][0][: field.nbytes].view(field.dtype)
        field.get(out=host, blocking=False)
        out.append(host)
    cupy.cuda.get_current_stream().synchronize()
    return tuple(out)


_PINNED: dict = {}


class Blocks:
    """Follows a block of frames while the events of the one before come to the host."""

    def __init__(self, events: Any, film: Any, times: Any):
        """Make room for the events of two blocks."""
        self.events, self.film, self.times = events, film, times
        self.follows, self.brings = (
            cupy.cuda.Stream(non_blocking=True) for _ in range(2)
        )
        self.kept: dict = {}
        self.rooms = []
        for _ in range(2):
            events.fresh()
            self.rooms.append((events.found, events.pixel, events.time, events.sign))

    def run(self) -> Fields:
        """Return pixel, time and sign of all blocks."""
        starts = list(range(0, len(self.film), BLOCK))
        parts: list[Fields] = []
        done = [self._follow(starts[0], 0)]
        for number, _ in enumerate(starts):
            if number + 1 < len(starts):
                done.append(self._follow(starts[number + 1], (number + 1) % 2))
            self.brings.wait_event(done[number])
            parts.append(self._bring(number % 2))
        return tuple(np.concatenate(f) for f in zip(*parts, strict=True))

    def _follow(self, start: int, half: int) -> Any:
        events = self.events
        events.found, events.pixel, events.time, events.sign = self.rooms[half]
        stop = min(start + BLOCK, len(self.film))
        with self.follows:
            events.run(self.film[start:stop], self.times[start:stop], start)
            return self.follows.record()

    def _bring(self, half: int) -> Fields:
        found, pixel, at, sign = self.rooms[half]
        with self.brings:
            count = int(found[0])
            by_pixel = cupy.argsort(pixel[:count], kind="stable")
            bits = at[:count][by_pixel].view(np.int64)
            order = by_pixel[cupy.argsort(bits, kind="stable")]
            fields = [a[:count][order] for a in (pixel, at, sign)]
            return tuple(f.copy() for f in _fetched(fields, self.kept, half))
