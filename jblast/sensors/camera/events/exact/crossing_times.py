"""Events without frames: of light that is a function of time.

Each pixel's logarithm of light is cut into monotone pieces; the thresholds that a piece
crosses are counted as between two frames, and each crossing is solved for on the
function itself. So its time does not depend on how far apart the first samples lie.
"""

import functools

import jax
import numpy as np
from jaxtyping import ArrayLike, Float, Int

from jblast.errors import InputError
from jblast.progress import counted
from jblast.sensors.camera.events.exact.light_curve import (
    LogLight,
    in_lanes,
    sample,
    solve_crossings,
)
from jblast.sensors.camera.events.exact.monotone import Knots, monotone_knots
from jblast.sensors.camera.events.ideal import Events
from jblast.sensors.camera.events.pixel import check_thresholds, crossings, rounding
from jblast.sensors.camera.events.stream import gathered
from jblast.sensors.camera.events.strip import Found

AT_ONCE = 1 << 18
"""First samples of the pixels that are in memory at a time."""


def frameless_events(
    log_light: LogLight,
    shape: tuple[int, int],
    times: Float[np.ndarray, " time"],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    *,
    tolerance: float = 1e-9,
    pixels: Int[np.ndarray, " _"] | None = None,
) -> Events:
    """Return what an ideal event camera sends of light known at every time.

    It runs on the host and in float64. A pytree as `log_light`, such as
    `jax.tree_util.Partial`, is compiled once for all its numbers.

    Args:
        log_light: The scene; differentiable in time but at single instants.
        shape: Height and width [px].
        times: The first and the last bound the search; those between say how close
            together light is sampled at first [s]. An excursion shorter than half of
            that may be missed, as may one of under 1 % of a threshold.
        thresholds: Positive and negative, as positive numbers; one for all pixels or
            an array (height, width).
        tolerance: Of the times of events [s].
        pixels: Those whose light changes, row times width plus column; all by default.

    Raises:
        InputError: Times do not rise or are not finite, light is not finite, or a
            threshold is not positive.
    """
    check_thresholds(thresholds)
    times = np.asarray(times, float)
    rise = len(times) > 1 and bool((np.diff(times) > 0.0).all())
    if not (rise and np.isfinite(times).all()):
        raise InputError("times: expected two or more that rise")
    if pixels is None:
        pixels = np.arange(shape[0] * shape[1])
    both = [
        np.broadcast_to(np.asarray(threshold, float), shape).ravel()
        for threshold in thresholds
    ]
    tolerance = max(tolerance, float(np.spacing(np.abs(times).max())))
    each = max(1, AT_ONCE // len(times))
    found, done = [Found(pixels[:0], np.empty(0), pixels[:0])], 0
    through = counted(len(pixels), "pixels")
    with jax.enable_x64(True):
        for at in np.array_split(pixels, max(1, -(-len(pixels) // each))):
            if len(at):
                here = [b[at] for b in both]
                found.append(_found(log_light, shape[1], at, times, here, tolerance))
                done += len(at)
                through(done)
    return gathered(found, shape[1])


def _found(log_light, width: int, at, times, both, tolerance: float) -> Found:
    """Return the events of some pixels."""
    row, column = np.divmod(at, width)

    def curve(pixel, time) -> Knots:
        run = functools.partial(sample, log_light)
        value, slope = in_lanes(run, time, column[pixel], row[pixel])
        if not np.isfinite(value).all():
            n = int(np.argmin(np.isfinite(value)))
            raise InputError(
                f"light: expected the logarithm of light to be finite, got {value[n]} "
                f"at row {row[pixel][n]}, column {column[pixel][n]}, {time[n]:g} s"
            )
        return Knots(pixel, time, value, slope)

    knots = _moving(monotone_knots(curve, times, np.minimum(*both), tolerance), both)
    crossed, level = _walk(knots, both)
    piece = np.flatnonzero(crossed)
    number, sign = np.abs(crossed[piece]), np.sign(crossed[piece])
    nth = np.arange(1, number.sum() + 1) - np.repeat(np.cumsum(number) - number, number)
    piece, sign = np.repeat(piece, number), np.repeat(sign, number)
    pixel = knots.pixel[piece]
    step = np.where(sign > 0, both[0][pixel], -both[1][pixel])
    time = in_lanes(
        functools.partial(solve_crossings, log_light),
        *(knots.time[piece - 1], knots.time[piece], level[piece] + nth * step, sign),
        *(column[pixel], row[pixel], np.full(pixel.shape, tolerance)),
    )[0]
    return Found(at[pixel], time, sign)


def _moving(knots: Knots, both) -> Knots:
    """Return the knots of pixels whose light changes by a threshold."""
    begin = np.flatnonzero(np.diff(knots.pixel, prepend=-1))
    least = np.minimum.reduceat(knots.value, begin)
    most = np.maximum.reduceat(knots.value, begin)
    limit = np.minimum(*both) - rounding(np.maximum(np.abs(least), np.abs(most)), np)
    return knots.at((most - least >= limit)[knots.pixel])


def _walk(knots: Knots, both) -> tuple[Int[np.ndarray, " _"], Float[np.ndarray, " _"]]:
    """Return the thresholds crossed from the knot before to each, and the level then.

    One knot of every pixel at a time.
    """
    begin = np.flatnonzero(np.diff(knots.pixel, prepend=-1))
    length = np.diff(begin, append=knots.pixel.size)
    begin, length = (v[np.argsort(-length, kind="stable")] for v in (begin, length))
    positive, negative = (threshold[knots.pixel[begin]] for threshold in both)
    first = knots.value[begin]
    ups, downs = np.zeros((2, begin.size), np.int32)
    crossed = np.zeros(knots.pixel.size, np.int32)
    levels = np.zeros(knots.pixel.size)
    for k in range(1, int(length.max(initial=0))):
        size = int(np.searchsorted(-length, -k))  # so many are longer than k
        part = slice(size)
        there = begin[part] + k
        up, down = ups[part], downs[part]
        here = positive[part], negative[part]
        level = first[part] + (up - down) * here[0] + down * (here[0] - here[1])
        count = crossings(knots.value[there], level, here, np)
        up += np.maximum(count, 0)
        down -= np.minimum(count, 0)
        crossed[there], levels[there] = count, level
    return crossed, levels
