import numpy as np
import pytest
from PIL import Image

from jblast.report.film_files import (
    sheet_frames,
    time_label,
    write_contact_sheet,
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


def test_it_begins_to_hurry_at_the_burst():
    shown = sheet_frames(np.arange(1000) / 1000, [0.5])
    assert shown[:4] == [0, 501, 502, 503]
    assert sheet_frames(np.arange(1000) / 1000, [7.0])[1:3] == [1, 2]


@pytest.mark.parametrize(
    ("time", "label"),
    [(0.0, "0"), (2e-5, "20 µs"), (1.5e-3, "1.5 ms"), (-0.02, "-20 ms"), (3.0, "3 s")],
)
def test_times_are_told_in_their_own_unit(time, label):
    assert time_label(time) == label


def test_frames_stand_in_rows_over_their_labels(tmp_path):
    grey = [np.full((60, 80, 3), light) for light in np.linspace(0.1, 1, 6)]
    path = tmp_path / "sheet.png"
    write_contact_sheet(path, grey, [f"{k} ms" for k in range(6)])
    sheet = np.asarray(Image.open(path))
    cell = 160 + 12, 120 + 12 + 22
    assert sheet.shape == (2 * cell[1] + 12, 4 * cell[0] + 12, 3)
    middles = [
        sheet[12 + 60 + k // 4 * cell[1], 12 + 80 + k % 4 * cell[0]] for k in range(8)
    ]
    # sRGB of 0.1 and 1 by hand, then white where there is no frame
    assert [int(m[0]) for m in middles][0::5] == [89, 255]
    assert (np.diff([int(m[0]) for m in middles[:6]]) > 0).all()
    assert (middles[6] == 255).all()
    below = sheet[12 + 120 : 12 + 120 + 20, 12 : 12 + 160]
    assert below.min() < 100  # letters
