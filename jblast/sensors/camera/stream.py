"""Events of long recordings on the host, block by block, in float64.

Most pixels of a block of frames send no event. They are found by the extremes of the
block, compared with the reference. Only the other pixels are followed frame by frame,
by `pixel.interval`. An image is cut into strips of rows, which threads process.
"""

import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float, Int, PRNGKeyArray, UInt8

from jblast.errors import require
from jblast.sensors.camera.pixel import (
    DARKEST,
    EIGHT_BITS,
    Events,
    Held,
    Pixel,
    check_light,
    check_times,
    first_held,
    grey_light,
    interval,
    rounding,
    shot_events,
)

# each block has its own number of frames, so no axis has a name
Frames = UInt8[np.ndarray, "_ _ _"] | Float[np.ndarray, "_ _ _"]
Block = tuple[Float[np.ndarray, " _"], Frames]
TOGETHER = 1 << 13
"""Pixels that are followed together: arrays of 64 kB stay in the cache. With 32,768,
noise in a film in which every pixel changes takes a third longer."""
NUMBERS = ("up", "down", "period_s", "drift", "begun")
"""Fields of `Pixel` with a value for each pixel."""


def event_stream(
    blocks: Iterable[Block],
    pixel: Pixel,
    *,
    srgb: bool = False,
    darkest: float | None = None,
    workers: int | None = None,
) -> Iterator[Events]:
    """Yield the events of each block of a stream.

    Sixteen to thirty-two frames per block are the fastest. The division of a stream
    into blocks changes its shot noise only.

    Args:
        blocks: Times [s], rising through the stream, and frames: grey values of 8 bits,
            or linear light with full scale 1.
        pixel: The pixels.
        srgb: True if values of 8 bits are sRGB, false for linear light.
        darkest: Floor of the light, as a fraction of full scale (`darkest_of`);
            default: that of 8 bits, or of floats.
        workers: Threads; by default one per core.

    Raises:
        InputError: Times do not rise, a frame has another size than the first, or light
            is not finite.
    """
    workers = workers or os.cpu_count() or 1
    strips: list[Strip] = []
    time, seen, last = -math.inf, 0, np.empty((0, 0))
    with ThreadPoolExecutor(workers) as pool:
        for times, frames in blocks:
            if not len(times):
                continue
            check_times(times, time, seen)
            check_light(frames, seen)
            if not seen:  # the first frame is where the pixels begin
                time, last = times[0], frames[0]
                strips = strips_of(last, pixel, workers, srgb, darkest)
            size, first = (f"{v.shape[-1]} x {v.shape[-2]}" for v in (frames, last))
            require(size == first, "frames", f"{first} pixels as in the first", size)
            new = slice(0 if seen else 1, None)
            clock, some = np.append(time, times[new]), frames[new]
            seen += len(times)
            found = [NOTHING]
            if len(some):
                jobs = [pool.submit(s.advance, clock, last, some) for s in strips]
                found += [job.result() for job in jobs]
            if pixel.shot is not None:
                key = jax.random.fold_in(pixel.shot.key, seen)
                found.append(shot_noise(pixel.shot.rate_hz, key, clock, last.shape))
            yield ordered(found, last.shape[1])
            time, last = times[-1], frames[-1].copy()


def joined(parts: Iterable[Events]) -> Events:
    """Return the events of consecutive blocks as one."""
    columns = [(e.x, e.y, e.time, e.polarity, e.count, e.lost) for e in parts]
    x, y, time, sign, count, lost = map(np.hstack, zip(*columns, strict=True))
    return Events(x, y, time, sign, count.sum(), lost.sum())


class Found(NamedTuple):
    """Unordered events.

    Attributes:
        place: Row times width plus column.
        time: Time [s].
        sign: +1 brighter, -1 darker.
    """

    place: Int[np.ndarray, " event"]
    time: Float[np.ndarray, " event"]
    sign: Int[np.ndarray, " event"]


NOTHING = Found(np.empty(0, int), np.empty(0), np.empty(0, int))


