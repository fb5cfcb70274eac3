"""`jblast tune` from a shell: what is refused, and what it prints and writes."""

import json
import tomllib

import pytest
from jsonschema import Draft202012Validator

from docs.generate.documents import schema

SCENE = """
[charge]
mass_kg = 15
position_m = [0, 0, 1]

[law]
fireball_growth_s = 0.0025

[camera]
position_m = [0, -40, 2]
look_at_m = [0, 0, 3]
width = 16
height = 12
focal_px = 25
frames_hz = 1000
"""
GROWTH = ("--free", "fireball_growth_s")


@pytest.fixture
def scene(jblast) -> str:
    return jblast.file("scene.toml", SCENE)


@pytest.mark.parametrize(
    ("name", "content", "options", "words"),
    [
        ("none.wav", None, GROWTH, "none.wav: no such file or directory"),
        ("film.mp4", "junk", GROWTH, "film.mp4: expected a complete video"),
        ("events.h5", "junk", GROWTH, "events.h5: expected a complete .h5 file"),
        ("film.mp4", "junk", ("--sensor", "mic"), "--sensor"),
        ("events.h5", "junk", (*GROWTH, "--fps", "100"), "--fps"),
        ("mic.wav", "junk", (*GROWTH, "--start", "1"), "--start"),
        ("film.mp4", "junk", (*GROWTH, "--fps", "0"), "--fps: expected a positive"),
    ],
)
def test_what_cannot_be_is_one_message(jblast, scene, name, content, options, words):
    path = jblast.path(name) if content is None else jblast.file(name, content)
    assert words in jblast.refused("tune", scene, path, *options)


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
    assert answer["files"] == ["scene.toml", "tune.json", "tune.png"]
    written = tomllib.loads(jblast.text("tuned/scene.toml"))
    assert written["law"]["fireball_growth_s"] == pytest.approx(one["value"])
