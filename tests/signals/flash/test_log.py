"""From a rendered film to a log, and back to the charge and its place."""

import numpy as np
import pytest

from jblast.scene import Camera, look_at
from jblast.sensors.camera import project
from jblast.signals.flash.fireball import (
    Growth,
    Silhouette,
    direction_of,
    radius_in_middle,
)

EYE = np.array([60.0, -80.0, 1.5])


def camera(**changed):
    numbers = {
        "position": EYE,
        "quaternion": look_at(EYE, np.array([0.0, 0.0, 5.0])),
        "focal": np.array([180.0, 180.0]),
        "center": np.array([79.5, 59.5]),
    }
    return Camera(**(numbers | changed), width=160, height=120)


def seen_at(x, y):
    return Growth(0.0, 1e-4, x, 0.5, y, 0.5, None, None, None, None, 0.1)


@pytest.mark.parametrize("distortion", [np.zeros(5), np.array([-0.1, 0, 0, 0, 0.0])])
def test_a_direction_is_that_of_the_place_seen_there(distortion):
    through = camera(distortion=distortion)
    place = np.array([[12.0, 30.0, 7.0]])
    x, y = np.asarray(project(through, place).pixel)[0]
    told = direction_of(through, seen_at(float(x), float(y)))
    east, north, up = (place - EYE)[0]
    assert told.bearing_rad == pytest.approx(np.arctan2(east, north) % (2 * np.pi))
    assert told.elevation_rad == pytest.approx(np.arctan2(up, np.hypot(east, north)))
    # half a pixel of 180 or so
    assert told.bearing_sd_rad == pytest.approx(0.5 / 180, rel=0.2)


def test_a_sphere_off_the_middle_has_the_radius_it_would_have_there():
    through = camera()
    # 5 m at 100 m, 20 degrees off the axis: wider in the image by 1 / cos^2
    half, off = np.arcsin(0.05), np.radians(20.0)
    edges = 180 * np.tan([off - half, off + half])
    spot = Silhouette(
        0.0, float(np.ptp(edges)) / 2, 79.5 + float(edges.mean()), 59.5, 9.0, False
    )
    assert radius_in_middle(through, spot) == pytest.approx(
        180 * np.tan(half), rel=1e-4
    )
    assert spot.radius_px > 1.1 * 180 * np.tan(half)
