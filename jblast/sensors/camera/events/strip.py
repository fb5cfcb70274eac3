"""Some rows of an event camera, and what their pixels remember between blocks."""

from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float, Int

from jblast.sensors.camera.events.pixel import Reference, count_events, rounding
from jblast.sensors.camera.events.reset_pixel import Held, reset_runs


class Found(NamedTuple):
    """Events in no order.

    Attributes:
        pixel: Row times width plus column.
        time: Seconds.
        sign: +1 brighter, -1 darker.
    """

    pixel: Int[np.ndarray, " event"]
    time: Float[np.ndarray, " event"]
    sign: Int[np.ndarray, " event"]


class Strip:
    """Rows of the image; `advance` takes their next frames."""

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
        """Take what does not change; see `stream_events`."""
        self.rows, self.table, self.in_logarithms = rows, table, in_logarithms
        self.begun, self.refractory_s = begun.ravel(), refractory_s
        self.darkest = darkest
        self.offset = rows.start * width
        self.positive, self.negative = (t.ravel() for t in thresholds)
        self.last: np.ndarray | None = None

    def start(self, time: float, values: np.ndarray) -> None:
        """See the first frame: it sets the reference and gives no event."""
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
        """Return the least and greatest value at which some pixels surely stay quiet.

        They may be too narrow by rounding: such a pixel is followed for nothing.
        """
        assert self.last is not None
        up, down = self.up[at] * self.positive[at], self.down[at] * self.negative[at]
        level = self.first[at] + up - down
        above, below = level + self.positive[at], level - self.negative[at]
        dtype = self.last.dtype
        if dtype == np.uint8:
            slack = rounding(self.table[:1], np)
            highest = np.searchsorted(self.table, above - slack, side="left") - 1
            lowest = np.searchsorted(self.table, below + slack, side="right")
            return lowest.astype(np.uint8), highest.astype(np.uint8)
        close = 16.0 * np.finfo(dtype).eps * (1.0 + np.abs(level))
        highest, lowest = above - close, below + close
        if not self.in_logarithms:
            # light below the floor is as dark as the floor, and no event
            floor = np.log(self.darkest)
            lowest = np.where(below < floor - close, -np.inf, np.exp(lowest))
            highest = np.exp(highest)
        return lowest.astype(dtype), highest.astype(dtype)

    def advance(self, times: Float[np.ndarray, " frame"], block: np.ndarray) -> Found:
        """Return the events of the next frames, each a row of `block`."""
        if self.last is None:
            self.start(float(times[0]), self.values(block[0]))
        assert self.last is not None
        at, values, last = self.loud(block)
        logs = self.log(np.vstack([self.last[at], values]))
        found = self.follow(at, np.append(self.time, times), logs)
        self.time, self.last = float(times[-1]), last
        self.lowest[at], self.highest[at] = self.bounds(at)
        held = at[self.until[at] > self.time]  # followed until the reference is known
        whole = last.dtype == np.uint8
        self.lowest[held], self.highest[held] = (255, 0) if whole else (np.inf, -np.inf)
        return found

    def rows_of(self, frames: np.ndarray) -> np.ndarray:
        """Return the values of these rows, a row for each frame."""
        return frames[:, self.rows].reshape(len(frames), -1)

    def values(self, frame: np.ndarray) -> np.ndarray:
        """Return the image values of the first frame."""
        return frame.copy()

    def loud(self, block: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the pixels that may send events, their values, the last of all."""
        at = np.flatnonzero(self.leaves_bounds(block, slice(None)))
        return at, block[:, at], block[-1].copy()

    def leaves_bounds(self, values: np.ndarray, at) -> np.ndarray:
        """Return which of some pixels leave the bounds within which they are quiet."""
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
        time = np.clip(time, start, np.repeat(stop, number))
        pixel = np.repeat(at[lane] + self.offset, number)
        return Found(pixel, time, np.repeat(np.sign(crossed), number))

    def crossed(self, at, times, logs):
        """Follow pixels that are never held.

        Returns:
            Intervals and lanes in which there are events, how many of which sign, when
            the first of them is sent, and the time from one to the next [s].
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
        """Follow pixels that are held after an event; returns as `crossed`."""
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


def widened(values: np.ndarray) -> np.ndarray:
    """Repeat the last lane until there are 256 or another power of two.

    Few programs are compiled so; and it takes a tenth of the time of `np.pad`.
    """
    size = values.shape[-1]
    wide = np.empty(
        (*values.shape[:-1], max(256, 1 << (size - 1).bit_length())), values.dtype
    )
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
