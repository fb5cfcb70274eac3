import itertools
import json

import h5py
import numpy as np
import pytest
from PIL import Image

from jblast.sensors.camera.files.event_files import read_events
from tests.cli.cli_files import Command
from tests.sensors.camera.files.made_video import flat, make_video

SHAPE = (6, 9)
GREYS = (32, 64, 64, 128, 32, 16)
"""Doublings and halvings: with a threshold of ln 2, whole numbers of events."""
LN2 = repr(float(np.log(2.0)))


@pytest.fixture
def jblast(tmp_path, capsys) -> Command:
    (tmp_path / "frames").mkdir()
    for i, grey in enumerate(GREYS):
        save(tmp_path, i, np.full(SHAPE, grey, np.uint8))
    return Command(tmp_path, capsys)


def save(directory, number: int, pixels) -> None:
    Image.fromarray(pixels).save(directory / "frames" / f"frame_{number:04d}.png")


def column(file: h5py.File, name: str) -> np.ndarray:
    return np.asarray(file[name])


def converted(jblast: Command, *options: str, out: str = "events.h5"):
    arguments = ["--fps", "1000", "--threshold", LN2, "--noise", "off"]
    return jblast(
        "events", jblast.path("frames"), *arguments, *options, "--out", jblast.path(out)
    )


def refused(jblast: Command, *options: str, fps: str = "1000", out: str = "events.h5"):
    words = [*options, "--fps", fps, "--out", jblast.path(out)]
    message = jblast.refused("events", jblast.path("frames"), *words)
    assert not (jblast.directory / "events.h5").exists()
    assert message.count("\n") == 1
    return message


def test_events_of_frames_that_double_and_halve(jblast):
    code, out, _ = converted(jblast, "--json")
    assert code == 0
    answer = json.loads(out)
    pixels = SHAPE[0] * SHAPE[1]
    assert answer["events"] == 5 * pixels
    assert (answer["brighter"], answer["darker"]) == (2 * pixels, 3 * pixels)
    assert (answer["frames"], answer["width"], answer["height"]) == (6, 9, 6)
    with h5py.File(jblast.path("events.h5")) as file:
        t, p = column(file, "events/t"), column(file, "events/p")
        assert t.dtype == np.int64
        # two halvings between frames 3 and 4: at half that time, and at its end
        at, count = np.unique(t, return_counts=True)
        np.testing.assert_array_equal(at, [1000, 3000, 3500, 4000, 5000])
        assert (count == pixels).all()
        np.testing.assert_array_equal(p, np.repeat([1, 1, 0, 0, 0], pixels))
        np.testing.assert_array_equal(column(file, "events/x")[:9], np.arange(9))
        np.testing.assert_array_equal(column(file, "events/y")[:9], np.zeros(9))
        assert column(file, "t_offset") == 0


@pytest.mark.parametrize("suffix", [".raw", ".aedat4", ".npz"])
def test_other_formats_hold_the_same(jblast, suffix):
    converted(jblast)
    assert converted(jblast, out=f"events{suffix}")[0] == 0
    ours, theirs = (read_events(jblast.path(f"events{end}")) for end in (".h5", suffix))
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(one, other)


def video(jblast: Command, *options: str, stamps: list[int] | None = None):
    """Convert a video that doubles and halves, but for what 8 bits of it lose."""
    lumas = [60, 90, 90, 140, 60, 40]
    make_video(jblast.directory / "a.mp4", flat(*lumas), stamps)
    words = ["--noise", "off", "--out", jblast.path("events.h5"), *options]
    return jblast("events", jblast.path("a.mp4"), *words)


def test_a_video_goes_by_its_clock_or_by_what_is_said(jblast):
    code, out, _ = video(jblast, "--json")
    answer = json.loads(out)
    assert (code, answer["frames"], answer["fps"]) == (0, 6, pytest.approx(30.0))
    own = read_events(jblast.path("events.h5"))
    assert answer["events"] == len(own.t) > 0
    assert own.t.max() <= 5 / 30 * 1e6
    code, out, _ = video(jblast, "--json", "--fps", "1000", "--force")
    assert json.loads(out)["duration_s"] == pytest.approx(5e-3)
    slow = read_events(jblast.path("events.h5"))
    # thirty times a thirtieth of a second is a thousand times a millisecond
    np.testing.assert_allclose(slow.t * 1000 / 30, own.t, atol=1000 / 60 + 1)
    for name in "xyp":
        np.testing.assert_array_equal(getattr(slow, name), getattr(own, name))


def test_frames_without_events_give_an_empty_file(jblast):
    for i in range(len(GREYS)):
        save(jblast.directory, i, np.full(SHAPE, 9, np.uint8))
    code, out, _ = converted(jblast)
    assert code == 0
    assert ": 0 events" in out
    with h5py.File(jblast.path("events.h5")) as file:
        assert column(file, "events/t").shape == (0,)
        np.testing.assert_array_equal(column(file, "ms_to_idx"), np.zeros(6))


def test_numbers_without_zeros_before_them_are_put_in_order(jblast):
    for i, path in enumerate(sorted((jblast.directory / "frames").iterdir())):
        path.rename(path.with_name(f"f{i + 6}.png"))  # f10.png after f9.png
    _, out, _ = converted(jblast, "--json")
    assert json.loads(out)["events"] == 270


