"""Events of long recordings on the host, block by block, in float64.

Most pixels of a block of frames send no event. They are found by the extremes of the
block, compared with the reference. The other pixels are followed in rounds: in each,
`pixel.interval` advances them over the next frame that may cause an event. An image is
cut into strips of rows, which threads process.
"""

import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

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
    low_pass_lag,
    rounding,
    shot_events,
)

# each block has its own number of frames, so no axis has a name
Frames = UInt8[np.ndarray, "_ _ _"] | Float[np.ndarray, "_ _ _"]
Block = tuple[Float[np.ndarray, " _"], Frames]
TOGETHER = 1 << 13
"""Pixels that are followed together: 32 frames of them, 1 MB in single precision,
stay in the cache."""
Log = Callable[[np.ndarray, type[np.floating]], Float[np.ndarray, "..."]]
T = TypeVar("T")
NUMBERS = ("up", "down", "period_s", "drift", "begun")
"""Fields of `Pixel` with one number for all pixels, or one each."""


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
        log: Function from image values to the logarithm of their light, of a type.
        held: State of the pixels at the last frame.
    """

    def __init__(self, rows: slice, pixel: Pixel, log: Log, first: np.ndarray):
        """Begin at the first frame."""
        self.rows, self.pixel, self.log = rows, pixel, log
        self.held = first_held(pixel, log(first[rows].ravel(), np.float64))

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
        followed = []
        for part in np.array_split(at, 1 + len(at) // TOGETHER):
            values = np.vstack([last[part], block.take(part, axis=1)])
            # double precision of the few loud pixels only
            followed.append(self.follow(part, self.log(values, np.float64), clock))
        self.held.level[:] -= self.pixel.drift * (clock[-1] - clock[0])
        place, time, sign = map(np.concatenate, zip(*followed, strict=True))
        return Found(place + self.rows.start * frames.shape[2], time, sign)

    def is_loud(
        self, seconds: float, last: np.ndarray, block: np.ndarray
    ) -> Bool[np.ndarray, " pixel"]:
        """Return the mask of pixels that may send events, or whose state may change.

        The reference of the others sinks by their drift, and is otherwise unchanged.
        """
        low, high = block.min(axis=0), block.max(axis=0)
        below, above = quiet_bounds(self.pixel, self.held)
        loud = self.log(low, np.float32) <= below
        loud |= self.log(high, np.float32) + self.pixel.drift * seconds >= above
        if self.pixel.bandwidth_hz is not None:
            # the low-pass of a pixel in constant light is at rest
            loud |= (low != high) | (high != last)
            loud |= np.abs(self.held.lag) > rounding(self.held.level)
        return loud

    def follow(
        self,
        at: Int[np.ndarray, " pixel"],
        logs: Float[np.ndarray, "instant pixel"],
        clock: Float[np.ndarray, " instant"],
    ) -> Found:
        """Return the events of some pixels, and store their state."""
        if not len(at):
            return NOTHING
        pixel, held = some_of((self.pixel, self.held), at)
        lengths, lag = np.diff(clock), held.lag
        # a sinking reference equals a rising signal
        signals = logs.T + np.outer(pixel.drift, clock - clock[0])
        signals[:, 0] += lag
        for n, length in enumerate(lengths):
            lag = low_pass_lag(pixel, lag, logs[n], logs[n + 1], length)
            signals[:, n + 1] += lag
        pixel, held = (
            replace(pixel, drift=0.0, begun=0.0),
            held._replace(lag=np.zeros(())),
        )
        below, above = quiet_bounds(pixel, held)
        lane, begin, runs = np.arange(len(at)), np.zeros(len(at), int), []
        later, numbers = signals[:, 1:].astype(np.float32, "C"), np.arange(len(lengths))
        while len(lane):
            loud = (later <= below[lane, None]) | (later >= above[lane, None])
            loud &= numbers >= begin[lane, None]
            n = loud.argmax(axis=1)
            there = loud[np.arange(len(lane)), n]
            lane, n, later = lane[there], n[there], later[there]
            own, now = some_of((pixel, held), lane)
            here = signals[lane, n], signals[lane, n + 1], lengths[n]
            now, run = interval(own, now, *here)
            held.level[lane], held.wait_s[lane] = now.level, now.wait_s
            below[lane], above[lane] = quiet_bounds(own, now)
            begin[lane] = n + 1
            runs.append((lane, n, *run))
        held = held._replace(lag=lag)
        for values, new in zip(self.held[:3], held[:3], strict=True):
            values[at] = new
        # pixel by pixel, so that a stable order by time has pixels in order, too
        columns = [np.concatenate(column) for column in zip(*runs, strict=True)]
        order = np.argsort(columns[0], kind="stable")
        lane, number, count, first, pace = (column[order] for column in columns)
        each = np.abs(count)
        earlier = np.arange(each.sum()) - np.repeat(np.cumsum(each) - each, each)
        offset = np.repeat(first, each) + earlier * np.repeat(pace, each)
        offset = np.minimum(offset, np.repeat(lengths[number], each))
        return Found(
            np.repeat(at[lane], each),
            np.repeat(clock[number], each) + offset,
            np.repeat(np.sign(count), each),
        )


def some_of(values: T, at: Int[np.ndarray, " pixel"]) -> T:
    """Return the values of some pixels."""
    return jax.tree.map(lambda v: v[at] if np.ndim(v) else v, values)


def quiet_bounds(
    pixel: Pixel, held: Held
) -> tuple[Float[np.ndarray, " pixel"], Float[np.ndarray, " pixel"]]:
    """Return bounds of the signal between which pixels certainly send no event.

    They are of single precision, which is faster. There are none for pixels in reset.
    """
    below = np.asarray(held.level - pixel.down, np.float32)
    above = np.asarray(held.level + pixel.up, np.float32)
    # one rounding as in `interval`, another for the logarithm of the signal
    below += 2.0 * np.asarray(rounding(below))
    above -= 2.0 * np.asarray(rounding(above))
    return below, np.where(held.wait_s > 0.0, -np.inf, above)


def strips_of(
    first: np.ndarray, pixel: Pixel, count: int, srgb: bool, darkest: float | None
) -> list[Strip]:
    """Return strips of rows of the image, at the first frame."""
    whole = first.dtype == np.uint8
    floor = darkest or (EIGHT_BITS if whole else DARKEST)
    table = np.log(np.maximum(grey_light(srgb=srgb), floor))

    def log(values: np.ndarray, kind: type[np.floating]) -> np.ndarray:
        if whole:
            return table.astype(kind).take(values)
        return np.log(np.maximum(values.astype(kind), kind(floor)))

    numbers = {name: np.asarray(getattr(pixel, name), float) for name in NUMBERS}
    edges = np.linspace(0, len(first), min(count, len(first)) + 1).astype(int)
    strips = []
    for rows in map(slice, edges[:-1], edges[1:]):
        own: dict[str, Any] = {
            name: v[rows].ravel() if v.ndim else v for name, v in numbers.items()
        }
        strips.append(Strip(rows, replace(pixel, shot=None, **own), log, first))
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
