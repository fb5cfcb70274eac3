"""`jblast tune` from a shell: what is refused, and what it prints and writes."""

import json
import tomllib

import pytest
from jsonschema import Draft202012Validator

from docs.generate.documents import schema
from tests.cli.cli_files import table

SCENE = """
[charge]
mass_kg = 15
position_m = [0, 0, 1]

[law]
fireball_growth_s = 0.0025  # grows slowly

[camera]
position_m = [0, -40, 2]
look_at_m = [0, 0, 3]
width = 16
height = 12
focal_px = 25
frames_hz = 1000
"""
FILES = ["scene.toml", "tune.json", "tune.png", "report.html"]
GROWTH = ("--free", "fireball_growth_s")


@pytest.fixture
def scene(jblast) -> str:
    return jblast.file("scene.toml", SCENE)


RECORDINGS = table("""
none.wav --free fireball_growth_s => none.wav: no such file or directory
film.mp4 --free fireball_growth_s => film.mp4: expected a complete video
events.h5 --free fireball_growth_s => events.h5: expected a complete .h5 file
film.mp4 --sensor mic => --sensor
events.h5 --free fireball_growth_s --fps 100 => --fps
mic.wav --free fireball_growth_s --start 1 => --start
film.mp4 --free fireball_growth_s --fps 0 => --fps: expected a positive
""")


@pytest.mark.parametrize(("words", "said"), RECORDINGS)
def test_a_recording_that_cannot_be_used_is_one_message(jblast, scene, words, said):
    name, *options = words.split()
    path = jblast.path(name) if name[:4] == "none" else jblast.file(name, "junk")
    assert said in jblast.refused("tune", scene, path, *options)


@pytest.mark.slow
def test_frames_that_were_rendered_are_tuned_back(jblast, scene):
    truth = jblast.file("true.toml", SCENE.replace("0.0025", "0.004"))
    film = jblast.path("film")
    asked = ("--seconds", "0.03", "--mode", "rgb")
    assert jblast("render", truth, "--out", film, *asked)[0] == 0
    frames = str(jblast.directory / "film" / "frames")
    out = jblast.path("tuned")
    code, said, err = jblast("tune", scene, frames, *GROWTH, "--out", out, "--json")
    assert code == 0, err
    answer = json.loads(said)
    Draft202012Validator(schema("tune")).validate(answer)
    assert answer == json.loads(jblast.text("tuned/tune.json"))
    one = answer["estimates"]["fireball_growth_s"]
    assert one["q05"] - 4 * one["sd"] < 0.004 < one["q95"] + 4 * one["sd"]
    assert answer["files"] == FILES
    written = tomllib.loads(jblast.text("tuned/scene.toml"))
    assert "# grows slowly" in jblast.text("tuned/scene.toml")
    assert written["law"]["fireball_growth_s"] == pytest.approx(one["value"])


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
BLAST = CHARGE + VEHICLE
GAINS = table("""
mic.wav --gains => RECORDED: expected no recording with
--free noise_pa --gains => --free: expected no recording with
--fps 9 --gains => --fps: expected no recording with
mic.wav --margin-db 6 => --margin-db: expected it with --g
--vehicles 1 --gains => vehicles: expected two blasts
--margin-deg 0 --gains => expected a positive number
--delay -1 --gains => delay: expected a time of 0 s or more
""")


@pytest.mark.parametrize(("options", "said"), GAINS)
def test_an_option_that_gains_do_not_take_is_one_message(jblast, options, said):
    name = jblast.file("scene.toml", BLAST)
    assert said in jblast.refused("tune", name, *options.split())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (CHARGE, "expected a vehicle with its model"),
        (CHARGE + VEHICLE + 'mission = "survey.plan"\n', "[vehicle] mission"),
        (VEHICLE, "charge_mass_kg: expected a value or a prior, got a number that is"),
        (BLAST + WORLD, "[world]"),
        (BLAST.replace("{ uniform = [0.3, 1.0] }", "1.0"), "prior"),
    ],
)
def test_a_scene_without_random_blasts_of_a_vehicle_is_one_message(jblast, text, said):
    assert said in jblast.refused("tune", jblast.file("s.toml", text), "--gains")


@pytest.mark.slow
def test_gains_are_tuned_printed_and_written(jblast):
    name, out = jblast.file("scene.toml", BLAST), jblast.path("tuned")
    asked = ("--gains", "--vehicles", "4", "--json", "--out", out)
    code, said, _ = jblast("tune", name, *asked)
    answer = json.loads(said)
    assert code == (0 if answer["converged"] else 4)
    Draft202012Validator(schema("tune_gains")).validate(answer)
    assert answer["after"]["gain_margin_db"] >= 6.0
    assert answer["after"]["phase_margin_deg"] >= 35.0
    assert answer["cut"] > 0.1
    assert answer["files"] == FILES
    held = jblast.directory / "tuned"
    assert json.loads((held / "tune.json").read_text()) == answer
    control = tomllib.loads((held / "scene.toml").read_text())["vehicle"]["control"]
    assert control["kd_pos"] == answer["after"]["gains"]["kd_pos"]
    assert (held / "tune.png").read_bytes()[:4] == b"\x89PNG"
