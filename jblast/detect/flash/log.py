"""Flashes as rows of a log that a fit takes as it stands."""

from collections.abc import Sequence

import numpy as np

from jblast.detect.flash.directions import direction_of, radius_in_middle
from jblast.detect.flash.growth import growing
from jblast.detect.flash.search import Flash
from jblast.detect.flash.silhouette import UNSURE, Silhouette
from jblast.observations import Observations, observed
from jblast.scene import Camera

SENSOR = "camera"
RADII = 8
"""Rows of a flash that tell its radius, at most."""
SMALLEST = 3.0
"""Radius that stands in a row, at least [px]."""


def log_of(
    flashes: Sequence[Flash], camera: Camera, comments: Sequence[str] = ()
) -> Observations:
    """Return the rows: first light, direction and radii of each flash.

    Args:
        flashes: What was seen.
        camera: Who saw it.
        comments: Provenance.
    """
    place = np.asarray(camera.position, float)
    rows: list[tuple[str, float, float, float, str]] = []
    for number, flash in enumerate(flashes, 1):
        shot = str(number) if len(flashes) > 1 else ""
        grown, nan = flash.growth, float("nan")
        came = direction_of(camera, grown)
        rows += [
            ("flash_time_s", grown.time_s, grown.sigma_s, nan, shot),
            ("bearing_rad", came.bearing_rad, came.bearing_sd_rad, nan, shot),
            ("elevation_rad", came.elevation_rad, came.elevation_sd_rad, nan, shot),
        ]
        for seen in _some(flash):
            radius = radius_in_middle(camera, seen)
            sigma = seen.sigma_px * radius / seen.radius_px
            rows.append(("fireball_radius_px", radius, sigma, seen.time_s, shot))
    quantity, value, sigma, time, shots = zip(*rows, strict=True) if rows else ((),) * 5
    return observed(
        (SENSOR,) * len(rows),
        quantity,
        value,
        sigma,
        position=np.tile(place, (len(rows), 1)),
        time=np.array(time, float),
        shot=tuple(shots),
        comments=tuple(comments),
    )


def _some(flash: Flash) -> list[Silhouette]:
    """Return a few silhouettes of those that grow, denser while it grows fast."""
    large = [
        one
        for one in growing(flash.silhouettes)
        if one.radius_px >= SMALLEST and one.time_s > flash.growth.time_s
    ]
    whole = [one for one in large if one.sigma_px <= UNSURE * one.radius_px]
    if 2 * len(whole) < len(large):
        return []  # what made the others too large is in these, too
    if len(whole) <= RADII:
        return whole
    which = np.unique(np.geomspace(1, len(whole), RADII).round().astype(int) - 1)
    return [whole[i] for i in which]
