"""A video comes back as light and times; what is none, or not whole, is refused."""

from fractions import Fraction

import numpy as np
import pytest
import soundfile

from jblast.errors import InputError
from jblast.sensors.camera.files.video import open_video
from tests.sensors.camera.files.video.made import flat, grey, make_video

BT709, BT601, SRGB = 1, 6, 13
WEIGHTS = {BT709: (0.2126, 0.0722), BT601: (0.299, 0.114)}
"""Of red and blue in luma."""


def read(path) -> np.ndarray:
    video = open_video(path)
    return np.stack([*video.frames()])


def planes(rgb: np.ndarray, matrix: int) -> np.ndarray:
    """Code values of red, green and blue, (3, height, width), as BT.709-6 item 3."""
    red, blue = WEIGHTS[matrix]
    y = red * rgb[0] + (1 - red - blue) * rgb[1] + blue * rgb[2]
    cb, cr = (rgb[2] - y) / (2 - 2 * blue), (rgb[0] - y) / (2 - 2 * red)
    coded = np.stack([16 + 219 * y, 128 + 224 * cb, 128 + 224 * cr])
    return np.rint(coded).astype(np.uint8)


def test_grey_of_the_studio_range_becomes_the_light_of_bt709(tmp_path):
    luma = np.broadcast_to(np.arange(16, 236), (16, 220))
    path = make_video(tmp_path / "a.mp4", [grey(luma)] * 2, color_trc=BT709)
    video = open_video(path)
    light = video.luminance(next(video.frames()))
    value = (luma - 16) / 219
    expected = np.where(value < 0.081, value / 4.5, ((value + 0.099) / 1.099) ** 2.2222)
    # red, green and blue are rounded to 8 bits: half a value, times a slope below 2.25
    np.testing.assert_allclose(light, expected, atol=0.5 * 2.25 / 255 + 1e-4)
    assert light[0, 0] == 0.0
    assert light[0, -1] == pytest.approx(1.0, abs=1e-6)


def test_a_file_names_its_curve_and_hdr_is_refused(tmp_path):
    half = flat(126, 126)  # 0.502 of the range
    path = make_video(tmp_path / "a.mp4", half, color_trc=SRGB)
    video = open_video(path)
    shown = video.luminance(next(video.frames()))
    assert shown[0, 0] == pytest.approx(((0.502 + 0.055) / 1.055) ** 2.4, abs=0.004)
    path = make_video(tmp_path / "b.mp4", half, color_trc=16)
    with pytest.raises(InputError, match=r"b\.mp4: expected a video of standard dyn"):
        open_video(path)


@pytest.mark.parametrize(
    ("named", "matrix", "rows"),
    [(1, BT709, 64), (6, BT601, 64), (2, BT601, 64), (2, BT709, 720)],
)
def test_colours_go_by_the_matrix_that_is_named_or_by_the_rows(
    tmp_path, named, matrix, rows
):
    rgb = np.random.default_rng(0).uniform(0, 1, (3, rows, 32))
    frame = planes(rgb, matrix)
    path = make_video(tmp_path / "a.mp4", [frame] * 2, colorspace=named)
    found = read(path)[0] / 255
    # chroma is rounded: half a value times 1.86 / 224, and red, green and blue again
    np.testing.assert_allclose(found, rgb.transpose(1, 2, 0), atol=2.6 / 255)


@pytest.mark.parametrize("kind", ["yuv420p", "yuv422p", "yuv420p10le", "yuv444p10le"])
def test_no_way_of_storing_pixels_makes_them_darker(tmp_path, kind):
    rng = np.random.default_rng(2)
    rgb = np.kron(rng.uniform(0, 1, (3, 2, 2)), np.ones((16, 16)))
    path = make_video(
        tmp_path / "a.mkv", [planes(rgb, BT709)] * 2, kind=kind, colorspace=1
    )
    found = read(path)[0]
    full = 255 if found.dtype == np.uint8 else 65535
    inside = np.zeros((32, 32), bool)
    inside[6:10, 6:10] = inside[22:26, 22:26] = True  # away from where chroma is shared
    error = (found / full - rgb.transpose(1, 2, 0))[inside]
    # as above; and without a bias of more than the rounding of four colours
    assert np.abs(error).max() < 2.6 / 255
    assert np.abs(error.mean()) < 0.6 / 255


