"""What `jblast render` refuses, and files it leaves alone."""

from pathlib import Path

import pytest
from PIL import Image

from jblast.sensors.camera import film
from jblast.sensors.camera.files import images
from tests.cli.cli_files import table
from tests.cli.verbs.simulate.render.scenes import (
    CAMERA,
    CHARGE,
    refused,
    rendered,
)

SCENES = table("""
focal_px = 24 -> focal_px = 0 => [camera] focal_px: expected a number that is positive
focal_px = 24 -> focal_px = nan =>\
 [camera] focal_px: expected a finite number
0.3] -> -0.3] => [camera] threshold[1]: expected a number that is positive, got -0.3
frames_hz = 500 -> frames_hz = 0 => [camera] frames_hz: expected a number that is
width = 24 ->  => [camera] width: expected a whole number
mass_kg = 15.0 -> mass_kg = "free" =>\
 charge_mass_kg: expected a value or a prior, got a number that is free
mass_kg = 15.0 ->  => charge_mass_kg: expected a value or a prior
position_m = [0, 0, 1] -> range_m = 5.0 => [charge] range_m: expected position_m
[0, -40, 2] -> [0, -40, -2] => position on or above the ground, up = 0, got up = -2 m
[0, 0, 4] -> [0, -80, 2] => the blast is towards 0 degrees from north, -1 degrees up
[0, 0, 4] -> [0, -80, 2] => looks towards 180 degrees from north, 0 degrees up
""")


@pytest.mark.parametrize(("change", "said"), SCENES)
def test_a_scene_that_cannot_be_filmed_is_refused(jblast, change, said):
    old, _, new = change.partition(" -> ")
    assert old in CHARGE + CAMERA
    scene = (CHARGE + CAMERA).replace(old, new)
    assert said in refused(jblast, "--seconds", "0.01", scene=scene)


def test_a_scene_without_a_camera_is_refused(jblast):
    assert "expected a [camera], got none" in refused(jblast, scene=CHARGE)


OPTIONS = table("""
--fps 0 => --fps: expected a positive number, got '0'
--fps nan => --fps: expected a positive number
--times 3 => --times: expected START:STOP
--times now:then => --times: expected START:STOP
--times 0:inf => --times: expected START:STOP
--times 2.1:2.0 => expected START before STOP, got '2.1:2.0'
--times 2:3 --seconds 1 => either --times or --seconds
--seconds 0 => --seconds: expected a positive number
--seconds 0.001 => --seconds: expected 2 to 1,000,000 frames
--seconds 1e9 => got 500,000,000,000 of 500 Hz
--threshold=-0.2 => --threshold: expected a positive number
--background night => --background: expected a grey
--views nowhere => nowhere: expected a directory of views with views.toml, got no such
""")


@pytest.mark.parametrize(("options", "said"), OPTIONS)
def test_options_that_cannot_be_are_refused(jblast, options, said):
    assert said in refused(jblast, *options.split())


def test_an_existing_output_is_left_alone_without_force(jblast):
    rendered(jblast, "--seconds", "0.02")
    out = jblast.directory / "out"
    before = {p: p.read_bytes() for p in out.rglob("*") if p.is_file()}
    words = ["--seconds", "0.01", "--out", str(out)]
    for mode in ("rgb", "events", "both"):
        message = jblast.refused(
            "render", jblast.path("scene.toml"), *words, "--mode", mode
        )
        assert "exists already; expected a new file, or --force" in message
    assert {p: p.read_bytes() for p in out.rglob("*") if p.is_file()} == before
    rendered(jblast, "--seconds", "0.01", "--force")
    # nothing of the longer film is left among the frames of the shorter
    assert len(list((out / "frames").iterdir())) == 5


def test_what_is_read_is_not_overwritten(jblast):
    frames = jblast.directory / "out" / "frames"
    frames.mkdir(parents=True)
    for k in range(5):
        Image.new("RGB", (24, 18)).save(frames / f"{k:04d}.png")
    before = {p: p.read_bytes() for p in frames.iterdir()}
    for background in (frames, frames / "0000.png"):
        words = ["--seconds", "0.01", "--force", "--background", str(background)]
        words += ["--out", jblast.path("out")]
        message = jblast.refused("render", jblast.path("scene.toml"), *words)
        assert "expected another --out; this file is an input of the frames" in message
    assert {p: p.read_bytes() for p in frames.iterdir()} == before


def test_frames_written_before_an_interruption_stay_whole(jblast, monkeypatch):
    monkeypatch.setattr(film, "PIXELS", 4 * 24 * 18)  # four frames a block
    save, done = Image.Image.save, []

    def interrupted(self, path, **options):
        if len(done) == 6:
            Path(path).write_bytes(b"\x89PNG half of it")
            raise KeyboardInterrupt
        done.append(path)
        return save(self, path, **options)

    monkeypatch.setattr(Image.Image, "save", interrupted)
    words = ["--seconds", "0.02", "--out", jblast.path("out")]
    code, out, err = jblast("render", jblast.path("scene.toml"), *words)
    assert (code, out, err) == (130, "", "jblast: interrupted\n")
    left = sorted(p for p in (jblast.directory / "out").rglob("*") if p.is_file())
    # those of the first block, and what its threads had finished of the second
    assert [p.name for p in left[:4]] == [f"{k:04d}.png" for k in range(4)]
    assert len(left) < 9
    for path in left:
        assert images.read_png(path).shape == (18, 24, 3)
