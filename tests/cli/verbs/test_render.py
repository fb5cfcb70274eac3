import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from PIL import Image

from jblast.sensors.camera import film
from jblast.sensors.camera.files import png as png_files
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
SENSOR = """[[sensor]]
name = "a"
position_m = [30.0, 0.0, 1.0]
records = { air_arrival_s = 1e-4, peak_overpressure_pa = 0.05 }
"""


@pytest.fixture
def jblast(tmp_path, capsys) -> Command:
    jblast = Command(tmp_path, capsys)
    jblast.file("scene.toml", CHARGE + CAMERA)
    return jblast


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


def events_in(path: str) -> dict[str, np.ndarray]:
    with h5py.File(path) as file:
        return {name: np.asarray(file[f"events/{name}"]) for name in "xytp"}


def test_frames_events_and_a_contact_sheet(jblast):
    said = rendered(jblast, "--seconds", "0.04")
    assert (said["frames"], said["width"], said["height"]) == (20, 24, 18)
    assert (said["start_s"], said["fps"], said["threshold"]) == (2.0, 500, [0.2, 0.3])
    assert said["duration_s"] == pytest.approx(0.038)
    frames = sorted((jblast.directory / "out" / "frames").iterdir())
    assert [path.name for path in frames] == [f"{k:04d}.png" for k in range(20)]
    first, second = (np.asarray(Image.open(path)) for path in frames[:2])
    assert first.shape == (18, 24, 3)
    assert (first == 118).all()  # sRGB of the grey of 0.18; the burst is now
    assert second.max() == 255
    events = events_in(said["files"]["events"])
    assert len(events["t"]) == said["events"] == said["brighter"] + said["darker"] > 50
    assert 0 < events["t"].min() < events["t"].max() <= 38_000
    # the blast is ahead, a little below the middle
    assert abs(np.median(events["x"]) - 11.5) < 1
    assert png_files.read_png(said["files"]["contact_sheet"]).shape[1] > 100


def test_the_frames_are_what_jblast_events_reads(jblast):
    said = rendered(jblast, "--seconds", "0.02", "--background", "0.3")
    again = ["--fps", "500", "--srgb", "--noise", "off", "--threshold", "0.2,0.3"]
    out = ["--out", jblast.path("again.h5"), "--json"]
    code, told, _ = jblast("events", said["files"]["frames"], *again, *out)
    assert code == 0
    # what is brighter than white has more events than 8 bits know of
    assert 50 < json.loads(told)["events"] < said["events"]


@pytest.mark.slow  # the solver is compiled for half a minute
def test_times_of_events_owe_nothing_to_the_frame_rate(jblast):
    answers = []
    for fps in ("26", "101"):
        said = rendered(jblast, "--times", "2:2.1", "--fps", fps, "--force")
        assert (said["stamps"], said["stamp_error_s"]) == ("solved for", 1e-6)
        answers.append(events_in(said["files"]["events"]))
    slow, fast = answers
    both = min(slow["t"].max(), fast["t"].max())  # their last frames differ
    slow, fast = ({n: v[e["t"] <= both] for n, v in e.items()} for e in answers)
    orders = [np.lexsort((e["t"], e["p"], e["x"], e["y"])) for e in (slow, fast)]
    assert len(slow["t"]) > 50
    for name in "xyp":
        np.testing.assert_array_equal(slow[name][orders[0]], fast[name][orders[1]])
    # each is rounded to a microsecond
    off = slow["t"][orders[0]] - fast["t"][orders[1]]
    assert np.abs(off).max() <= 1


def test_a_real_camera_has_its_times_to_a_bound_that_is_said(jblast):
    said = rendered(jblast, "--seconds", "0.04", "--mode", "events", "--noise", "on")
    assert (said["stamps"], said["stamp_error_s"]) == ("interpolated", 1e-4)


def test_modes_write_what_they_say(jblast):
    both = rendered(jblast, "--seconds", "0.02")
    kept = events_in(both["files"]["events"])
    frames = {
        p.name: p.read_bytes() for p in (jblast.directory / "out/frames").iterdir()
    }
    for mode, written in (("rgb", "frames"), ("events", "events.h5")):
        shutil.rmtree(jblast.directory / "out")
        said = rendered(jblast, "--seconds", "0.02", "--mode", mode)
        names = {path.name for path in (jblast.directory / "out").iterdir()}
        assert names == {written, "contact_sheet.png"}
        assert set(said["files"]) == {written.removesuffix(".h5"), "contact_sheet"}
        if mode == "rgb":
            for name, data in frames.items():
                assert (jblast.directory / "out/frames" / name).read_bytes() == data
        else:
            for name, column in events_in(said["files"]["events"]).items():
                np.testing.assert_array_equal(column, kept[name])


def test_what_is_said_without_json(jblast):
    words = ["--out", jblast.path("out"), "--seconds", "0.01"]
    code, out, _ = jblast("render", jblast.path("scene.toml"), *words)
    assert code == 0
    assert out.startswith("5 frames of 24 x 18 pixels at 500 Hz from 2 s: ")
    assert "darker; times interpolated, within 100 us for 99 in 100\n" in out
    assert out.endswith(
        "".join(
            f"{jblast.path('out')}/{name}\n"
            for name in ("frames", "events.h5", "contact_sheet.png")
        )
    )


