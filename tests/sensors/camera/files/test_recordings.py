"""Folders of frames, videos, backgrounds and paths of cameras are read."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import soundfile

from jblast.errors import InputError
from jblast.scene import Camera
from jblast.sensors.camera.files.backgrounds import background_named, read_camera_path
from jblast.sensors.camera.files.images import write_png
from jblast.sensors.camera.files.recordings import ImageSequence, open_recording
from jblast.sensors.camera.files.video import open_video
from tests.sensors.camera.files.made_video import flat, grey, make_video

BT709, BT601, SRGB = 1, 6, 13
WEIGHTS = {BT709: (0.2126, 0.0722), BT601: (0.299, 0.114)}
"""Weights of red and blue in luma."""
EYE = Camera(
    position=np.array([0.0, -40.0, 2.0]),
    quaternion=np.array([1.0, 0.0, 0.0, 0.0]),
    focal=np.full(2, 30.0),
    center=np.array([15.5, 11.5]),
    width=32,
    height=24,
)
TIMES = 5.0 + np.arange(4) * 1e-3


def first(path) -> tuple:
    """Return the video and its first frame."""
    video = open_video(path)
    return video, next(video.frames())


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
    video, frame = first(path)
    light, value = video.luminance(frame), (luma - 16) / 219
    expected = np.where(value < 0.081, value / 4.5, ((value + 0.099) / 1.099) ** 2.2222)
    # red, green and blue are rounded to 8 bits: half a value, times a slope below 2.25
    np.testing.assert_allclose(light, expected, atol=0.5 * 2.25 / 255 + 1e-4)
    assert light[0, 0] == 0.0
    assert light[0, -1] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(
    ("named", "matrix", "rows"),
    [(1, BT709, 64), (6, BT601, 64), (2, BT601, 64), (2, BT709, 720)],
)
def test_colours_use_the_stated_matrix_or_that_of_the_rows(
    tmp_path, named, matrix, rows
):
    rgb = np.random.default_rng(0).uniform(0, 1, (3, rows, 32))
    frames = [planes(rgb, matrix)] * 2
    _, found = first(make_video(tmp_path / "a.mp4", frames, colorspace=named))
    # chroma is rounded: half a value times 1.86 / 224, and red, green and blue again
    np.testing.assert_allclose(found / 255, rgb.transpose(1, 2, 0), atol=2.6 / 255)


@pytest.mark.parametrize("kind", ["yuv420p", "yuv422p", "yuv420p10le", "yuv444p10le"])
def test_no_pixel_format_makes_colours_darker(tmp_path, kind):
    rng = np.random.default_rng(2)
    rgb = np.kron(rng.uniform(0, 1, (3, 2, 2)), np.ones((16, 16)))
    frames = [planes(rgb, BT709)] * 2
    _, found = first(make_video(tmp_path / "a.mkv", frames, kind=kind, colorspace=1))
    full = 255 if found.dtype == np.uint8 else 65535
    inside = np.zeros((32, 32), bool)
    inside[6:10, 6:10] = inside[22:26, 22:26] = True  # away from where chroma is shared
    error = (found / full - rgb.transpose(1, 2, 0))[inside]
    # as above; and without a bias of more than the rounding of four colours
    assert np.abs(error).max() < 2.6 / 255
    assert np.abs(error.mean()) < 0.6 / 255


@pytest.mark.parametrize(("turned", "quarters"), [(90, 1), (180, 2), (-90, 3)])
def test_a_stated_rotation_is_applied(tmp_path, turned, quarters):
    luma = np.arange(16, 16 + 16 * 8).reshape(8, 16)  # x264 takes even sizes
    path = make_video(tmp_path / "a.mp4", [grey(luma)] * 2, turned=turned)
    video, values = first(path)
    upright = np.rint((luma - 16) / 219 * 255)
    np.testing.assert_allclose(values[..., 0], np.rot90(upright, quarters), atol=1)
    assert values.shape[:2] == (video.height, video.width)


@pytest.mark.parametrize("suffix", ["mp4", "mkv", "avi", "mov"])
def test_frames_and_times_come_back_in_any_order(tmp_path, monkeypatch, suffix):
    lumas = np.array([16 + 7 * k for k in range(30)])
    options = {} if suffix == "avi" else {"g": "8", "bf": "2"}
    path = make_video(tmp_path / f"a.{suffix}", flat(*lumas), options=options)
    film = open_recording(path)
    assert (len(film), film.width, film.height) == (30, 32, 16)
    # Matroska counts milliseconds
    np.testing.assert_allclose(film.times, np.arange(30) / 30, atol=5.1e-4)
    seen = np.concatenate([light for _, light in film.blocks(7)])
    assert (seen.shape, seen.dtype) == ((30, 16, 32), np.float32)
    value = (lumas - 16) / 219
    expected = np.where(value < 0.081, value / 4.5, ((value + 0.099) / 1.099) ** 2.2222)
    np.testing.assert_allclose(seen[:, 0, 0], expected, atol=0.5 * 2.25 / 255 + 1e-4)
    monkeypatch.setattr("jblast.sensors.camera.files.recordings.CACHE_BYTES", 0)
    for number in (5, 3, 4, 29, 0, 1, 8):
        np.testing.assert_array_equal(film.picture(number), seen[number])


@pytest.mark.parametrize("suffix", ["mp4", "mkv", "avi"])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_a_video_that_breaks_off_is_refused(tmp_path, suffix, share):
    noise = np.random.default_rng(0).integers(16, 235, (12, 3, 32, 32), np.uint8)
    path = make_video(tmp_path / f"a.{suffix}", list(noise), options={"bf": "0"})
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match=rf"a\.{suffix}: expected a complete video"):
        open_recording(path)


@pytest.mark.parametrize("fps", [None, 30.0])
def test_a_varying_frame_rate_is_that_of_the_time_stamps(fps):
    path = Path("tests/data/vfr.mp4")
    film = open_recording(path, fps, varying=True)
    assert film.varying
    # 30 frames a second, from 0.5 to 1.0 s 20
    assert film.times[[14, 24, 90]] == pytest.approx([0.464, 0.948, 3.151], abs=1e-3)
    with pytest.raises(InputError, match="expected a constant frame rate"):
        open_recording(path, fps)


def folder(path, count=5, size=(24, 32), channels=1):
    path.mkdir(exist_ok=True)
    for k in range(count):
        write_png(path / f"{k}.png", np.full((*size, channels), 0.1 + 0.2 * k))
    return path


def test_a_folder_has_light_and_times(tmp_path):
    folder(tmp_path)
    film = open_recording(tmp_path, 100.0, srgb=True)
    assert (film.width, film.height, len(film), film.frames_hz) == (32, 24, 5, 100.0)
    blocks = [*film.blocks(3)]
    assert [len(times) for times, _ in blocks] == [3, 2]
    np.testing.assert_allclose(np.concatenate([t for t, _ in blocks]), film.times)
    light = np.concatenate([frames for _, frames in blocks])[:, 0, 0]
    # written as sRGB of 8 bits: half a value times a slope of at most 2.28
    np.testing.assert_allclose(light, 0.1 + 0.2 * np.arange(5), atol=0.5 * 2.28 / 255)
    linear = open_recording(tmp_path, 100.0)
    raw = next(linear.blocks(decoded=False))[1]
    assert raw.dtype == np.uint8
    np.testing.assert_allclose(next(linear.blocks())[1], raw / 255, rtol=1e-6)


@pytest.mark.parametrize(
    ("size", "channels", "message"),
    [
        ((24, 31), 1, "32 x 24 pixels, 8 bits, grey as in 0.png, got 31 x 24 pixels"),
        ((24, 32), 3, "32 x 24 .* grey as in 0.png, got 32 x 24 pixels, 8 bits, light"),
    ],
)
def test_mixed_frames_of_a_folder_are_named(tmp_path, size, channels, message):
    folder(tmp_path)
    write_png(tmp_path / "3.png", np.zeros((*size, channels)))
    with pytest.raises(InputError, match=rf"3\.png: expected {message}"):
        list(open_recording(tmp_path, 100.0).blocks())


def one_frame(path):
    make_video(path / "a.mp4", flat(50))


def wide_pixels(path):
    make_video(path / "a.mp4", flat(50, 60), shape=Fraction(16, 15))


def interlaced(path):
    rows = {"x264-params": "tff=1"}
    make_video(path / "a.mp4", flat(50, 60, height=32), options=rows)


def uneven(path):
    make_video(path / "a.mp4", flat(20, 30, 40, 50), [0, 20, 60, 80])


NO_VIDEO = [
    ("a.mp4", lambda path: None, "expected a directory of .*, got no such file"),
    ("a.mp4", lambda path: (path / "a.mp4").write_bytes(b"0,1\n" * 99), "a complete"),
    ("a.wav", lambda path: soundfile.write(path / "a.wav", np.zeros(99), 8000), "a fi"),
    ("a.mp4", one_frame, "a video of at least two frames, got 1"),
    ("a.mp4", wide_pixels, "expected square.*16/15"),
    ("a.mp4", interlaced, "expected progressive frames"),
    ("a.mp4", uneven, "constant.*, got frames 1 and 2 66.67 ms apart, usually 33.33"),
    (
        "a.mp4",
        lambda path: make_video(path / "a.mp4", flat(126, 126), color_trc=16),
        "expected standard dynamic range.* got transfer curve 16",
    ),
    (".", lambda path: folder(path), "expected the rate of the PNG"),
]


@pytest.mark.parametrize(("name", "made", "message"), NO_VIDEO)
def test_other_recordings_are_refused(tmp_path, name, made, message):
    made(tmp_path)
    with pytest.raises(InputError, match=message):
        open_recording(tmp_path / name)


def test_a_background_is_light_an_image_or_an_image_a_frame(tmp_path):
    assert background_named("0.25", EYE, TIMES) == 0.25
    colour = background_named("0.1, 0.2,0.3", EYE, TIMES)
    np.testing.assert_array_equal(np.asarray(colour), [0.1, 0.2, 0.3])
    folder(tmp_path, channels=3)
    image = background_named(str(tmp_path / "3.png"), EYE, TIMES)
    # half a step of 8 bits is at most 0.0045 of light
    np.testing.assert_allclose(
        np.asarray(image), np.full((24, 32, 3), 0.7), atol=0.0045
    )
    pictures = background_named(str(tmp_path), EYE, TIMES)
    assert isinstance(pictures, ImageSequence)
    np.testing.assert_allclose(pictures.times, TIMES - 5.0)
    light = pictures.at(np.array([0.0, 1e-3, 1.5e-3, 3e-3]))[:, 3, 4, 0]
    np.testing.assert_allclose(light, [0.1, 0.3, 0.4, 0.7], atol=0.0045)


def test_other_backgrounds_are_refused(tmp_path):
    make_video(tmp_path / "a.mp4", flat(16, 90, height=24, width=30))
    make_video(tmp_path / "b.mp4", flat(16, 90, height=24, width=32))
    folder(tmp_path / "frames", 2, (24, 31), 3)
    for name, times, message in (
        ("a.mp4", TIMES, r"a\.mp4: expected 32 x 24 .*got 30 x 24"),
        ("b.mp4", np.array([0.0, 0.1]), r"b\.mp4: .*as the film, 0\.1 s.*0\.066"),
        ("frames/0.png", TIMES, r"0\.png: expected 32 x 24 .*got 31 x 24"),
        ("frames", TIMES, r"expected at least 4 frames.*got 2"),
    ):
        with pytest.raises(InputError, match=message):
            background_named(str(tmp_path / name), EYE, times)
    for text in ("1,2", "2", "nan", "sky"):
        with pytest.raises(InputError, match=f"^background: expected .*got {text}"):
            background_named(text, EYE, TIMES)


HEAD = "time_s,east_m,north_m,up_m,quaternion_i,quaternion_j,quaternion_k,quaternion_w"
ROWS = "0,1,2,3,0,0,0,1\n0.5,2,2,3,0,0,0,2\n"


def test_columns_of_a_flight_are_found_by_name(tmp_path):
    text = f"# a flight\n{HEAD}, velocity_east_m_s\n" + ROWS.replace("\n", ",9\n")
    (tmp_path / "flight.csv").write_text(text)
    path = read_camera_path(tmp_path / "flight.csv")
    np.testing.assert_array_equal(path.time, [0.0, 0.5])
    np.testing.assert_array_equal(path.position, [[1, 2, 3], [2, 2, 3]])
    np.testing.assert_array_equal(path.quaternion, [[0, 0, 0, 1]] * 2)


@pytest.mark.parametrize(
    ("head", "rows", "message"),
    [
        (HEAD.replace("up_m", "height_m"), ROWS, "columns .* up_m.* got 'time_s, "),
        (HEAD, "0,1,2,3,0,0,0,1\n", "two or more rows .* got 1"),
        (HEAD, ROWS.replace("0.5,2", "0.5,x"), "line 3: .*finite"),
        (HEAD, ROWS + "0.7,1\n", "line 4: .*finite numbers.* got '0.7,1'"),
        (HEAD, ROWS.replace("0.5", "-1"), "line 3: .* got -1 s after 0"),
        (HEAD, ROWS.replace("0,0,0,2", "0,0,0,0"), "line 3: .*not zero"),
    ],
)
def test_other_flights_are_refused_by_line(tmp_path, head, rows, message):
    path = tmp_path / "flight.csv"
    path.write_text(f"{head}\n{rows}")
    with pytest.raises(InputError, match=rf"flight\.csv: .*{message}"):
        read_camera_path(path)
