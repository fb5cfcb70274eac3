"""A film as a video, and its events in other formats."""

import numpy as np
import pytest

from jblast.sensors.camera.files.event_files import read_events
from jblast.sensors.camera.files.images import read_png
from jblast.sensors.camera.files.video import open_video
from tests.cli.verbs.simulate.render.scenes import CAMERA, CHARGE, refused, rendered

SHORT = "--seconds", "0.02"


@pytest.mark.slow
def test_a_video_shows_the_frames(jblast):
    jblast.file("scene.toml", CHARGE + CAMERA.replace("width = 24", "width = 23"))
    path = jblast.path("film.mp4")
    answer = rendered(jblast, *SHORT, "--mode", "rgb", "--video", path)
    assert (answer["files"]["video"], answer["video_fps"]) == (path, 30.0)
    video = open_video(path)
    assert (len(video), video.width, video.height) == (10, 24, 18)
    np.testing.assert_allclose(video.times, np.arange(10) / 30, rtol=1e-9)
    for k, values in enumerate(video.frames()):
        frame = read_png(jblast.directory / "out" / "frames" / f"{k:04d}.png")
        # chroma of two by two pixels, and the encoder's loss
        off = values[:, :23].astype(float) - frame
        assert np.abs(off).mean() < 4.0
        np.testing.assert_array_equal(values.shape, (18, 24, 3))


@pytest.mark.parametrize(
    ("options", "hz", "said"),
    [
        (("--fps", "50"), 50.0, "(50 Hz, in real time)"),
        (("--video-fps", "25"), 25.0, "(25 Hz, 20 times slower than real time)"),
        (("--video-fps", "1000"), 1000.0, "(1000 Hz, 2 times faster than real time)"),
    ],
)
def test_how_fast_a_video_runs_is_said(jblast, options, hz, said):
    words = ["--out", jblast.path("out"), "--mode", "rgb", "--seconds", "0.06"]
    words += ["--video", jblast.path("a.mkv"), *options]
    code, out, _ = jblast("render", jblast.path("scene.toml"), *words)
    assert code == 0
    assert f"a.mkv {said}" in out
    # Matroska counts milliseconds
    step = open_video(jblast.path("a.mkv")).times[1]
    assert step == pytest.approx(1 / hz, abs=1.1e-3)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--video", "a.gif"), "a.gif: expected a name of a video ending in .mp4"),
        (("--video", "a.mp4", "--mode", "events"), "--video: expected --mode rgb"),
        (("--video-fps", "30"), "--video-fps: expected --video with it"),
    ],
)
def test_a_video_that_cannot_be_is_refused(jblast, options, said):
    assert said in refused(jblast, *SHORT, *options)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["raw", "aedat4"])
def test_events_may_have_another_format(jblast, suffix):
    options = *SHORT, "--mode", "events"
    rendered(jblast, *options)
    answer = rendered(jblast, *options, "--events-format", suffix, "--force")
    assert answer["files"]["events"] == jblast.path(f"out/events.{suffix}")
    ours, theirs = (
        read_events(jblast.path(f"out/events.{end}")) for end in ("h5", suffix)
    )
    assert len(ours.t) == answer["events"] > 0
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(one, other)
