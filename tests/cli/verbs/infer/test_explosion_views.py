"""From a charge to its film, from the film's radii to the charge."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

SCENE = """
[charge]
mass_kg = {mass}
position_m = [0, 0, 0]

[camera]
position_m = [36, -48, 2]
look_at_m = [0, 0, 3]
width = 160
height = 120
focal_px = 330
frames_hz = 100
"""
BEHIND = np.array([0, 0, 255])
"""Blue, which neither fire nor smoke is."""


def radius_in(file: Path) -> float:
    """Return twice the standard deviation of the columns of what hides the blue."""
    picture = np.asarray(Image.open(file).convert("RGB"), float)
    # half of the blue's linear light is 188 of 255, and fire itself has less
    hidden = picture[..., 2] < 188.0
    columns = hidden.sum(axis=0).astype(float)
    place = np.arange(columns.size)
    middle = columns @ place / columns.sum()
    return 2.0 * float(np.sqrt(columns @ (place - middle) ** 2 / columns.sum()))


@pytest.mark.slow  # three commands
def test_radii_of_a_rendered_explosion_give_its_charge_back(jblast):
    mass = 15.0
    film = jblast.file("film.toml", SCENE.format(mass=mass))
    code, _, _ = jblast(
        *("render", film, "--out", jblast.path("film"), "--times", "0.005:0.2"),
        *("--mode", "rgb", "--views", "explosion", "--flash", "off"),
        *("--background", "0,0,1"),
    )
    assert code == 0
    files = sorted((jblast.directory / "film" / "frames").glob("*.png"))
    rows = ["sensor,quantity,value,sigma,time_s"]
    for number, file in enumerate(files):
        radius = radius_in(file)
        rows.append(
            f"camera,fireball_radius_px,{radius},{0.02 * radius},{0.005 + number / 100}"
        )
    assert len(rows) > 15
    log = jblast.file("log.csv", "\n".join(rows) + "\n")
    unknown = jblast.file(
        "unknown.toml", SCENE.format(mass="{ lognormal = [50.0, 10.0] }")
    )
    code, told, _ = jblast("fit", log, "--scene", unknown, "--json")
    assert code == 0
    found = json.loads(told)["estimates"]["charge_mass_kg"]
    assert found["q05"] < mass < found["q95"]
    # declared: 20 % of a shot's radius, 60 % of its mass; the film itself owes a tenth
    assert abs(np.log(found["value"] / mass)) < 0.2
    assert found["q95"] / found["q05"] > 2.0