@pytest.mark.parametrize("suffix", ["mp4", "mkv", "avi", "mov"])
def test_frames_and_times_come_back_in_order(tmp_path, suffix):
    lumas = [16 + 10 * k for k in range(20)]
    video = open_video(make_video(tmp_path / f"a.{suffix}", flat(*lumas)))
    assert (len(video), video.width, video.height) == (20, 32, 16)
    # Matroska counts milliseconds
    np.testing.assert_allclose(video.times, np.arange(20) / 30, atol=5.1e-4)
    seen = [frame[0, 0, 0] for frame in video.frames()]
    expected = np.rint((np.array(lumas) - 16) / 219 * 255)
    np.testing.assert_allclose(seen, expected, atol=1)


def test_reading_may_begin_at_any_frame(tmp_path):
    lumas = [16 + 7 * k for k in range(30)]
    path = make_video(tmp_path / "a.mp4", flat(*lumas), options={"g": "8", "bf": "2"})
    video = open_video(path)
    whole = [*video.frames()]
    for first in (0, 1, 7, 8, 9, 29):
        rest = [*video.frames(first)]
        assert len(rest) == 30 - first
        np.testing.assert_array_equal(rest, whole[first:])


@pytest.mark.parametrize(("turned", "quarters"), [(90, 1), (180, 2), (-90, 3)])
def test_a_video_is_turned_as_it_is_to_be_shown(tmp_path, turned, quarters):
    luma = np.arange(16, 16 + 16 * 8).reshape(8, 16)  # x264 takes even sizes
    path = make_video(tmp_path / "a.mp4", [grey(luma)] * 2, turned=turned)
    video = open_video(path)
    values = next(video.frames())[..., 0]
    upright = np.rint((luma - 16) / 219 * 255)
    np.testing.assert_allclose(values, np.rot90(upright, quarters), atol=1)
    assert values.shape == (video.height, video.width)


def test_variable_frame_rate_is_refused_unless_the_rate_is_said(tmp_path):
    path = make_video(tmp_path / "a.mp4", flat(20, 30, 40, 50), [0, 20, 60, 80])
    with pytest.raises(InputError, match=r"a\.mp4: .*constant.*1 and 2 66\.67 ms"):
        open_video(path)
    assert len(open_video(path, even=False)) == 4


@pytest.mark.parametrize("suffix", ["mp4", "mkv", "avi"])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_a_video_that_breaks_off_is_refused(tmp_path, suffix, share):
    noise = np.random.default_rng(0).integers(16, 235, (12, 3, 32, 32), np.uint8)
    path = make_video(tmp_path / f"a.{suffix}", list(noise), options={"bf": "0"})
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match=rf"a\.{suffix}: expected a complete video"):
        read(path)


def test_what_is_no_video_is_refused(tmp_path):
    soundfile.write(tmp_path / "a.wav", np.zeros(999), 8000)
    make_video(tmp_path / "one.mp4", flat(50))
    (tmp_path / "text.mp4").write_bytes(b"time_s,p_pa\n0,1\n" * 99)
    for name, said in (
        ("none.mp4", r"none\.mp4: .*no such file"),
        ("text.mp4", r"text\.mp4: .*a complete video, which cannot be read"),
        ("a.wav", r"a\.wav: .* a file without one"),
        ("one.mp4", r"one\.mp4: .*at least two frames, got 1"),
        (".", "is a directory; expected a video"),
    ):
        with pytest.raises(InputError, match=said):
            open_video(tmp_path / name)


def test_pixels_that_are_not_square_and_interlaced_rows_are_refused(tmp_path):
    path = make_video(tmp_path / "a.mp4", flat(50, 60), shape=Fraction(16, 15))
    with pytest.raises(InputError, match=r"a\.mp4: expected square.*16/15"):
        open_video(path)
    rows = {"x264-params": "tff=1"}
    path = make_video(tmp_path / "b.mp4", flat(50, 60, height=32), options=rows)
    with pytest.raises(
        InputError, match=r"b\.mp4: expected progressive frames, got inter"
    ):
        open_video(path)
