import tomllib

import pytest

from jblast.sensors.camera.bake import baking
from tests.sensors.camera.bake.fake_blender import installed

SMALL = ("--views", "2", "--frames", "3", "--size", "16")


@pytest.fixture
def command(jblast, tmp_path, monkeypatch) -> tuple[str, ...]:
    monkeypatch.setattr(baking, "LOOK_S", 0.02)
    program = str(installed(tmp_path))
    return ("bake", "--out", jblast.path("set"), *SMALL, "--blender", program)


def test_a_set_is_made_and_told(jblast, command):
    code, said, err = jblast(*command)
    assert code == 0, err
    assert "2 views of 3 frames of 16 x 16 pixels" in said
    assert "views.toml and 00.webp to 01.webp" in said
    index = tomllib.loads(jblast.text("set/views.toml"))
    assert index["made"]["sampling"] == "hardin"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--frames", "1"), "--frames: expected 2 to 60 frames, got 1"),
        (("--views", "0"), "--views: expected 1 to 512, got 0"),
        (("--size", "4"), "--size: expected 16 to 512, got 4"),
        (("--blender", "nowhere"), "--blender: expected the program Blender at"),
        (("--engine", "other"), "--engine"),
    ],
)
def test_what_cannot_be_is_one_message(jblast, options, words):
    assert words in jblast.refused("bake", "--out", jblast.path("set"), *options)
    assert not (jblast.directory / "set").exists()


def test_a_killed_blender_is_bad_input_and_the_same_command_goes_on(
    jblast, command, monkeypatch
):
    monkeypatch.setenv("FAKE_BLENDER", "kill:8")
    message = jblast.refused(*command)
    assert "blender.log: Blender was killed by signal 9" in message
    assert "1 of 2 views are finished and kept" in message
    monkeypatch.delenv("FAKE_BLENDER")
    assert jblast(*command)[0] == 0
    again = jblast.refused(*command)
    assert "exists already; expected a new directory, or --force" in again
    assert jblast(*command, "--force")[0] == 0


def test_a_place_that_cannot_be_written_to_is_named(jblast, command):
    jblast.file("set", "a file")
    assert "set: cannot be written" in jblast.refused(*command)
