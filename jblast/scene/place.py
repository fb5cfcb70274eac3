"""Where on the Earth a scene is."""

from typing import NamedTuple

from jblast.bounds import Bounds

LIMITS = {
    "lat_deg": Bounds(at_least=-90.0, at_most=90.0),
    "lon_deg": Bounds(at_least=-180.0, at_most=360.0),
    "alt_m": Bounds(at_least=-1e3, at_most=1e5),
}
"""What each number may be: longitudes count from -180 to 180, or from 0 to 360."""


class Place(NamedTuple):
    """A place on the Earth, WGS84.

    Attributes:
        lat_deg: Geodetic latitude [degree].
        lon_deg: Longitude, east positive [degree].
        alt_m: Height above the ellipsoid, or above the one datum that all heights are
            counted from [m].
    """

    lat_deg: float
    lon_deg: float
    alt_m: float = 0.0
