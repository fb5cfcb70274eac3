import itertools
import json

import h5py
import numpy as np
import pytest
from PIL import Image

from jblast.sensors.camera.files.event_files import read_events
from tests.cli.cli_files import Command

SHAPE = (6, 9)
GREYS = (32, 64, 64, 128, 32, 16)
"""Doublings and halvings: with a threshold of ln 2, whole numbers of events."""


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
