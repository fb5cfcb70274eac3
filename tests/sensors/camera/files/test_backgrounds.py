"""Names of backgrounds."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Camera
from jblast.sensors.camera.files.backgrounds import background_named
from jblast.sensors.camera.files.images import write_png
from jblast.sensors.camera.files.recordings import MovingBackground
from tests.sensors.camera.files.video.made import flat, make_video

EYE = Camera(
    position=np.array([0.0, -40.0, 2.0]),
    quaternion=np.array([1.0, 0.0, 0.0, 0.0]),
    focal=np.full(2, 30.0),
    center=np.array([15.5, 11.5]),
    width=32,
    height=24,
)

TIMES = 5.0 + np.arange(4) * 1e-3


def test_it_may_be_light_an_image_or_an_image_a_frame(tmp_path):
    assert background_named("0.25", EYE, TIMES) == 0.25
    colour = background_named("0.1, 0.2,0.3", EYE, TIMES)
    np.testing.assert_array_equal(np.asarray(colour), [0.1, 0.2, 0.3])
    files = tuple(tmp_path / f"{k}.png" for k in range(5))
    for k, file in enumerate(files):
        write_png(file, np.full((24, 32, 3), 0.2 * k))
    image = background_named(str(files[3]), EYE, TIMES)
    # half a step of 8 bits is at most 0.0045 of light
    np.testing.assert_allclose(
        np.asarray(image), np.full((24, 32, 3), 0.6), atol=0.0045
    )
    pictures = background_named(str(tmp_path), EYE, TIMES)
    assert isinstance(pictures, MovingBackground)
    np.testing.assert_allclose(pictures.times, TIMES - 5.0)
    grey = pictures.at(np.array([0.0, 1e-3, 1.5e-3, 3e-3]))[:, 3, 4, 0]
    np.testing.assert_allclose(grey, [0.0, 0.2, 0.3, 0.6], atol=0.0045)


def test_a_video_runs_on_its_own_clock(tmp_path):
    frames = flat(16, 235, 16, height=24, width=32)  # 30 a second
    path = make_video(tmp_path / "a.mp4", frames)
    pictures = background_named(str(path), EYE, 5.0 + np.arange(80) * 1e-3)
    assert isinstance(pictures, MovingBackground)
    grey = pictures.at(np.array([0.0, 1 / 120, 1 / 30, 0.05, 0.08]))[:, 3, 4, 0]
    np.testing.assert_allclose(grey, [0.0, 0.25, 1.0, 0.5, 0.0], atol=1e-6)
    again = pictures.at(np.array([1 / 120, 0.0]))[:, 3, 4, 0]
    np.testing.assert_allclose(again, [0.25, 0.0], atol=1e-6)


def test_what_is_no_background_is_refused(tmp_path):
    video, short = tmp_path / "a.mp4", tmp_path / "b.mp4"
    make_video(video, flat(16, 90, height=24, width=30))
    make_video(short, flat(16, 90, height=24, width=32))
    folder = tmp_path / "frames"
    folder.mkdir()
    for k in range(2):
        write_png(folder / f"{k}.png", np.zeros((24, 31, 3)))
    for name, times, said in (
        (video, TIMES, r"a\.mp4: expected 32 x 24 .*got 30 x 24"),
        (short, np.array([0.0, 0.1]), r"b\.mp4: .*as the film, 0\.1 s.*0\.066"),
        (folder / "0.png", TIMES, r"0\.png: expected 32 x 24 .*got 31 x 24"),
        (folder, TIMES, r"expected at least 4 frames.*got 2"),
        *(
            (text, TIMES, "^background: expected")
            for text in ("1,2", "2", "nan", "sky")
        ),
    ):
        with pytest.raises(InputError, match=said):
            background_named(str(name), EYE, times)