def test_times_are_those_asked_for(jblast):
    said = rendered(jblast, "--times", "1.99:2.01", "--fps", "1000", "--mode", "rgb")
    assert (said["start_s"], said["frames"]) == (1.99, 20)
    frames = sorted((jblast.directory / "out" / "frames").iterdir())
    changed = [not (np.asarray(Image.open(p)) == 118).all() for p in frames]
    assert changed == [False] * 11 + [True] * 9  # at 2 s it has no size yet
    said = rendered(jblast, "--times", "-0.01:0.01", "--mode", "rgb", "--force")
    assert (said["start_s"], said["frames"]) == (-0.01, 10)


def test_the_default_lasts_until_no_fireball_glows(jblast):
    said = rendered(jblast, "--fps", "100", "--mode", "rgb")
    # 0.258 * 15^0.349 s
    assert said["frames"] == 67
    jblast.file("scene.toml", CHARGE.replace("15.0", "1e6") + CAMERA)
    said = rendered(jblast, "--force", "--mode", "rgb", "--fps", "4000")
    assert said["frames"] == 1000
    assert len(list((jblast.directory / "out" / "frames").iterdir())) == 1000


def test_priors_are_drawn_and_repeat_with_the_seed(jblast):
    prior = CHARGE.replace("15.0", "{ lognormal = [15.0, 2.0] }")
    jblast.file("scene.toml", prior + CAMERA)
    counts = [
        rendered(jblast, "--seconds", "0.02", "--seed", seed, "--force")["events"]
        for seed in ("0", "0", "1")
    ]
    assert counts[0] == counts[1] != counts[2]


def test_exposure_blurs_frames_but_not_events(jblast):
    sharp = rendered(jblast, "--seconds", "0.02")
    before = (jblast.directory / "out" / "frames" / "0003.png").read_bytes()
    jblast.file("scene.toml", CHARGE + CAMERA + "exposure_s = 2e-3\n")
    blurred = rendered(jblast, "--seconds", "0.02", "--force")
    assert blurred["events"] == sharp["events"]
    assert (jblast.directory / "out" / "frames" / "0003.png").read_bytes() != before


VIEWS = """frames_hz = 100.0
charge_mass_kg = 15.0
metres_per_pixel = 0.5
[[view]]
frames = "south"
azimuth_deg = 180.0
"""


def test_pictures_may_stand_for_the_fireball(jblast):
    folder = jblast.directory / "views" / "south"
    folder.mkdir(parents=True)
    for k in range(3):
        picture = np.zeros((21, 21, 4), np.uint8)
        picture[8:13, 8:13] = [0, 80 * (k + 1), 0, 255]
        Image.fromarray(picture).save(folder / f"{k}.png")
    words = ["--views", jblast.path("views"), "--mode", "rgb", "--force"]
    assert "has no index; expected a directory of views with views.toml" in refused(
        jblast, *words
    )
    jblast.file("views/views.toml", VIEWS)
    said = rendered(jblast, *words)
    assert said["frames"] == 15  # three pictures of 10 ms at 500 Hz
    image = np.asarray(Image.open(jblast.path("out/frames/0005.png")))
    np.testing.assert_array_equal(image[10, 11:13], [[0, 160, 0]] * 2)
    assert (image[0] == 118).all()


def without(key: str) -> str:
    return "\n".join(line for line in CAMERA.splitlines() if key not in line) + "\n"


AWAY = CAMERA.replace("[0, 0, 4]", "[0, -80, 2]")
BAD_SCENES = {
    "no camera": (CHARGE, r"expected a [camera] to look through, got none"),
    "looking away": (
        CHARGE + AWAY,
        "looks towards 180 degrees from north, 0 degrees up; the blast is towards 0 "
        "degrees from north, -1 degrees up, 179 degrees from its axis",
    ),
    "zero focal length": (
        CHARGE + CAMERA.replace("focal_px = 24", "focal_px = 0"),
        "[camera] focal_px: expected a positive number, got 0",
    ),
    "focal length NaN": (
        CHARGE + CAMERA.replace("focal_px = 24", "focal_px = nan"),
        "[camera] focal_px: expected a positive number, got nan",
    ),
    "negative threshold": (
        CHARGE + CAMERA.replace("0.3]", "-0.3]"),
        "[camera] threshold[1]: expected a positive number, got -0.3",
    ),
    "0 frames a second": (
        CHARGE + CAMERA.replace("frames_hz = 500", "frames_hz = 0"),
        "[camera] frames_hz: expected a positive number, got 0",
    ),
    "no width": (CHARGE + without("width"), "[camera] width: expected a whole number"),
    "a free mass": (
        CHARGE.replace("15.0", '"free"') + CAMERA,
        "charge_mass_kg is free and cannot be drawn; give it a value or a prior",
    ),
    "no mass": (
        "[charge]\nposition_m = [0, 0, 1]\n" + CAMERA,
        "charge_mass_kg is free",
    ),
    "a range": (
        '[charge]\nmass_kg = 1.0\nrange_m = 5.0\n[[sensor]]\nname = "a"\n' + CAMERA,
        "[charge] range_m: expected position_m",
    ),
    "below the ground": (
        CHARGE + CAMERA.replace("[0, -40, 2]", "[0, -40, -2]"),
        "expected a place not below the ground, up = 0, got up = -2 m",
    ),
}


