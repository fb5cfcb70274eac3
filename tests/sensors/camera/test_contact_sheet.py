import numpy as np
import pytest

from jblast.sensors.camera.film_writer import (
    sheet_frames,
)


@pytest.mark.parametrize("frames", [1, 2, 5, 11, 12, 13, 30, 1000, 100_000])
def test_frames_are_shown_once_from_first_to_last_ever_farther_apart(frames):
    shown = sheet_frames(np.arange(frames) / 1000, [0.0])
    assert (shown[0], shown[-1]) == (0, frames - 1)
    assert len(shown) == min(frames, 12)
    steps = np.diff(shown)
    assert (steps > 0).all()
    # each as much longer than the last as rounding to whole frames allows
    assert (np.diff(steps) >= -1).all()
