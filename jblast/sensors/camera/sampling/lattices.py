r"""Directions on the upper hemisphere: Fibonacci lattices, a spiral, a latitude grid.

A lattice has $n$ unit vectors towards east, north, up, none below the horizon. The
Fibonacci lattice goes round by the golden angle from one to the next,

$$\phi_i = i\,\pi (3 - \sqrt 5), \qquad z_i = 1 - \frac{i + \epsilon}{n - \frac12 +
\epsilon}, \qquad i = 0 \dots n - 1$$

so that equal areas hold equally many. With $\epsilon = 1/2$ it is the plain one, which
is the upper half of Gonzalez' (2010) for the sphere; seen from above at radius
$\sqrt{1 - z}$ it is Vogel's golden spiral. Other $\epsilon$ move the first points away
from the pole, where the plain one stands closest: Hardin, Michaels and Saff (2016) for
the sphere, with numbers by Roberts (2018), both second-hand.
"""

import math

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, shown

GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
"""Between one point of a Fibonacci lattice and the next, seen from above [rad]."""

PLAIN = 0.5
"""Offset from the pole of the plain Fibonacci lattice [points]."""

MOST = 4096
"""Directions of a lattice; distances between all pairs are held at once."""

Directions = Float[np.ndarray, "view 3"]
"""Unit vectors towards east, north, up."""


def fibonacci_lattice(number: int, offset: float = PLAIN) -> Directions:
    """Return a Fibonacci lattice on the upper hemisphere.

    Args:
        number: How many, 1 to `MOST`.
        offset: How far the first stands from the pole, in points: 0 is the pole itself.

    Raises:
        InputError: The number is none of these, or the offset is negative.
    """
    index = _indices(number)
    if not 0.0 <= offset < math.inf:
        raise InputError(f"offset: expected 0 or more, got {shown(offset)}")
    height = 1.0 - (index + offset) / (number - 0.5 + offset)
    return _directions(GOLDEN_ANGLE * index, height)


def spiral_lattice(number: int) -> Directions:
    r"""Return Bauer's spiral on the upper hemisphere.

    It is the upper half of that of $2n$ points on the sphere: turns stand as far apart
    as points along them, $\phi = \sqrt{2 n \pi}\,\theta$, $z = 1 - (i + 1/2)/n$.

    Args:
        number: How many, 1 to `MOST`.

    Raises:
        InputError: The number is none of these.

    References:
        Bauer (2000), as in Hardin, Michaels and Saff (2016), second-hand.
    """
    height = 1.0 - (_indices(number) + 0.5) / number
    return _directions(math.sqrt(2 * math.pi * number) * np.arccos(height), height)


def latitude_grid(number: int) -> Directions:
    """Return rings of equal distance in elevation, and of even steps in azimuth.

    What spherical coordinates suggest: as many in each ring, or one less, so that they
    crowd at the zenith. At the horizon a step in azimuth is as long as one in elevation
    with four times as many azimuths as rings.

    Args:
        number: How many, 1 to `MOST`.

    Raises:
        InputError: The number is none of these.
    """
    index = _indices(number)
    rings = max(1, round(math.sqrt(number / 4.0)))
    azimuth, elevation = [], []
    for ring, members in enumerate(np.array_split(index, rings)):
        azimuth.append(np.arange(len(members)) * (2 * math.pi / len(members)))
        middle = (ring + 0.5) / rings * (math.pi / 2)
        elevation.append(np.full(len(members), middle))
    return _directions(np.concatenate(azimuth), np.sin(np.concatenate(elevation)))


def azimuth_elevation(
    direction: Directions,
) -> tuple[Float[np.ndarray, " view"], Float[np.ndarray, " view"]]:
    """Return azimuth, clockwise from north, 0 to 360, and elevation [deg]."""
    east, north, up = direction.T
    azimuth = np.degrees(np.arctan2(east, north)) % 360.0
    return azimuth, np.degrees(np.arctan2(up, np.hypot(east, north)))


def _indices(number: int) -> Float[np.ndarray, " view"]:
    if not 1 <= number <= MOST:
        raise InputError(
            f"number: expected 1 to {MOST} directions, got {shown(number)}"
        )
    return np.arange(number, dtype=float)


def _directions(
    azimuth: Float[np.ndarray, " view"], height: Float[np.ndarray, " view"]
) -> Directions:
    """Return unit vectors of azimuths, clockwise from north, and heights."""
    across = np.sqrt(1.0 - np.square(height))
    return np.stack(
        [across * np.sin(azimuth), across * np.cos(azimuth), height], axis=-1
    )
