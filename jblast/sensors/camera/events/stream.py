"""Events of long recordings on the host, block by block and strip by strip.

Most pixels of a block of frames cross no threshold. These are found by the extremes of
the block, compared with bounds in the units of the image, without a logarithm. The few
other pixels are followed frame by frame. The events are those of `ideal_events`, in the
same order. An image is cut into strips of rows.
"""

import os
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import ArrayLike, Float, Int, UInt8

from jblast.errors import InputError
from jblast.sensors.camera.events.ideal import (
    DARKEST,
    Events,
    Held,
    Reference,
    check_light,
    check_thresholds,
    count_events,
    grey_table,
    reset_runs,
    rounding,
)

# each block has its own number of frames, so no axis has a name
Frames = UInt8[np.ndarray, "_ _ _ ..."] | Float[np.ndarray, "_ _ _"]
Block = tuple[Float[np.ndarray, " _"], Frames]


def stream_events(
    blocks: Iterable[Block],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    *,
    table: Float[np.ndarray, "256"] | None = None,
    in_logarithms: bool = False,
    begun: Float[np.ndarray, "height width"] | None = None,
    refractory_s: float | None = None,
    darkest: float = DARKEST,
    workers: int | None = None,
) -> Iterator[Events]:
    """Yield the events of each block of a stream.

    Two blocks are in memory at a time; sixteen to thirty-two frames per block are the
    fastest. The division of a stream into blocks does not change its events.

    Args:
        blocks: Times [s], rising through the stream, and frames of linear light: grey
            values of 8 bits, or floats with full scale 1.
        thresholds: Positive and negative, as positive numbers; one for all pixels or
            an array (height, width).
        table: Logarithm of the light of each 8-bit value; by default `grey_table()`.
        in_logarithms: True if float frames are logarithms of the light.
        begun: Logarithm of the first frame minus each pixel's reference; default 0.
        refractory_s: Time for which a pixel is held in reset after an event [s]; see
            `reset_events`. By default it is not.
        darkest: Floor of float frames, as a fraction of full scale (`darkest_of`). The
            floor of grey values is that of `table`.
        workers: Threads, each for a strip of rows; by default one per core.

    Raises:
        InputError: Times do not rise, a frame has another size than the first, light is
            not finite, or a threshold is not positive.
    """
    check_thresholds(thresholds)
    table = grey_table() if table is None else table
    workers = workers or os.cpu_count() or 1
    strips: list[Strip] = []
    found: list[Found] = []
    width, shape, time, seen = 0, (), -np.inf, 0
    with ThreadPoolExecutor(workers) as pool:
        for times, frames in blocks:
            if not len(times):
                continue
            shape = shape or frames.shape[1:]
            falls = np.flatnonzero(~(np.diff(times, prepend=time) > 0.0))
            if falls.size:
                raise InputError(
                    "frames: expected times that rise from frame to frame, got "
                    f"{times[falls[0]]:g} s at frame {seen + falls[0]}"
                )
            if frames.shape[1:] != shape:
                raise InputError(
                    f"frames: expected {shape[1]} x {shape[0]} pixels as in the "
                    f"first, got {frames.shape[2]} x {frames.shape[1]}"
                )
            check_light(frames, seen)
            time, width, seen = times[-1], shape[1], seen + len(times)
            if not strips:
                options = table, in_logarithms, refractory_s, darkest
                begun = np.zeros(shape[:2]) if begun is None else begun
                strips = _strips(shape, thresholds, begun, options, workers)
            jobs = [
                pool.submit(strip.advance, times, strip.rows_of(frames))
                for strip in strips
            ]
            if found:  # sorted on this thread while the workers count the next block
                yield gathered(found, width)
            found = [job.result() for job in jobs]
        if found:
            yield gathered(found, width)


class Found(NamedTuple):
    """Unordered events.

    Attributes:
        pixel: Row times width plus column.
        time: Time [s].
        sign: +1 brighter, -1 darker.
    """

    pixel: Int[np.ndarray, " event"]
    time: Float[np.ndarray, " event"]
    sign: Int[np.ndarray, " event"]


