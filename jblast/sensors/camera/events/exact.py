"""Events without frames, of light that is a function of time.

Each pixel's logarithm of light is cut into monotone segments. The thresholds that a
segment crosses are counted as between two frames, and each crossing is solved for on
the function itself. Its time therefore does not depend on the spacing of the first
samples.

A segment between two times is compared in its middle with the cubic that has its values
and slopes at both ends (Hermite). Where they differ the segment is halved, until they
agree or it is shorter than the tolerance, as at a jump. A segment whose slopes have
opposite signs is cut at its extremum. One whose cubic may still turn twice (a slope of
more than three times the mean) is halved too.

Event times have gradients by the implicit function theorem: the derivative of a
crossing is that of the level minus the light, over the slope of the light.

References:
    Fritsch and Carlson (1980), Monotone piecewise cubic interpolation, SIAM Journal on
    Numerical Analysis 17, 238-246, read second-hand.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from jblast.errors import InputError
from jblast.progress import counted
from jblast.sensors.camera.events.ideal import (
    Events,
    check_thresholds,
    crossings,
    rounding,
)
from jblast.sensors.camera.events.stream import Found, gathered

SAMPLES_IN_MEMORY = 1 << 18
"""First samples of the pixels in memory together: 2 MB per float64 field."""
LogLight = Callable[
    [Float[Array, " at"], Float[Array, " at"], Float[Array, " at"]],
    Float[Array, " at"],
]
"""Logarithm of the light at times [s], columns and rows: one point for each time."""
SIZES = (1 << 16, 1 << 12, 1 << 8)
"""Numbers of points that are evaluated in one call: each compiles a program, and a call
is padded to the last. Few sizes compile less, more sizes pad less."""
ACCEPTED_MISFIT = 0.01
"""Accepted difference of a segment from its cubic, as a share of the smaller threshold:
an excursion below it causes no event unless the level is that close."""
FLAT = 1e-3
"""Change of a segment, as a share of the smaller threshold, below which its monotony
does not matter."""
EPS = float(np.finfo(float).eps)
"""Rounding of float64: extrema are not refined below it."""


def frameless_events(
    log_light: LogLight,
    shape: tuple[int, int],
    times: Float[np.ndarray, " time"],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    *,
    tolerance: float = 1e-9,
    pixels: Int[np.ndarray, " _"] | None = None,
) -> Events:
    """Return the events of an ideal camera for light known at every time.

    It runs on the host and in float64. A pytree as `log_light`, such as
    `jax.tree_util.Partial`, is compiled once for all its numbers.

    Args:
        log_light: The scene; differentiable in time except at single instants.
        shape: Height and width [px].
        times: First samples of light [s]; the first and the last bound the search. An
            excursion shorter than half of their spacing may be missed, as may one of
            under 1 % of a threshold.
        thresholds: Positive and negative, as positive numbers; one for all pixels or
            an array (height, width).
        tolerance: Tolerance of the times of events [s].
        pixels: Pixels whose light changes, row times width plus column; default: all.

    Raises:
        InputError: Times do not rise or are not finite, light is not finite, or a
            threshold is not positive.
    """
    check_thresholds(thresholds)
    times = np.asarray(times, float)
    if len(times) < 2:
        raise InputError(f"times: expected two or more, got {len(times)}")
    rises = np.isfinite(times) & (np.diff(times, prepend=-np.inf) > 0.0)
    if not rises.all():
        n = int(np.argmin(rises))
        raise InputError(
            f"times: expected finite rising times, got {times[n]:g} s at index {n}"
        )
    if pixels is None:
        pixels = np.arange(shape[0] * shape[1])
    both = [
        np.broadcast_to(np.asarray(threshold, float), shape).ravel()
        for threshold in thresholds
    ]
    # no finer than the spacing of float64 at the largest time
    tolerance = max(tolerance, float(np.spacing(np.abs(times).max())))
    each = max(1, SAMPLES_IN_MEMORY // len(times))
    found, done = [Found(pixels[:0], np.empty(0), pixels[:0])], 0
    through = counted(len(pixels), "pixels")
    # event times to 1e-9 s on clocks of seconds need float64
    with jax.enable_x64(True):
        for at in np.array_split(pixels, max(1, -(-len(pixels) // each))):
            if len(at):
                here = [b[at] for b in both]
                found.append(
                    _pixel_events(log_light, shape[1], at, times, here, tolerance)
                )
                done += len(at)
                through(done)
    return gathered(found, shape[1])


def _pixel_events(log_light, width: int, at, times, both, tolerance: float) -> Found:
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

    knots = _changing_pixels(
        monotone_knots(curve, times, np.minimum(*both), tolerance), both
    )
    crossed, level = _walk(knots, both)
    piece = np.flatnonzero(crossed)
    number, sign = np.abs(crossed[piece]), np.sign(crossed[piece])
    # running number of each event within its segment, from 1
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


class Knots(NamedTuple):
    """Points on the curves of several pixels.

    Attributes:
        pixel: Index of the pixel.
        time: Time [s].
        value: Value of the curve.
        slope: Derivative of the curve in time [1/s].
    """

    pixel: Int[np.ndarray, " knot"]
    time: Float[np.ndarray, " knot"]
    value: Float[np.ndarray, " knot"]
    slope: Float[np.ndarray, " knot"]

    def at(self, which: Bool[np.ndarray, " knot"] | Int[np.ndarray, " _"]) -> "Knots":
        """Return selected knots."""
        return Knots(*(field[which] for field in self))


def _changing_pixels(knots: Knots, both) -> Knots:
    """Return the knots of pixels whose light changes by a threshold."""
    begin = np.flatnonzero(np.diff(knots.pixel, prepend=-1))
    least = np.minimum.reduceat(knots.value, begin)
    most = np.maximum.reduceat(knots.value, begin)
    # same margin as in `crossings`, so that no pixel with an event is dropped
    limit = np.minimum(*both) - rounding(np.maximum(np.abs(least), np.abs(most)), np)
    return knots.at((most - least >= limit)[knots.pixel])


def _walk(knots: Knots, both) -> tuple[Int[np.ndarray, " _"], Float[np.ndarray, " _"]]:
    """Return the thresholds crossed since the knot before, and the level at its start.

    The loop goes over the knots of a pixel, all pixels together.
    """
    begin = np.flatnonzero(np.diff(knots.pixel, prepend=-1))
    length = np.diff(begin, append=knots.pixel.size)
    # longest pixels first: at knot k all pixels with more knots are a leading slice
    begin, length = (v[np.argsort(-length, kind="stable")] for v in (begin, length))
    positive, negative = (threshold[knots.pixel[begin]] for threshold in both)
    first = knots.value[begin]
    ups, downs = np.zeros((2, begin.size), np.int32)
    crossed = np.zeros(knots.pixel.size, np.int32)
    levels = np.zeros(knots.pixel.size)
    for k in range(1, int(length.max(initial=0))):
        size = int(np.searchsorted(-length, -k))  # number of pixels with more knots
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


def value_and_slope(log_light: LogLight, time, x, y):
    """Return the logarithm of light and its derivative in time [1/s]."""
    return jax.jvp(lambda t: log_light(t, x, y), (time,), (jnp.ones_like(time),))


sample = eqx.filter_jit(value_and_slope)


def in_lanes(run, *fields: np.ndarray) -> tuple[np.ndarray, ...]:
    """Run on arrays of three sizes only, so that three programs are compiled."""
    size = fields[0].size
    if not size:
        return np.empty(0), np.empty(0)
    parts, begin = [], 0
    while begin < size:
        # largest size that is filled; the rest is padded to the smallest
        lanes = next((n for n in SIZES if n <= size - begin), SIZES[-1])
        part = [np.asarray(field[begin : begin + lanes], float) for field in fields]
        kept = len(part[0])
        padded = [np.pad(field, (0, lanes - kept), mode="edge") for field in part]
        answer = run(*(jnp.asarray(field) for field in padded))
        parts.append([np.asarray(v, float)[:kept] for v in answer])
        begin += lanes
    return tuple(np.concatenate(field) for field in zip(*parts, strict=True))


@eqx.filter_jit
def solve_crossings(log_light, low, high, level, sign, x, y, tolerance):
    """Solve for crossings of monotone segments: Newton with bisection as safeguard."""

    def unfinished(state):
        return state[-1].any()

    def step(state):
        *old, unfinished = state
        low, high, time, last, before = old
        value, slope = value_and_slope(log_light, time, x, y)
        # before the crossing: the lower bound moves up
        short = sign * (value - level) < 0.0
        low, high = jnp.where(short, time, low), jnp.where(short, high, time)
        move = (level - value) / jnp.where(slope == 0.0, jnp.inf, slope)
        new = time + move
        # Steps that halve every second time converge faster than bisection; otherwise
        # the interval is bisected, so that the loop always ends (Brent's safeguard).
        good = (new > low) & (new < high) & (jnp.abs(move) < 0.5 * before)
        new = jnp.where(good & (slope != 0.0), new, 0.5 * (low + high))
        length = jnp.abs(new - time)
        state = (low, high, new, length, last)
        kept = (jnp.where(unfinished, a, b) for a, b in zip(state, old, strict=True))
        return *kept, unfinished & (length > tolerance)

    size = high - low
    state = (low, high, 0.5 * (low + high), size, size, size > tolerance)
    return jax.lax.while_loop(unfinished, step, state)[2:3]


Curve = Callable[[Int[np.ndarray, " knot"], Float[np.ndarray, " knot"]], Knots]
"""From pixels and times to knots."""


def monotone_knots(
    curve: Curve,
    times: Float[np.ndarray, " time"],
    small: Float[np.ndarray, " pixel"],
    tolerance: float,
) -> Knots:
    """Return knots between which each pixel's curve is monotone.

    An excursion that changes neither the ends nor the middle of a segment is missed.
    The first segments are those between the given times.

    Args:
        curve: Values and slopes of pixels 0 to n - 1.
        times: First knots of every pixel [s], rising.
        small: Smaller threshold of each pixel: the change that matters.
        tolerance: Shortest segment that is cut [s].

    Returns:
        Knots by pixel, and then by time.
    """
    shape = len(small), len(times)
    pixel = np.repeat(np.arange(shape[0]), shape[1])
    first = curve(pixel, np.tile(times, shape[0]))
    place = np.arange(pixel.size).reshape(shape)
    left, right = first.at(place[:, :-1].ravel()), first.at(place[:, 1:].ravel())
    found = [first]
    while left.pixel.size:
        middle = curve(left.pixel, 0.5 * (left.time + right.time))
        limit = small[left.pixel]
        smooth = _misfit(left, middle, right) <= ACCEPTED_MISFIT * limit
        short = right.time - left.time <= 2.0 * tolerance
        again, kept = [], short
        for a, b in ((left, middle), (middle, right)):
            turns = smooth & (a.slope * b.slope < 0.0)
            found.append(_extrema(curve, a.at(turns), b.at(turns), tolerance))
            more = ~short & ~turns & ~(smooth & _is_monotone(a, b, limit))
            again.append((a.at(more), b.at(more)))
            kept = kept | turns | more
        found.append(middle.at(kept))
        left, right = (_joined(part) for part in zip(*again, strict=True))
    knots = _joined(found)
    return knots.at(np.lexsort((knots.time, knots.pixel)))


def _joined(parts) -> Knots:
    return Knots(*(np.concatenate(field) for field in zip(*parts, strict=True)))


def _misfit(a: Knots, middle: Knots, b: Knots) -> Float[np.ndarray, " knot"]:
    """Return the deviation of the middle from the cubic of the ends, slope included."""
    length, rise = b.time - a.time, b.value - a.value
    # Hermite cubic and its slope at the middle
    value = 0.5 * (a.value + b.value) + length / 8.0 * (a.slope - b.slope)
    slope = 1.5 * rise / length - 0.25 * (a.slope + b.slope)
    off = np.abs(middle.value - value)
    return np.maximum(off, length / 8.0 * np.abs(middle.slope - slope))


def _is_monotone(a: Knots, b: Knots, small) -> Bool[np.ndarray, " knot"]:
    """Return True if the cubic of the ends is monotone, or does not matter."""
    length, rise = b.time - a.time, b.value - a.value
    steep = np.maximum(np.abs(a.slope), np.abs(b.slope)) * length
    # sufficient condition of Fritsch and Carlson: no slope above three times the mean
    along = (a.slope * rise >= 0.0) & (b.slope * rise >= 0.0)
    return (along & (steep <= 3.0 * np.abs(rise))) | (steep <= FLAT * small)


def _extrema(curve: Curve, a: Knots, b: Knots, tolerance: float) -> Knots:
    """Return the knots at which slopes change sign, by bisection of each segment."""
    while True:
        length = b.time - a.time
        # near an extremum the curve is off by at most the slope times the distance
        rest = np.minimum(np.abs(a.slope), np.abs(b.slope)) * length
        unfinished = (length > tolerance) & (rest > EPS * (1.0 + np.abs(a.value)))
        if not unfinished.any():
            return a
        middle = curve(a.pixel, 0.5 * (a.time + b.time))
        # same sign as at the start: the extremum is in the second half
        before = middle.slope * a.slope > 0.0
        a, b = (
            Knots(*(np.where(to, m, f) for m, f in zip(middle, knots, strict=True)))
            for to, knots in ((before, a), (~before, b))
        )


def implicit_times(
    log_light: LogLight,
    events: Events,
    start: Float[ArrayLike, ""],
    thresholds: tuple[Float[ArrayLike, ""], Float[ArrayLike, ""]],
) -> Float[Array, " event"]:
    r"""Return the times of solved events as functions of the scene, for gradients.

    One step of Newton on $L(t) = L(t_0) + u C_+ - d C_-$, with u and d the events of
    the pixel so far: the value is unchanged, and its derivative is that of the
    crossing. A crossing with zero slope of the light has none: infinite or NaN.

    Args:
        log_light: The scene, at the values for which the events were found.
        events: All events of `frameless_events`, in their order.
        start: The first of its times [s].
        thresholds: One each for all pixels.
    """
    up, down = (jnp.asarray(v) for v in _sent_counts(events))
    x, y, time = (jnp.asarray(v, float) for v in (events.x, events.y, events.time))
    positive, negative = thresholds
    begin = log_light(jnp.full_like(time, start), x, y)
    level = begin + up * positive - down * negative
    value, slope = value_and_slope(log_light, time, x, y)
    return time - (value - level) / jax.lax.stop_gradient(slope)


def _sent_counts(events: Events) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of a pixel's events of each sign so far, at each event."""
    y, x = np.asarray(events.y), np.asarray(events.x)
    # by pixel, then in order of time, which `events` already has
    order = np.lexsort((np.arange(y.size), x, y))
    sign = np.asarray(events.polarity)[order]
    new = np.append(True, (np.diff(x[order]) != 0) | (np.diff(y[order]) != 0))[: y.size]
    first = np.maximum.accumulate(np.where(new, np.arange(y.size), 0))
    counts = []
    for one in (sign > 0, sign < 0):
        total = np.cumsum(one)
        sent = np.empty(y.size)
        sent[order] = total - (total - one)[first]
        counts.append(sent)
    return counts[0], counts[1]