def test_nothing_is_left_of_a_file_that_could_not_be_finished(jblast):
    (jblast.directory / "frames" / "frame_0005.png").write_bytes(b"")
    refused(jblast)
    assert [path.name for path in jblast.directory.iterdir()] == ["frames"]


def test_the_default_camera_is_a_real_one_and_repeats_with_its_seed(jblast):
    for i in range(len(GREYS)):  # as one step, and then nothing
        save(jblast.directory, i, np.full(SHAPE, 200 if i else 40, np.uint8))
    times = []
    for i, seed in enumerate(("0", "0", "1")):
        words = ["--fps", "1000", "--seed", seed, "--out", jblast.path(f"{i}.h5")]
        assert jblast("events", jblast.path("frames"), *words)[0] == 0
        with h5py.File(jblast.path(f"{i}.h5")) as file:
            times.append(column(file, "events/t"))
    np.testing.assert_array_equal(times[0], times[1])
    assert not np.array_equal(times[0], times[2])
    # the ideal camera would send the same 8 events of every pixel, and none later
    assert len(np.unique(times[0])) > 100
    assert times[0].max() > 1000


RAMP = np.geomspace(1.2e-4, 1.8e-3, 40)
"""Of full scale: below half a step of 8 bits throughout."""


def level_crossings(light: np.ndarray, threshold: float = 0.2) -> list[tuple]:
    """Return time [us], column, row and polarity by the rule of ESIM, one by one.

    The logarithm is linear between two frames, 1 ms apart; each crossing of a level one
    threshold away from the last one is an event (Rebecq et al. 2018).
    """
    found = []
    for y, x in np.ndindex(light.shape[1:]):
        signal = np.log(light[:, y, x])
        level = signal[0]
        for k, (before, after) in enumerate(itertools.pairwise(signal)):
            way = 1 if after > before else -1
            while way * (after - level) >= threshold:
                level += way * threshold
                time = k + (level - before) / (after - before)
                found.append((1000.0 * time, x, y, int(way > 0)))
    return sorted(found)


def deep_frames(jblast: Command, kind: str) -> np.ndarray:
    """Write a dark ramp, and return the light that its files hold."""
    folder = jblast.directory / "frames"
    for old in folder.iterdir():
        old.unlink()
    gain = np.linspace(1.0, 1.5, SHAPE[0] * SHAPE[1]).reshape(SHAPE) / 1.5
    # back to a little above the first level: no crossing by rounding alone
    there_and_back = np.concatenate([RAMP, 1.3 * RAMP[::-1]])
    light = there_and_back[:, None, None] * gain
    if kind == "float":
        for k, frame in enumerate(light):
            np.save(folder / f"{k:04d}.npy", frame.astype(np.float32))
        return light.astype(np.float32).astype(float)
    values = np.rint(65535 * light).astype(np.uint16)
    for k, frame in enumerate(values):
        save(jblast.directory, k, frame)
    return values / 65535.0


@pytest.mark.parametrize("kind", ["grey", "float"])
def test_dark_light_of_deep_files_gives_the_events_of_another_model(jblast, kind):
    theirs = level_crossings(deep_frames(jblast, kind))
    arguments = ["--fps", "1000", "--noise", "off", "--json"]
    code, out, err = jblast(
        *("events", jblast.path("frames"), *arguments, "--out", jblast.path("e.npz"))
    )
    assert (code, err) == (0, "")
    ours = read_events(jblast.path("e.npz"))
    # there and back: ln(1.8e-3 / 1.2e-4) / 0.2 = 13.5, so about 13 up and down
    assert len(ours.t) == len(theirs) == pytest.approx(2 * 13 * 54, rel=0.1)
    found = sorted(zip(ours.t, ours.x, ours.y, ours.p, strict=True))
    by_pixel = [sorted((x, y, p, t) for t, x, y, p in part) for part in (found, theirs)]
    for own, other in zip(*by_pixel, strict=True):
        assert own[:3] == other[:3]
        assert abs(own[3] - other[3]) <= 0.5 + 1e-6  # whole microseconds in the file
    answer = json.loads(out)
    assert answer["bits"] == (None if kind == "float" else 16)
    assert (answer["below_darkest"], answer["warnings"]) == (0.0, [])


def test_pixels_below_the_floor_are_reported(jblast):
    for i, grey in enumerate(GREYS):
        frame = np.full(SHAPE, grey, np.uint8)
        frame[:, :3] = 0
        save(jblast.directory, i, frame)
    code, out, err = converted(jblast, "--json")
    answer = json.loads(out)
    assert (code, answer["bits"]) == (0, 8)
    assert answer["darkest"] == pytest.approx(0.5 / 255)
    assert answer["below_darkest"] == pytest.approx(1 / 3)
    assert "33 % of the pixel values are darker than 0.00196" in answer["warnings"][0]
    assert err == ""
    # a higher floor, by the user: 16 / 255 in one of six frames is below it
    _, out, _ = converted(jblast, "--json", "--darkest", "0.1", "--force")
    assert json.loads(out)["below_darkest"] == pytest.approx((2 + 4 / 6) / 6)