class Strip:
    """Rows of the image; `advance` processes their next frames."""

    def __init__(
        self,
        rows: slice,
        width: int,
        thresholds,
        begun: Float[np.ndarray, "height width"],
        table: Float[np.ndarray, "256"],
        in_logarithms: bool,
        refractory_s: float | None,
        darkest: float,
    ):
        """Store the constants; see `stream_events`."""
        self.rows, self.table, self.in_logarithms = rows, table, in_logarithms
        self.begun, self.refractory_s = begun.ravel(), refractory_s
        self.darkest = darkest
        self.offset = rows.start * width
        self.positive, self.negative = (t.ravel() for t in thresholds)
        self.last: np.ndarray | None = None

    def start(self, time: float, values: np.ndarray) -> None:
        """Set the reference from the first frame, which causes no event."""
        self.time, self.last = time, values
        self.first = self.log(values) - self.begun
        self.until = np.full(values.shape, -np.inf)
        self.up = np.zeros(values.shape, np.int32)
        self.down = np.zeros(values.shape, np.int32)
        self.lowest, self.highest = self.bounds(np.arange(values.size))

    def log(self, values: np.ndarray) -> Float[np.ndarray, "..."]:
        """Return the logarithm of the light of image values."""
        if values.dtype == np.uint8:
            return self.table[values]
        values = values.astype(float)
        return (
            values if self.in_logarithms else np.log(np.maximum(values, self.darkest))
        )

    def bounds(self, at: Int[np.ndarray, " pixel"]) -> tuple[np.ndarray, np.ndarray]:
        """Return bounds of the values within which some pixels certainly stay quiet.

        Rounding may make them too narrow: such a pixel is then followed needlessly.
        """
        assert self.last is not None
        up, down = self.up[at] * self.positive[at], self.down[at] * self.negative[at]
        level = self.first[at] + up - down
        above, below = level + self.positive[at], level - self.negative[at]
        dtype = self.last.dtype
        if dtype == np.uint8:
            # the table's darkest value has the largest logarithm, so its margin serves
            # all
            slack = rounding(self.table[:1], np)
            highest = np.searchsorted(self.table, above - slack, side="left") - 1
            lowest = np.searchsorted(self.table, below + slack, side="right")
            return lowest.astype(np.uint8), highest.astype(np.uint8)
        close = 16.0 * np.finfo(dtype).eps * (1.0 + np.abs(level))
        highest, lowest = above - close, below + close
        if not self.in_logarithms:
            # light below the floor counts as the floor, and causes no event
            floor = np.log(self.darkest)
            lowest = np.where(below < floor - close, -np.inf, np.exp(lowest))
            highest = np.exp(highest)
        return lowest.astype(dtype), highest.astype(dtype)

    def advance(self, times: Float[np.ndarray, " frame"], block: np.ndarray) -> Found:
        """Return the events of the next frames, one row of `block` per frame."""
        if self.last is None:
            self.start(float(times[0]), block[0].copy())
        assert self.last is not None
        at, values, last = self.loud(block)
        # logarithms of the few loud pixels only
        logs = self.log(np.vstack([self.last[at], values]))
        found = self.follow(at, np.append(self.time, times), logs)
        self.time, self.last = float(times[-1]), last
        self.lowest[at], self.highest[at] = self.bounds(at)
        held = at[self.until[at] > self.time]
        # bounds that no value satisfies: followed until their reference is known
        whole = last.dtype == np.uint8
        self.lowest[held], self.highest[held] = (255, 0) if whole else (np.inf, -np.inf)
        return found

    def rows_of(self, frames: np.ndarray) -> np.ndarray:
        """Return the values of these rows, one row per frame."""
        return frames[:, self.rows].reshape(len(frames), -1)

    def loud(self, block: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the pixels that may send events, their values, and all last values."""
        at = np.flatnonzero(self.leaves_bounds(block, slice(None)))
        return at, block[:, at], block[-1].copy()

    def leaves_bounds(self, values: np.ndarray, at) -> np.ndarray:
        """Return the mask of pixels that leave their quiet bounds."""
        high, low = values.max(axis=0), values.min(axis=0)
        return (high > self.highest[at]) | (low < self.lowest[at])

    def follow(self, at, times, logs) -> Found:
        """Follow some pixels frame by frame, and return their events."""
        if not len(at):
            return Found(at, np.empty(0), at)
        if self.refractory_s is None:
            interval, lane, crossed, first, pace = self.crossed(at, times, logs)
        else:
            interval, lane, crossed, first, pace = self.held(at, times, logs)
        number = np.abs(crossed)
        ends = np.cumsum(number)
        nth = np.arange(number.sum()) - np.repeat(ends - number, number)
        time = np.repeat(first, number) + nth * np.repeat(pace, number)
        start, stop = np.repeat(times[interval], number), times[interval + 1]
        # rounding may place a crossing just outside its interval
        time = np.clip(time, start, np.repeat(stop, number))
        pixel = np.repeat(at[lane] + self.offset, number)
        return Found(pixel, time, np.repeat(np.sign(crossed), number))

    def crossed(self, at, times, logs):
        """Follow pixels without refractory period.

        Returns:
            Intervals and lanes with events, their signed number, the time of the first,
            and the time from one to the next [s].
        """
        state = [widened(v[at]) for v in (self.first, self.up, self.down)]
        steps = [self.positive[at], self.negative[at]]
        both = [widened(step) for step in steps]
        with jax.enable_x64(True):
            answer = _count(widened(logs), both, state)
            counts, levels, up, down = (np.asarray(v)[..., : len(at)] for v in answer)
        self.up[at], self.down[at] = up, down
        interval, lane = np.nonzero(counts)
        crossed = counts[interval, lane]
        before, after = logs[interval, lane], logs[interval + 1, lane]
        pace = (times[interval + 1] - times[interval]) / (after - before)
        step = np.where(crossed > 0, steps[0][lane], -steps[1][lane])
        first = times[interval] + (levels[interval, lane] + step - before) * pace
        return interval, lane, crossed, first, step * pace

    def held(self, at, times, logs):
        """Follow pixels with refractory period; returns as `crossed`."""
        state = [widened(v[at]) for v in (self.first, self.until)]
        both = [widened(step[at]) for step in (self.positive, self.negative)]
        with jax.enable_x64(True):
            answer = _reset(widened(logs), times, both, self.refractory_s, state)
            runs, state = (
                [np.asarray(v)[..., : len(at)] for v in part] for part in answer
            )
        self.first[at], self.until[at] = state
        interval, lane = np.nonzero(runs[0])
        return interval, lane, *(v[interval, lane] for v in runs)


def _strips(shape, thresholds, begun, options, workers) -> list[Strip]:
    """Return strips of rows of the image, one per worker."""
    height, width = shape[:2]
    both = [np.broadcast_to(np.asarray(t, float), (height, width)) for t in thresholds]
    # NumPy and XLA release the interpreter lock, so threads suffice
    edges = np.linspace(0, height, min(workers, height) + 1).astype(int)
    strips = []
    for a, b in pairwise(edges):
        steps = both[0][a:b], both[1][a:b]
        strips.append(Strip(slice(a, b), width, steps, begun[a:b], *options))
    return strips


def gathered(found: Sequence[Found], width: int) -> Events:
    """Return the events of all strips, ordered by time, then by pixel."""
    pixel, time, sign = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.argsort(time)
    # ties by pixel: two sorts of one key each are several times faster than lexsort
    run = np.cumsum(np.diff(time[order], prepend=-np.inf) != 0.0)
    key = run * (1 + pixel.max(initial=0)) + pixel[order]
    order = order[np.argsort(key)]
    y, x = np.divmod(pixel[order], width)
    count, lost = np.asarray(len(order)), np.asarray(0)
    return Events(x, y, time[order], sign[order], count, lost)


def padded_size(count: int) -> int:
    """Return the next power of two, at least 256, so that few programs are compiled."""
    return max(256, 1 << (count - 1).bit_length())


def widened(values: np.ndarray) -> np.ndarray:
    """Return values with the last lane repeated up to `padded_size`."""
    size = values.shape[-1]
    # written out: a tenth of the time of `np.pad`
    wide = np.empty((*values.shape[:-1], padded_size(size)), values.dtype)
    wide[..., :size], wide[..., size:] = values, values[..., -1:]
    return wide


@jax.jit
def _count(logs, thresholds, state):
    """Count events; see `count_events`."""
    counts, levels, after = count_events(logs, tuple(thresholds), Reference(*state))
    return counts, levels, after.up, after.down


@jax.jit
def _reset(logs, times, thresholds, refractory_s, state):
    """Return events and state of pixels that are held; see `reset_runs`."""
    held = Held(*state)
    runs, held = reset_runs(logs, times, tuple(thresholds), refractory_s, held)
    return (runs.count, runs.first, runs.pace), (held.level, held.until)
