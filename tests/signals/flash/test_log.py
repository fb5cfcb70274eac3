"""From a rendered film to a log, and back to the charge and its place."""

import numpy as np
import pytest

from jblast.inference import fit
from jblast.scene import Camera, Charge, Scene, look_at, read_scene
from jblast.sensors.camera import luminance, project, render
from jblast.signals.flash.fireball import (
    Growth,
    Silhouette,
    direction_of,
    radius_in_middle,
)
from jblast.signals.flash.search import detect_flashes, flash_threshold, log_of

UNKNOWN = """
[charge]
mass_kg = "free"
position_m = ["free", "free", 0.0]
time_s = "free"
[camera]
position_m = [60.0, -80.0, 1.5]
look_at_m = [0.0, 0.0, 5.0]
width = 160
height = 120
focal_px = 180.0
"""
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


@pytest.mark.slow
def test_what_is_rendered_is_seen_and_fitted_back(tmp_path):
    through = camera()
    truth = (3.0, 5.0, 0.0)
    scene = Scene(
        charge=Charge(mass_kg=50.0, position_m=truth, time_s=0.0304), camera=through
    )
    times = np.arange(110) / 1000
    frames = np.asarray(luminance(np.asarray(render(scene, through, times))))
    rng = np.random.default_rng(0)
    noisy = np.clip(frames + 0.01 * rng.standard_normal(frames.shape), 0.0, 1.0)
    seen = detect_flashes(
        [(times, noisy.astype(np.float32))], 1000.0, flash_threshold()
    )
    log = log_of(seen.flashes, through)
    assert log.quantity.count("fireball_radius_px") == 8
    unknown = tmp_path / "scene.toml"
    unknown.write_text(UNKNOWN)
    found = fit(log, read_scene(unknown), posterior="laplace").summary
    told = found.estimates
    names = ("charge_mass_kg", "charge_east_m", "charge_north_m", "origin_time_s")
    for name, value in zip(names, (50.0, *truth[:2], 0.0304), strict=True):
        # 98 in 100: four intervals of 90 % would fail one time in three
        wide = 0.35 * (told[name].q95 - told[name].q05)
        assert told[name].q05 - wide < value < told[name].q95 + wide, name
