"""Scenes with a camera, and what `jblast render` makes of them."""

import json

from tests.cli.cli_files import Command

CHARGE = "[charge]\nmass_kg = 15.0\nposition_m = [0, 0, 1]\ntime_s = 2.0\n"
CAMERA = """[camera]
position_m = [0, -40, 2]
look_at_m = [0, 0, 4]
width = 24
height = 18
focal_px = 24
frames_hz = 500
threshold = [0.2, 0.3]
"""
AWAY = CAMERA.replace("[0, 0, 4]", "[0, -80, 2]")


def rendered(jblast: Command, *options: str) -> dict:
    words = ["--out", jblast.path("out"), "--noise", "off", "--json", *options]
    code, out, err = jblast("render", jblast.path("scene.toml"), *words)
    assert (code, err) == (0, "")
    return json.loads(out)


def refused(jblast: Command, *options: str, scene: str | None = None) -> str:
    if scene is not None:
        jblast.file("scene.toml", scene)
    words = ["--out", jblast.path("out"), *options]
    message = jblast.refused("render", jblast.path("scene.toml"), *words)
    assert not (jblast.directory / "out").exists()
    assert message.count("\n") == 1
    return message
