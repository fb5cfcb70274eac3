"""From latitudes to the scene's metres and back, over ground that is level.

Horizontal places are those of `observations.places.frame`. Heights are kept as they
are: up is height above the origin, the scene's ground is level, and what the Earth
falls away below the plane (8 cm in a kilometre) is left out of both.
"""

import numpy as np
from jaxtyping import ArrayLike, Float

from jblast.errors import InputError
from jblast.missions.plan.item import Plan
from jblast.observations.places.frame import Frame
from jblast.scene import Place


def frame_of(plan: Plan, place: Place | None = None) -> Frame:
    """Return the frame of a plan: about the scene's place, or about its home.

    Args:
        plan: The plan.
        place: Where the scene's origin lies, if it says so.

    Raises:
        InputError: Neither says where.
    """
    where = plan.home if place is None else place
    if where is None:
        raise InputError(
            f"{plan.where}: home: expected a first line with home, or the scene's "
            "[place], got neither"
        )
    return Frame(*where)


def level(
    frame: Frame,
    lat_deg: Float[ArrayLike, "*place"],
    lon_deg: Float[ArrayLike, "*place"],
    alt_m: Float[ArrayLike, "*place"],
) -> Float[np.ndarray, "*place 3"]:
    """Return east, north, and height above the origin's [m]."""
    enu = frame.to_enu(lat_deg, lon_deg, frame.alt_m)
    up = np.broadcast_to(np.asarray(alt_m, float) - frame.alt_m, enu.shape[:-1])
    return np.concatenate([enu[..., :2], up[..., None]], axis=-1)


def geodetic(
    frame: Frame, place_m: Float[ArrayLike, "*place 3"]
) -> Float[np.ndarray, "*place 3"]:
    """Return latitude, longitude [degree] and height [m] of level places."""
    place = np.array(place_m, float)
    found = place.copy()
    found[..., 2] = 0.0
    # down to the ground, which lies below the plane: twice, to a millimetre at 20 km
    for _ in range(2):
        found[..., 2] -= frame.to_geodetic(found)[..., 2] - frame.alt_m
    answer = frame.to_geodetic(found)
    answer[..., 2] = place[..., 2] + frame.alt_m
    return answer
