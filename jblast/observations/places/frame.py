"""A local frame on the Earth: east, north, up in metres about one place."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import ArrayLike, Float

FARTHEST = 1e6
"""No place of a log is further from the frame's origin [m]: a sign, or an order, is
wrong then."""


@dataclass(frozen=True)
class Frame:
    """East, north, up about a place, in the plane that touches the ellipsoid there.

    The axes are straight: ground of the origin's height lies $d^2 / 2R$ below the plane
    at a distance $d$. Distances between places are those through the air, exact at any
    range (`flatness` says what is lost by taking the ground as flat).

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
        self,
        lat_deg: Float[ArrayLike, "*place"],
        lon_deg: Float[ArrayLike, "*place"],
        alt_m: Float[ArrayLike, "*place"],
    ) -> Float[np.ndarray, "*place 3"]:
        """Return east, north, up of places [m].

        Args:
            lat_deg: Geodetic latitudes [degree].
            lon_deg: Longitudes, of any turn [degree].
            alt_m: Heights by the datum of the origin's [m].
        """
        from pymap3d import geodetic2enu  # 0.2 s, and few logs are in degrees

        lat, lon, alt = np.broadcast_arrays(
            *(np.asarray(x, float) for x in (lat_deg, lon_deg, alt_m))
        )
        enu = geodetic2enu(lat, lon, alt, self.lat_deg, self.lon_deg, self.alt_m)
        return np.stack([np.asarray(axis, float) for axis in enu], axis=-1)

    def to_geodetic(
        self, enu_m: Float[ArrayLike, "*place 3"]
    ) -> Float[np.ndarray, "*place 3"]:
        """Return latitude, longitude (-180 to 180) [degree] and height of places [m].

        Args:
            enu_m: East, north, up [m].
        """
        from pymap3d import enu2geodetic

        east, north, up = np.moveaxis(np.asarray(enu_m, float), -1, 0)
        lat, lon, alt = enu2geodetic(
            east, north, up, self.lat_deg, self.lon_deg, self.alt_m
        )
        lon = (np.asarray(lon, float) + 180.0) % 360.0 - 180.0
        return np.stack([np.asarray(lat, float), lon, np.asarray(alt, float)], axis=-1)


def mean_frame(
    lat_deg: Float[ArrayLike, " place"],
    lon_deg: Float[ArrayLike, " place"],
    alt_m: Float[ArrayLike, " place"],
) -> Frame:
    """Return the frame about the middle of places, up = 0 at the mean of their heights.

    The middle is that of the points in space, so that neither the pole nor the line
    where dates change is a special place.

    Args:
        lat_deg: Geodetic latitudes [degree].
        lon_deg: Longitudes [degree].
        alt_m: Heights [m].
    """
    from pymap3d import ecef2geodetic, geodetic2ecef

    level = np.zeros(np.shape(lat_deg))
    points = geodetic2ecef(np.asarray(lat_deg, float), np.asarray(lon_deg), level)
    x, y, z = (float(np.mean(axis)) for axis in points)
    lat, lon, _ = ecef2geodetic(x, y, z)
    return Frame(float(lat), float(lon), float(np.mean(alt_m)))
