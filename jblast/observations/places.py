"""Latitude, longitude and altitude as east, north and up in a local frame.

The frame touches the WGS84 ellipsoid at its origin, and its axes are straight.
Distances between positions are exact at any range; ground at the height of the origin
lies $d^2/2R$ below the plane at a distance $d$. The transformations are those of
pymap3d.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from jblast.types import Float

Numbers = Any
"""Numbers or arrays of them; the type of jaxtyping for these imports JAX."""
DEGREE_DIGITS, HEIGHT_DIGITS = 12, 6
"""Decimals of geodetic positions: 1e-12 degrees are 0.1 um. Conversion to metres and
back is exact to 1e-13 degrees and 1e-8 m within 50 km."""
MAX_DISTANCE = 1e6
"""Largest distance of a position from the others, or from the place of a scene [m].

Beyond it a sign, or the order of latitude and longitude, is probably wrong, and laws of
travel time along straight paths do not hold."""


@dataclass(frozen=True)
class Frame:
    """Local frame of east, north and up, tangent to the ellipsoid at its origin.

    The axes are straight: ground at the origin's height lies $d^2 / 2R$ below the plane
    at a distance $d$. Distances between positions are straight lines, exact at any
    range (`inference.fitting.assumptions.flat_ground` has the error of flat ground).

    Attributes:
        lat_deg: Geodetic latitude of the origin, WGS84 [degree].
        lon_deg: Its longitude, east positive [degree].
        alt_m: Its height above the ellipsoid, or above the one datum that all heights
            are counted from [m].

    Example:
        `Frame(33.9, 35.5, 10.0).to_enu(33.91, 35.5, 12.0)`
    """

    lat_deg: float
    lon_deg: float
    alt_m: float = 0.0

    def to_enu(
        self, lat_deg: Numbers, lon_deg: Numbers, alt_m: Numbers
    ) -> Float[np.ndarray, "*place 3"]:
        """Return east, north, up of places [m].

        Args:
            lat_deg: Geodetic latitudes [degree].
            lon_deg: Longitudes, of any turn [degree].
            alt_m: Heights by the datum of the origin's [m].
        """
        # imported here: it takes 0.2 s, and few logs are in degrees
        from pymap3d import geodetic2enu

        lat, lon, alt = np.broadcast_arrays(
            *(np.asarray(x, float) for x in (lat_deg, lon_deg, alt_m))
        )
        enu = geodetic2enu(lat, lon, alt, self.lat_deg, self.lon_deg, self.alt_m)
        return np.stack([np.asarray(axis, float) for axis in enu], axis=-1)

    def to_geodetic(self, enu_m: Numbers) -> Float[np.ndarray, "*place 3"]:
        """Return latitude, longitude (-180 to 180) [degree] and height of places [m].

        They are rounded to `DEGREE_DIGITS` and `HEIGHT_DIGITS`.

        Args:
            enu_m: East, north, up [m].
        """
        from pymap3d import enu2geodetic

        east, north, up = np.moveaxis(np.asarray(enu_m, float), -1, 0)
        lat, lon, alt = enu2geodetic(
            east, north, up, self.lat_deg, self.lon_deg, self.alt_m
        )
        # one turn: libraries return longitudes up to 360 degrees
        lon = (np.asarray(lon, float) + 180.0) % 360.0 - 180.0
        # the conversion's own rounding is below, so that positions are written as read
        places = [(lat, DEGREE_DIGITS), (lon, DEGREE_DIGITS), (alt, HEIGHT_DIGITS)]
        return np.stack([np.round(np.asarray(x), n) for x, n in places], axis=-1)


def mean_frame(lat_deg: Numbers, lon_deg: Numbers, alt_m: Numbers) -> Frame:
    """Return the frame at the mean of positions and of their heights.

    The mean is taken of the points in space, so that neither the poles nor the date
    line is special.

    Args:
        lat_deg: Geodetic latitudes [degree].
        lon_deg: Longitudes [degree].
        alt_m: Heights [m].
    """
    from pymap3d import ecef2geodetic, geodetic2ecef

    # heights are averaged separately, as their datum need not be the ellipsoid
    level = np.zeros(np.shape(lat_deg))
    points = geodetic2ecef(np.asarray(lat_deg, float), np.asarray(lon_deg), level)
    x, y, z = (float(np.mean(axis)) for axis in points)
    lat, lon, _ = ecef2geodetic(x, y, z)
    return Frame(float(lat), float(lon), float(np.mean(np.asarray(alt_m, float))))
