"""`jblast render`: events that owe nothing to the frames; sets that are broken."""

import json

import h5py
import numpy as np
import pytest

from tests.cli.cli_files import Command
from tests.sensors.camera.files.made_video import flat, make_video

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


def refused(jblast: Command, *options: str) -> str:
    words = ["--out", jblast.path("out"), *options]
    message = jblast.refused("render", jblast.path("scene.toml"), *words)
    assert not (jblast.directory / "out").exists()
    assert message.count("\n") == 1
    return message


def events_in(path: str) -> dict[str, np.ndarray]:
    with h5py.File(path) as file:
        return {name: np.asarray(file[f"events/{name}"]) for name in "xytp"}


@pytest.mark.slow
def test_times_of_events_owe_nothing_to_the_frame_rate(jblast):
    answers = []
    for fps in ("26", "101"):
        said = rendered(jblast, "--times", "2:2.1", "--fps", fps, "--force")
        assert (said["stamps"], said["stamp_error_s"]) == ("interpolated", 1e-6)
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


@pytest.mark.slow
def test_events_of_a_world_are_those_of_its_film(jblast):
    """The same pixels and signs; all but 1 % of the times within the bound of runs."""
    scene = jblast.file("scene.toml", CHARGE.replace("2.0", "0.1") + CAMERA)
    film = rendered(jblast, "--times", "0:0.3", "--views", "explosion")
    words = ("world", scene, "--seconds", "0.3", "--out", jblast.path("run"), "--json")
    code, out, err = jblast(*words)
    assert (code, err) == (0, "")
    files = film["files"]["events"], jblast.path("run/camera/events.h5")
    known, found = map(events_in, files)
    last = 1e6 * film["duration_s"]  # a run ends an interval later
    found = {name: v[found["t"] <= last] for name, v in found.items()}
    assert len(known["t"]) > 500
    orders = [np.lexsort((e["t"], e["p"], e["x"], e["y"])) for e in (known, found)]
    for name in "xyp":
        np.testing.assert_array_equal(known[name][orders[0]], found[name][orders[1]])
    times = [
        1.0 * e["t"][order] for e, order in zip((known, found), orders, strict=True)
    ]
    off = np.abs(times[0] - times[1])
    assert np.quantile(off, 0.99) < 1e6 * json.loads(out)["camera"]["stamp_error_s"]


def cut(path, share=0.5):
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])


@pytest.mark.parametrize("verb", ["render", "detect", "events"])
def test_a_video_that_breaks_off_or_varies_is_refused_by_name(jblast, verb):
    short = make_video(jblast.directory / "short.mp4", flat(*range(16, 46)))
    cut(short, 0.6)
    stamps = [0, 20, 40, 60, 80, 180, 200, 220]
    varies = make_video(
        jblast.directory / "varies.mp4", flat(*range(20, 28)), stamps=stamps
    )
    for path, said in (
        (short, "short.mp4: expected a complete video"),
        (varies, "varies.mp4: expected a constant frame rate"),
    ):
        if verb == "render":
            words = ["--seconds", "0.01", "--background", str(path)]
            assert said in refused(jblast, *words)
            continue
        if verb == "detect" and path == varies:  # it goes by the stamps of the file
            continue
        out = ["--out", jblast.path("out.h5")] if verb == "events" else []
        message = jblast.refused(verb, str(path), *out)
        assert said in message
        assert message.count("\n") == 1
