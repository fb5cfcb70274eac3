"""Events come back from a file as they were, and the file says how many went in."""

import h5py
import numpy as np
import pytest

from jblast.sensors.camera.events.ideal import Events
from jblast.sensors.camera.files.event_files import write_events

X, Y = [3, 0, 7, 7, 1], [2, 2, 0, 5, 4]
MICROSECONDS, BRIGHTER = [0, 40, 999, 2000, 2001], [1, 0, 1, 1, 1]


def block(part: slice) -> Events:
    """Some of the events, with an empty place behind them."""
    sign = 2 * np.array(BRIGHTER[part]) - 1
    return Events(
        np.append(X[part], -1),
        np.append(Y[part], -1),
        np.append(1e-6 * np.array(MICROSECONDS[part]), np.inf),
        np.append(sign, 0),
        np.array(len(sign)),
        np.zeros((), int),
    )


def read(path) -> dict[str, np.ndarray]:
    if path.suffix == ".npz":
        with np.load(path) as file:
            return {name: file[name] for name in "xytp"}
    with h5py.File(path) as file:
        return {name: np.asarray(file[f"events/{name}"]) for name in "xytp"}


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
def test_events_of_two_blocks_come_back_and_are_counted_by_sign(tmp_path, suffix):
    path = tmp_path / f"events{suffix}"
    written = write_events(path, [block(slice(0, 3)), block(slice(3, 5))], 8, 6)
    assert (written.events, written.brighter, written.darker) == (5, 4, 1)
    found = read(path)
    for name, expected in zip("xytp", (X, Y, MICROSECONDS, BRIGHTER), strict=True):
        assert found[name].tolist() == expected


def test_milliseconds_lead_to_their_first_event(tmp_path):
    path = tmp_path / "events.h5"
    write_events(path, [block(slice(0, 5))], 8, 6, duration_s=4e-3)
    with h5py.File(path) as file:
        # three within the first millisecond, two within the third, to the end of 4 ms
        assert np.asarray(file["ms_to_idx"]).tolist() == [0, 3, 3, 5, 5]
