r"""A function of time, cut where it turns: between neighbouring cuts it is monotone.

A piece between two times is compared in its middle with the cubic that has the piece's
values and slopes at both ends (Hermite). Where they differ the piece is halved, until
they agree or it is shorter than the tolerance, as at a jump. A piece whose slopes have
opposite signs is cut at its extremum. One whose cubic may still turn twice (a slope of
more than three times the mean) is halved too.

References:
    Fritsch and Carlson (1980), Monotone piecewise cubic interpolation, SIAM Journal on
    Numerical Analysis 17, 238-246, read second-hand.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

AGREES = 0.01
"""A piece may differ from its cubic by this share of what is small."""
FLAT = 1e-3
"""A change by less than this share of what is small is none."""
EPS = float(np.finfo(float).eps)


class Knots(NamedTuple):
    """Points on the curves of several pixels.

    Attributes:
        pixel: Whose.
        time: Seconds.
        value: Of the curve.
        slope: Its derivative in time [1/s].
    """

    pixel: Int[np.ndarray, " knot"]
    time: Float[np.ndarray, " knot"]
    value: Float[np.ndarray, " knot"]
    slope: Float[np.ndarray, " knot"]

    def at(self, which: Bool[np.ndarray, " knot"] | Int[np.ndarray, " _"]) -> "Knots":
        """Return some of them."""
        return Knots(*(field[which] for field in self))


Curve = Callable[[Int[np.ndarray, " knot"], Float[np.ndarray, " knot"]], Knots]
"""From pixels and times to knots."""


def monotone_knots(
    curve: Curve,
    times: Float[np.ndarray, " time"],
    small: Float[np.ndarray, " pixel"],
    tolerance: float,
) -> Knots:
    """Return knots between which each pixel's curve is monotone.

    What is missed: an excursion that neither the ends nor the middle of a piece feel.
    The pieces looked at first last from one of the times to the next.

    Args:
        curve: Values and slopes of pixels 0 to n - 1.
        times: First knots of every pixel [s], rising.
        small: The change of each pixel that matters: its smaller threshold.
        tolerance: Shortest piece that is cut [s].

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
        smooth = _misfit(left, middle, right) <= AGREES * limit
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
    """Return how far the middle is off the cubic of the ends, its slope included."""
    length, rise = b.time - a.time, b.value - a.value
    value = 0.5 * (a.value + b.value) + length / 8.0 * (a.slope - b.slope)
    slope = 1.5 * rise / length - 0.25 * (a.slope + b.slope)
    off = np.abs(middle.value - value)
    return np.maximum(off, length / 8.0 * np.abs(middle.slope - slope))


def _is_monotone(a: Knots, b: Knots, small) -> Bool[np.ndarray, " knot"]:
    """Return whether the cubic of the ends is monotone, or does not matter."""
    length, rise = b.time - a.time, b.value - a.value
    steep = np.maximum(np.abs(a.slope), np.abs(b.slope)) * length
    along = (a.slope * rise >= 0.0) & (b.slope * rise >= 0.0)
    return (along & (steep <= 3.0 * np.abs(rise))) | (steep <= FLAT * small)


def _extrema(curve: Curve, a: Knots, b: Knots, tolerance: float) -> Knots:
    """Return where slopes change their sign, by bisection of each piece."""
    while True:
        length = b.time - a.time
        # beside an extremum the curve is off by the slope times the distance
        rest = np.minimum(np.abs(a.slope), np.abs(b.slope)) * length
        going = (length > tolerance) & (rest > EPS * (1.0 + np.abs(a.value)))
        if not going.any():
            return a
        middle = curve(a.pixel, 0.5 * (a.time + b.time))
        before = middle.slope * a.slope > 0.0
        a, b = (
            Knots(*(np.where(to, m, f) for m, f in zip(middle, knots, strict=True)))
            for to, knots in ((before, a), (~before, b))
        )