@pytest.mark.parametrize(("scene", "said"), BAD_SCENES.values(), ids=BAD_SCENES)
def test_a_scene_that_cannot_be_filmed_is_refused(jblast, scene, said):
    assert said in refused(jblast, "--seconds", "0.01", scene=scene)


BAD_OPTIONS = {
    "fps 0": (["--fps", "0"], "--fps: expected a positive number, got '0'"),
    "fps NaN": (["--fps", "nan"], "--fps: expected a positive number"),
    "times in one": (["--times", "3"], "--times: expected START:STOP"),
    "times in words": (["--times", "now:then"], "--times: expected START:STOP"),
    "no end": (["--times", "0:inf"], "--times: expected START:STOP"),
    "out of order": (
        ["--times", "2.1:2.0"],
        "expected START before STOP, got '2.1:2.0'",
    ),
    "twice": (["--times", "2:3", "--seconds", "1"], "either --times or --seconds"),
    "no time": (["--seconds", "0"], "--seconds: expected a positive number"),
    "one frame": (["--seconds", "0.001"], "--seconds: expected 2 to 1,000,000 frames"),
    "too many": (["--seconds", "1e9"], "got 500,000,000,000 of 500 Hz"),
    "a threshold": (["--threshold=-0.2"], "--threshold: expected a positive number"),
    "no rays": (["--supersample", "0"], "--supersample: expected at least 1, got 0"),
    "no background": (["--background", "sky"], "--background: expected a grey"),
    "no views": (["--views", "nowhere"], "nowhere: no such directory"),
}


@pytest.mark.parametrize(("options", "said"), BAD_OPTIONS.values(), ids=BAD_OPTIONS)
def test_options_that_cannot_be_are_refused(jblast, options, said):
    assert said in refused(jblast, *options)


def test_a_frame_rate_beyond_the_exposure_is_refused(jblast):
    scene = CHARGE + CAMERA + "exposure_s = 2e-3\n"
    message = refused(jblast, "--fps", "501", scene=scene)
    assert "--fps: expected at most 500 Hz, as the camera's exposure_s" in message


def test_a_camera_may_look_away_at_a_background_that_moves(jblast):
    jblast.file("scene.toml", CHARGE + AWAY)
    (jblast.directory / "behind").mkdir()
    for k in range(5):
        image = np.full((18, 24, 3), 40 * k + 30, np.uint8)
        Image.fromarray(image).save(jblast.directory / "behind" / f"{k}.png")
    words = ["--seconds", "0.01", "--background", jblast.path("behind")]
    said = rendered(jblast, *words)
    assert said["events"] > 18 * 24
    frame = np.asarray(Image.open(jblast.path("out/frames/0003.png")))
    assert (frame == 150).all()


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
    rendered(jblast, "--seconds", "0.01")
    frames = jblast.directory / "out" / "frames"
    before = {p: p.read_bytes() for p in frames.iterdir()}
    for background in (frames, frames / "0000.png"):
        words = ["--seconds", "0.01", "--force", "--background", str(background)]
        words += ["--out", jblast.path("out")]
        message = jblast.refused("render", jblast.path("scene.toml"), *words)
        assert "expected another --out, as the frames are made from" in message
    assert {p: p.read_bytes() for p in frames.iterdir()} == before


def test_a_directory_that_is_a_file_is_refused(jblast):
    jblast.file("out", "mine")
    words = ["--seconds", "0.01", "--out", jblast.path("out")]
    message = jblast.refused("render", jblast.path("scene.toml"), *words)
    assert "expected a directory, got a file" in message
    assert jblast.text("out") == "mine"


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
    assert [p.name for p in left] == [f"{k:04d}.png" for k in range(6)]
    for path in left:
        assert png_files.read_png(path).shape == (18, 24, 3)


@pytest.mark.slow
def test_a_camera_changes_nothing_of_what_the_sensors_say(jblast):
    answers = []
    for camera in ("", CAMERA):
        scene = CHARGE.replace("15.0", "{ lognormal = [15.0, 1.5] }") + SENSOR + camera
        path = jblast.file("scene.toml", scene)
        log = jblast.path("log.csv")
        assert jblast("simulate", path, "--out", log, "--force")[0] == 0
        code, fitted, _ = jblast("fit", log, "--scene", path, "--json")
        assert code == 0
        _, planned, _ = jblast("bound", path, "--json")
        answers.append((jblast.text("log.csv"), fitted, planned))
    assert answers[0] == answers[1]
