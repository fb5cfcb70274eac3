"""The explosion that comes with jblast: rimmed by soot, on ground that it lights."""

import numpy as np
import pytest

from jblast.inference import fit
from jblast.scene import Camera, Charge, Scene, look_at, read_scene
from jblast.sensors.camera import explosion_views, luminance, render
from jblast.signals.flash.search import (
    FlashDetections,
    detect_flashes,
    flash_threshold,
    log_of,
)

BURST_S = 0.0304
AIM = np.array([0.0, 0.0, 3.0])
UNKNOWN = """
[charge]
mass_kg = "free"
position_m = [0.0, 0.0, 0.0]
time_s = "free"
[camera]
position_m = [{0}, {1}, {2}]
look_at_m = [0.0, 0.0, 3.0]
width = 160
height = 120
focal_px = 300.0
"""


def camera(away, above, width, focal):
    """From the south, so many radians above the horizon."""
    eye = away * np.array([0.0, -np.cos(above), np.sin(above)])
    height = 3 * width // 4
    return Camera(
        position=eye,
        quaternion=look_at(eye, AIM),
        focal=np.array([focal, focal]),
        center=np.array([(width - 1) / 2, (height - 1) / 2]),
        width=width,
        height=height,
    )


def seen(through, mass_kg, behind, frames) -> FlashDetections:
    """What the test says of a film in 8 bits, with a sensor's noise."""
    scene = Scene(Charge(mass_kg=mass_kg, position_m=(0.0, 0.0, 0.0), time_s=BURST_S))
    times = np.arange(frames) / 1000
    views = explosion_views(towards=np.asarray(through.position))
    light = luminance(
        np.asarray(
            render(scene, through, times, background=behind, ground=False, views=views)
        )
    )
    noisy = light + 0.008 * np.random.default_rng(0).standard_normal(light.shape)
    grey = np.rint(255 * np.clip(noisy, 0.0, 1.0)) / 255
    return detect_flashes([(times, grey.astype(np.float32))], 1000.0, flash_threshold())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mass_kg", "away", "above", "behind"),
    [
        (50.0, 120.0, 0.03, 0.02),
        (50.0, 120.0, 0.03, 0.5),
        (200.0, 180.0, 0.2, 0.18),
        (5.0, 60.0, 0.1, 0.3),
    ],
)
def test_the_log_of_an_explosion_gives_its_charge_back(
    tmp_path, mass_kg, away, above, behind
):
    through = camera(away, above, 160, 300.0)
    found = seen(through, mass_kg, behind, 110)
    (flash,) = found.flashes
    # light on the ground comes with the fire, both between two frames
    assert flash.growth.time_s == pytest.approx(BURST_S, abs=1e-3)
    log = log_of(found.flashes, through)
    assert 5 <= log.quantity.count("fireball_radius_px") <= 8
    unknown = tmp_path / "scene.toml"
    unknown.write_text(UNKNOWN.format(*np.asarray(through.position)))
    told = fit(log, read_scene(unknown)).summary
    mass = told.estimates["charge_mass_kg"]
    assert mass.q05 < mass_kg < mass.q95
    # rows that contradict each other, as those after the fire did, make a poor fit
    assert told.chi2 < 3 * len(log)


@pytest.mark.slow
def test_radii_of_ground_that_shines_as_the_fire_does_are_not_told():
    # bright, and from steeply above: they would be twice the fireball's
    through = camera(100.0, 0.35, 160, 300.0)
    found = seen(through, 50.0, 0.45, 110)
    assert len(found.flashes) == 1
    radii = [
        row
        for row in zip(*_columns(log_of(found.flashes, through)), strict=True)
        if row[0] == "fireball_radius_px"
    ]
    assert all(value < 1.2 * 300 * 6.67 / 100 for _, value in radii)


def _columns(log):
    return log.quantity, np.asarray(log.value)