class Strip:
    """Rows of the image; `advance` processes their next frames.

    Attributes:
        rows: The rows.
        pixel: Their pixels, one after another.
        log: Function from image values to the logarithm of their light.
        held: State of the pixels at the last frame.
    """

    def __init__(
        self,
        rows: slice,
        pixel: Pixel,
        log: Callable[[np.ndarray], Float[np.ndarray, "..."]],
        first: np.ndarray,
    ):
        """Begin at the first frame."""
        self.rows, self.pixel, self.log = rows, pixel, log
        self.held = first_held(pixel, log(first[rows].ravel()))

    def advance(
        self, clock: Float[np.ndarray, " instant"], last: np.ndarray, frames: np.ndarray
    ) -> Found:
        """Return the events of the next frames.

        Args:
            clock: Times of the last frame and of these [s].
            last: The last frame.
            frames: The next ones.
        """
        last = last[self.rows].ravel()
        block = frames[:, self.rows].reshape(len(frames), -1)
        at = np.flatnonzero(self.is_loud(clock[-1] - clock[0], last, block))
        parts = np.array_split(at, 1 + len(at) // TOGETHER)
        # logarithms of the few loud pixels only
        logs = [self.log(np.vstack([last[part], block[:, part]])) for part in parts]
        followed = [self.follow(*both, clock) for both in zip(parts, logs, strict=True)]
        sunk = self.pixel.drift * (clock[-1] - clock[0])
        sunk[at] = 0.0
        self.held.level[:] -= sunk
        place, time, sign = map(np.concatenate, zip(*followed, strict=True))
        return Found(place + self.rows.start * frames.shape[2], time, sign)

    def follow(
        self,
        at: Int[np.ndarray, " pixel"],
        logs: Float[np.ndarray, "instant pixel"],
        clock: Float[np.ndarray, " instant"],
    ) -> Found:
        """Return the events of some pixels, and store their state."""
        if not len(at):
            return NOTHING
        own = {name: getattr(self.pixel, name)[at] for name in NUMBERS}
        pixel, lengths = replace(self.pixel, **own), np.diff(clock)
        held = Held(*(values[at] for values in self.held[:3]))
        runs = []
        for before, after, length in zip(logs[:-1], logs[1:], lengths, strict=True):
            held, run = interval(pixel, held, before, after, length)
            runs.append(run)
        for values, new in zip(self.held[:3], held[:3], strict=True):
            values[at] = new
        # pixel by pixel, so that a stable order by time has pixels in order, too
        count, first, pace = (np.stack(v, axis=1) for v in zip(*runs, strict=True))
        lane, number = np.nonzero(count)
        count, first, pace = (v[lane, number] for v in (count, first, pace))
        each = np.abs(count)
        earlier = np.arange(each.sum()) - np.repeat(np.cumsum(each) - each, each)
        offset = np.repeat(first, each) + earlier * np.repeat(pace, each)
        offset = np.minimum(offset, np.repeat(lengths[number], each))
        return Found(
            np.repeat(at[lane], each),
            np.repeat(clock[number], each) + offset,
            np.repeat(np.sign(count), each),
        )

    def is_loud(
        self, seconds: float, last: np.ndarray, block: np.ndarray
    ) -> Bool[np.ndarray, " pixel"]:
        """Return the mask of pixels that may send events, or whose state may change.

        The reference of the others sinks by their drift, and is otherwise unchanged.
        """
        low, high = block.min(axis=0), block.max(axis=0)
        darkest, brightest = self.log(low), self.log(high)
        pixel, level = self.pixel, self.held.level
        slack = rounding(darkest) + rounding(brightest)
        rise = brightest + slack + pixel.drift * seconds - level
        loud = (rise >= pixel.up) | (level - darkest + slack >= pixel.down)
        loud |= self.held.wait_s > 0.0
        if pixel.bandwidth_hz is not None:
            # the low-pass of a pixel in constant light is at rest
            loud |= (low != high) | (high != last)
            loud |= np.abs(self.held.signal - brightest) > slack
        return loud


def strips_of(
    first: np.ndarray, pixel: Pixel, count: int, srgb: bool, darkest: float | None
) -> list[Strip]:
    """Return strips of rows of the image, at the first frame."""
    whole = first.dtype == np.uint8
    floor = darkest or (EIGHT_BITS if whole else DARKEST)
    table = np.log(np.maximum(grey_light(srgb=srgb), floor))

    def log(values: np.ndarray) -> np.ndarray:
        if whole:
            return table[values]
        return np.log(np.maximum(values.astype(float), floor))

    numbers = {
        name: np.broadcast_to(np.asarray(getattr(pixel, name), float), first.shape)
        for name in NUMBERS
    }
    edges = np.linspace(0, len(first), min(count, len(first)) + 1).astype(int)
    strips = []
    for rows in map(slice, edges[:-1], edges[1:]):
        own = {name: value[rows].ravel() for name, value in numbers.items()}
        strips.append(Strip(rows, replace(pixel, **own), log, first))
    return strips


def shot_noise(
    rate_hz: float, key: PRNGKeyArray, clock: Float[np.ndarray, " instant"], shape
) -> Found:
    """Return the noise events of a block."""
    seconds, pixels = clock[-1] - clock[0], shape[0] * shape[1]
    mean = rate_hz * pixels * seconds
    # mean plus ten standard deviations of the Poisson number: none is lost
    most = int(mean + 10.0 * math.sqrt(mean) + 10.0)
    # a power of two, so that few programs are compiled
    place, share, sign, count = _shot_events(key, mean, pixels, 1 << most.bit_length())
    place, share, sign = (np.asarray(v)[: int(count)] for v in (place, share, sign))
    return Found(place.astype(int), clock[0] + seconds * share.astype(float), sign)


_shot_events = jax.jit(shot_events, static_argnames=("pixels", "capacity"))


def ordered(found: Sequence[Found], width: int) -> Events:
    """Return the events of all strips, ordered by time, then by pixel."""
    place, time, sign = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.argsort(time, kind="stable")
    y, x = np.divmod(place[order], width)
    count, lost = np.asarray(len(order)), np.asarray(0)
    return Events(x, y, time[order], sign[order], count, lost)
