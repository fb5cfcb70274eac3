"""Latitudes and longitudes of level places, and back, within a compiled program.

The same as `missions.frame.level` and `geodetic`: straight axes about the origin, but
heights counted above its own, over ground that is level.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.scene import Place

RADIUS_M, FLATTENING = 6_378_137.0, 1 / 298.257223563
"""WGS84."""
SQUARE = FLATTENING * (2 - FLATTENING)
"""Of the eccentricity."""


class Origin(NamedTuple):
    """Where east-north-up has its origin.

    Attributes:
        centred_m: The same from the Earth's centre.
        axes: Rows: east, north, up from the Earth's centre.
        height_m: Above the ellipsoid.
    """

    centred_m: Float[np.ndarray, "3"]
    axes: Float[np.ndarray, "3 3"]
    height_m: float


def origin_at(place: Place) -> Origin:
    """Return the origin at a place."""
    lat, lon = np.radians(place.lat_deg), np.radians(place.lon_deg)
    sin, cos, sine, cosine = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    axes = np.array(
        [
            [-sine, cosine, 0.0],
            [-sin * cosine, -sin * sine, cos],
            [cos * cosine, cos * sine, sin],
        ]
    )
    normal = RADIUS_M / np.sqrt(1 - SQUARE * sin * sin)
    stretch = np.array([1.0, 1.0, 1 - SQUARE])
    return Origin((normal * stretch + place.alt_m) * axes[2], axes, float(place.alt_m))


def geodetic_of(origin: Origin, place_m: Float[Array, "3"]) -> Float[Array, "3"]:
    """Return latitude, longitude [degree] and height [m] of a level place."""
    flat = jnp.asarray(place_m).at[2].set(0.0)
    # down to the ground, which lies below the plane: twice, to a millimetre at 20 km
    for _ in range(2):
        flat = flat.at[2].add(origin.height_m - _geodetic(origin, flat)[2])
    found = _geodetic(origin, flat)
    return found.at[2].set(place_m[2] + origin.height_m)


def level_of(origin: Origin, geodetic: Float[Array, "3"]) -> Float[Array, "3"]:
    """Return the level place of a latitude, longitude [degree] and height [m]."""
    lat, lon = jnp.radians(geodetic[0]), jnp.radians(geodetic[1])
    out = jnp.stack(
        [jnp.cos(lat) * jnp.cos(lon), jnp.cos(lat) * jnp.sin(lon), jnp.sin(lat)]
    )
    normal = RADIUS_M / jnp.sqrt(1 - SQUARE * out[2] * out[2])
    stretch = jnp.array([1.0, 1.0, 1 - SQUARE])
    centred = (normal * stretch + origin.height_m) * out
    flat = jnp.asarray(origin.axes) @ (centred - origin.centred_m)
    return flat.at[2].set(geodetic[2] - origin.height_m)


def _geodetic(origin: Origin, enu_m: Float[Array, "3"]) -> Float[Array, "3"]:
    """Bowring's latitude (1976), exact to 1e-11 rad near the ground."""
    x, y, z = origin.centred_m + origin.axes.T @ enu_m
    across = jnp.hypot(x, y)
    short = 1 - FLATTENING
    reduced = jnp.arctan2(z, short * across)
    lat = jnp.arctan2(
        z + SQUARE / (1 - SQUARE) * short * RADIUS_M * jnp.sin(reduced) ** 3,
        across - SQUARE * RADIUS_M * jnp.cos(reduced) ** 3,
    )
    normal = RADIUS_M / jnp.sqrt(1 - SQUARE * jnp.sin(lat) ** 2)
    height = across * jnp.cos(lat) + z * jnp.sin(lat) - RADIUS_M**2 / normal
    return jnp.stack([jnp.degrees(lat), jnp.degrees(jnp.arctan2(y, x)), height])
