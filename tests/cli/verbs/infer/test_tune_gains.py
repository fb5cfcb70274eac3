"""`jblast tune --gains`: what is refused, and what it prints and writes."""

import json
import tomllib

import pytest
from jsonschema import Draft202012Validator

from docs.generate.documents import schema

VEHICLE = """
[vehicle]
model = "iris"
position_m = [4.0, 0.0, 3.0]
control = { integral = true }
"""
CHARGE = """
[charge]
mass_kg = { uniform = [0.3, 1.0] }
position_m = [0.0, 0.0, 0.0]
time_s = 0.3
"""
WORLD = """
[world]
count = 2
region_m = { ring = [5, 10] }
mass_kg = { uniform = [1, 2] }
time_s = { uniform = [1, 5] }
"""
SCENE = CHARGE + VEHICLE


@pytest.mark.parametrize(
    ("scene", "options", "words"),
    [
        (SCENE, ("--gains", "mic.wav"), "RECORDED: expected no recording with"),
        (SCENE, ("--gains", "--free", "noise_pa"), "--free: expected it with a rec"),
        (SCENE, ("--gains", "--fps", "9"), "--fps: expected no recording with"),
        (SCENE, ("mic.wav", "--margin-db", "6"), "--margin-db: expected it with --g"),
        (SCENE, ("--gains", "--vehicles", "1"), "vehicles: expected two blasts"),
        (SCENE, ("--gains", "--vehicles", "0"), "vehicles: expected two blasts"),
        (SCENE, ("--gains", "--margin-deg", "0"), "expected a positive number"),
        (SCENE, ("--gains", "--delay", "-1"), "delay: expected a time of 0 s or more"),
        (CHARGE, ("--gains",), "expected a vehicle with its model"),
        (
            CHARGE + '[vehicle]\nmission = "survey.plan"\nmodel = "iris"\n',
            ("--gains",),
            "[vehicle] mission",
        ),
        (VEHICLE, ("--gains",), "charge_mass_kg is free"),
        (SCENE + WORLD, ("--gains",), "[world]"),
        (SCENE.replace("{ uniform = [0.3, 1.0] }", "1.0"), ("--gains",), "prior"),
    ],
)
def test_what_cannot_be_is_one_message(jblast, scene, options, words):
    name = jblast.file("scene.toml", scene)
    first, *rest = options
    asked = (name, first, *rest) if first != "--gains" else (name, *rest, first)
    assert words in jblast.refused("tune", *asked)


@pytest.mark.slow
def test_gains_are_tuned_printed_and_written(jblast):
    name, out = jblast.file("scene.toml", SCENE), jblast.path("tuned")
    asked = ("--gains", "--vehicles", "4", "--json", "--out", out)
    code, said, _ = jblast("tune", name, *asked)
    answer = json.loads(said)
    assert code == (0 if answer["converged"] else 4)
    Draft202012Validator(schema("tune_gains")).validate(answer)
    assert answer["after"]["gain_margin_db"] >= 6.0
    assert answer["after"]["phase_margin_deg"] >= 35.0
    assert answer["cut"] > 0.1
    assert answer["files"] == ["scene.toml", "tune.json", "tune.png"]
    held = jblast.directory / "tuned"
    assert json.loads((held / "tune.json").read_text()) == answer
    control = tomllib.loads((held / "scene.toml").read_text())["vehicle"]["control"]
    assert control["kd_pos"] == answer["after"]["gains"]["kd_pos"]
    assert (held / "tune.png").read_bytes()[:4] == b"\x89PNG"
