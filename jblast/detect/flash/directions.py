"""Where a flash was, as directions in the world: through the scene's camera."""

from typing import NamedTuple

import numpy as np

from jblast.detect.flash.growth import Growth
from jblast.detect.flash.silhouette import Silhouette
from jblast.scene import Camera
from jblast.sensors.camera.geometry import unproject


class Direction(NamedTuple):
    """From the camera to the burst.

    Attributes:
        bearing_rad: Clockwise from north [rad].
        bearing_sd_rad: Its standard deviation, of the place in the image alone [rad].
        elevation_rad: Above the horizon [rad].
        elevation_sd_rad: Likewise.
    """

    bearing_rad: float
    bearing_sd_rad: float
    elevation_rad: float
    elevation_sd_rad: float


def direction_of(camera: Camera, grown: Growth) -> Direction:
    """Return the direction of a burst.

    Args:
        camera: Who looked.
        grown: Where it is in the image.
    """
    x, y = grown.x_px, grown.y_px
    pixels = np.array([[x, y], [x + 1.0, y], [x, y + 1.0]])
    east, north, up = np.asarray(unproject(camera, pixels)).T
    bearing, elevation = np.arctan2(east, north), np.arctan2(up, np.hypot(east, north))
    by_pixel = np.angle(np.exp(1j * (bearing[1:] - bearing[0])))
    sigma = np.array([grown.x_sigma_px, grown.y_sigma_px])
    return Direction(
        float(bearing[0] % (2.0 * np.pi)),
        float(np.linalg.norm(by_pixel * sigma)),
        float(elevation[0]),
        float(np.linalg.norm((elevation[1:] - elevation[0]) * sigma)),
    )


def radius_in_middle(camera: Camera, seen: Silhouette) -> float:
    """Return the radius that the sphere would have in the middle of the image [px].

    Elsewhere, and through a lens that distorts, it is another; `fireball_radius_px` is
    f tan(a) with a the half-angle that it spans.

    Args:
        camera: Who looked.
        seen: Its silhouette.
    """
    x, y, radius = seen.x_px, seen.y_px, seen.radius_px
    left, right = np.asarray(
        unproject(camera, np.array([[x - radius, y], [x + radius, y]]))
    )
    half = 0.5 * np.arctan2(np.linalg.norm(np.cross(left, right)), left @ right)
    return float(np.sqrt(np.prod(camera.focal)) * np.tan(half))
