r"""How far and in which direction one place on Earth lies from another.

Vincenty (1975), Survey Review 23(176):88, inverse problem on the ellipsoid of WGS 84;
exact to millimetres except near the antipode, where the iteration does not end, and
along the equator, where it divides by zero.
"""

from math import atan, atan2, cos, degrees, hypot, radians, sin, tan
from typing import NamedTuple

EQUATOR = 6_378_137.0
"""Radius of the equator [m]. WGS 84."""

FLATTENING = 1 / 298.257223563
"""Of the ellipsoid [-]. WGS 84."""

STEPS = 20
"""Each gains about three digits."""


class Geodesic(NamedTuple):
    """The shortest way between two places.

    Attributes:
        length: [m].
        bearing: At the first place, towards the second [degrees east of north].
        back_bearing: At the second place, towards the first.
    """

    length: float
    bearing: float
    back_bearing: float


def geodesic(
    latitude: float, longitude: float, to_latitude: float, to_longitude: float
) -> Geodesic:
    """Return the way from one place to another, all in degrees."""
    polar = EQUATOR * (1 - FLATTENING)
    u = atan((1 - FLATTENING) * tan(radians(latitude)))  # reduced latitudes
    v = atan((1 - FLATTENING) * tan(radians(to_latitude)))
    difference = turn = radians(to_longitude - longitude)
    for _ in range(STEPS):
        way = _on_sphere(u, v, turn)
        c = FLATTENING / 16 * way.cos2 * (4 + FLATTENING * (4 - 3 * way.cos2))
        bend = way.middle + c * cos(way.arc) * (2 * way.middle**2 - 1)
        less = (1 - c) * FLATTENING * way.sin_azimuth
        turn = difference + less * (way.arc + c * sin(way.arc) * bend)
    way = _on_sphere(u, v, turn)
    w = way.cos2 * (EQUATOR**2 - polar**2) / polar**2
    a = 1 + w / 16384 * (4096 + w * (-768 + w * (320 - 175 * w)))
    b = w / 1024 * (256 + w * (-128 + w * (74 - 47 * w)))
    twice = 2 * way.middle**2 - 1
    tail = b / 6 * way.middle * (4 * sin(way.arc) ** 2 - 3) * (4 * way.middle**2 - 3)
    less = b * sin(way.arc) * (way.middle + b / 4 * (cos(way.arc) * twice - tail))
    back = _on_sphere(v, u, -turn)
    return Geodesic(
        length=polar * a * (way.arc - less),
        bearing=degrees(way.bearing) % 360,
        back_bearing=degrees(back.bearing) % 360,
    )


class _Arc(NamedTuple):
    """The way on the auxiliary sphere.

    Attributes:
        arc: Its angle [rad].
        bearing: Where it starts [rad].
        sin_azimuth: Sine of its azimuth at the equator.
        cos2: Square of that azimuth's cosine.
        middle: Cosine of twice the angle from the equator to its midpoint.
    """

    arc: float
    bearing: float
    sin_azimuth: float
    cos2: float
    middle: float


def _on_sphere(u: float, v: float, turn: float) -> _Arc:
    """Return the way between reduced latitudes, a difference in longitude apart."""
    east = cos(v) * sin(turn)
    north = cos(u) * sin(v) - sin(u) * cos(v) * cos(turn)
    cos_arc = sin(u) * sin(v) + cos(u) * cos(v) * cos(turn)
    sin_arc = hypot(east, north)
    sin_azimuth = cos(u) * east / sin_arc
    cos2 = 1 - sin_azimuth**2
    return _Arc(
        arc=atan2(sin_arc, cos_arc),
        bearing=atan2(east, north),
        sin_azimuth=sin_azimuth,
        cos2=cos2,
        middle=cos_arc - 2 * sin(u) * sin(v) / cos2,
    )
