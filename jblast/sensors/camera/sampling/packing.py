r"""How far directions stand apart, and how far they possibly could.

The packing distance of a set is the least angle between two of it. No $n$ points on the
whole sphere stand further apart than Fejes Toth's (1943) bound

$$\delta \le \arccos\frac{\cot^2\omega - 1}{2}, \qquad \omega = \frac{n}{n - 2}
\frac{\pi}{6}$$

which 3, 4, 6 and 12 points reach. On the hemisphere the caps of half that angle about
$n$ points may stick out below the horizon, by no more than $\delta/2$; they do not
overlap, so that their area gives

$$n \left(1 - \cos\tfrac\delta2\right) \le 1 + \sin\tfrac\delta2$$

which none reaches: there is always room between caps.
"""

import math
from functools import cache

import numpy as np

from jblast.errors import InputError, shown
from jblast.sensors.camera.sampling.lattices import (
    PLAIN,
    Directions,
    fibonacci_lattice,
)

OFFSETS = np.round(np.arange(0.0, 4.0001, 0.01), 2)
"""Offsets from the pole that are tried [points]."""


def packing_distance(direction: Directions) -> float:
    """Return the least angle between two of several directions [rad].

    By the chord, which tells small angles where their cosine rounds.

    Raises:
        InputError: There are fewer than two.
    """
    if len(direction) < 2:
        raise InputError(f"directions: expected two or more, got {len(direction)}")
    cosines = direction @ direction.T
    np.fill_diagonal(cosines, -np.inf)
    first, second = np.unravel_index(np.argmax(cosines), cosines.shape)
    chord = np.linalg.norm(direction[first] - direction[second])
    return 2.0 * math.asin(min(1.0, float(chord) / 2.0))


@cache
def best_offset(number: int) -> float:
    """Return at which offset a Fibonacci lattice of so many packs best, of `OFFSETS`.

    One direction alone is at no distance: the plain one's.
    """
    if number < 2:
        return PLAIN
    return float(max(OFFSETS, key=lambda e: _distance(number, float(e))))


def offset_lattice(number: int) -> Directions:
    """Return the Fibonacci lattice whose offset from the pole packs best."""
    return fibonacci_lattice(number, best_offset(number))


def sphere_bound(number: int) -> float:
    """Return what no packing of so many points on the whole sphere exceeds [rad].

    Raises:
        InputError: There are fewer than three.
    """
    if number < 3:
        raise InputError(f"number: expected three or more, got {shown(number)}")
    omega = number / (number - 2) * math.pi / 6
    return math.acos((1.0 / math.tan(omega) ** 2 - 1.0) / 2.0)


def hemisphere_bound(number: int) -> float:
    """Return what no packing of so many points on the hemisphere exceeds [rad].

    The area's bound, solved by bisection; two points are at most 180 degrees apart.
    """
    low, high = 0.0, math.pi
    for _ in range(60):
        middle = (low + high) / 2
        fits = number * (1 - math.cos(middle / 2)) <= 1 + math.sin(middle / 2)
        low, high = (middle, high) if fits else (low, middle)
    return high


def _distance(number: int, offset: float) -> float:
    return packing_distance(fibonacci_lattice(number, offset))
