"""`jblast render` through a camera on a vehicle, and over a textured ground."""

import numpy as np
import pytest
from PIL import Image

from tests.cli.verbs.simulate.render.scenes import CHARGE, refused, rendered

VEHICLE = '[vehicle]\nmodel = "hummingbird"\nposition_m = [0, -30, 6]\n'
CARRIED = """[camera]
mount = "vehicle"
width = 24
height = 18
focal_px = 24
frames_hz = 250
"""
HEAD = "time_s,east_m,north_m,up_m,quaternion_i,quaternion_j,quaternion_k,quaternion_w"
TURNED = "0,0,0.70710678,0.70710678"


@pytest.fixture
def flying(jblast):
    jblast.file("scene.toml", CHARGE + VEHICLE + CARRIED)
    rows = [f"{t},0,{-30 + 5 * t},6,{TURNED}" for t in (0.0, 1.0, 2.5)]
    jblast.file("flight.csv", "\n".join([HEAD, *rows]) + "\n")
    x, y = np.meshgrid(np.arange(16), np.arange(16))
    light = np.where((x // 8 + y // 8) % 2, 200, 60).astype(np.uint8)
    Image.fromarray(np.repeat(light[..., None], 3, -1)).save(
        jblast.directory / "field.png"
    )
    return jblast


def test_a_flight_over_a_field_sends_events_before_the_blast(flying):
    words = ("--flight", flying.path("flight.csv"))
    ground = ("--ground", flying.path("field.png") + ":0.5")
    said = rendered(flying, "--times", "1.0:1.2", *words, *ground)
    assert said["frames"] == 50
    assert said["events"] > 20
    assert said["stamps"] == "interpolated"
    frame = np.asarray(Image.open(flying.path("out/frames/0000.png"))).astype(int)
    assert (frame[0, :, 2] > frame[0, :, 0]).all()  # the sky is blue
    assert np.ptp(frame[10:, :, 0]) > 50  # and the ground has squares


BAD = {
    "a still picture": (["--background", "field.png"], "for a moving camera"),
    "a depth": (["--depth", "wall.npy"], "--depth: expected a fixed camera"),
    "both": (["--background", "0.2", "--ground", "field.png:1"], "no --background but"),
    "no scale": (["--ground", "field.png"], "expected IMAGE.png:METRES_PER_PIXEL"),
    "scale 0": (["--ground", "field.png:0"], "expected IMAGE.png:METRES_PER_PIXEL"),
    "too long": (["--times", "2:3"], "expected a flight as long as the film, 2 to 2.9"),
}


@pytest.mark.parametrize(("words", "said"), BAD.values(), ids=BAD)
def test_what_cannot_be_filmed_in_flight_is_refused(flying, words, said):
    np.save(flying.directory / "wall.npy", np.ones((18, 24)))
    Image.new("RGB", (24, 18)).save(flying.directory / "field.png")
    words = [
        flying.path(word) if word.endswith((".png", ".npy")) else word for word in words
    ]
    words += ["--flight", flying.path("flight.csv")]
    if "--times" not in words:
        words += ["--times", "2.0:2.1"]
    assert said in refused(flying, *words)


@pytest.mark.slow  # the flight's programs are compiled
def test_the_scenes_own_vehicle_is_flown(flying):
    said = rendered(flying, "--times", "2.0:2.1", "--mode", "rgb")
    assert said["frames"] == 25
