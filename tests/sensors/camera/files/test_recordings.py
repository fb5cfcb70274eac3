"""Folders of frames, videos and paths of cameras are read."""

from pathlib import Path

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.sensors.camera.files.images import write_png
from jblast.sensors.camera.files.recordings import open_recording, read_camera_path
from tests.sensors.camera.files.video.made import flat, make_video


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "frames").mkdir()
    for k in range(5):
        grey = np.full((4, 6, 1), 0.1 + 0.2 * k)
        write_png(tmp_path / "frames" / f"{k}.png", grey)
    return tmp_path / "frames"


def test_a_folder_gives_light_and_times(folder):
    film = open_recording(folder, 100.0, srgb=True)
    assert (film.width, film.height, len(film), film.frames_hz) == (6, 4, 5, 100.0)
    blocks = [*film.blocks(3)]
    assert [len(times) for times, _ in blocks] == [3, 2]
    np.testing.assert_allclose(np.concatenate([t for t, _ in blocks]), film.times)
    light = np.concatenate([frames for _, frames in blocks])[:, 0, 0]
    # written as sRGB of 8 bits: half a value times a slope of at most 2.28
    np.testing.assert_allclose(light, 0.1 + 0.2 * np.arange(5), atol=0.5 * 2.28 / 255)
    raw = next(film.blocks(decoded=False))[1]
    assert raw.dtype == np.uint8


def test_png_frames_are_linear_if_nothing_is_said_but_their_rate(folder):
    film = open_recording(folder, 100.0)
    light, raw = next(film.blocks())[1], next(film.blocks(decoded=False))[1]
    np.testing.assert_allclose(light, raw / 255, rtol=1e-6)
    with pytest.raises(InputError, match=r"frames: expected the rate of the PNG"):
        open_recording(folder)


def test_a_video_goes_by_its_clock_or_by_the_rate_that_is_said(tmp_path):
    path = make_video(tmp_path / "a.mp4", flat(16, 126, 235))
    film = open_recording(path)
    np.testing.assert_allclose(film.times, [0, 1 / 30, 2 / 30], rtol=1e-12)
    times, light = next(film.blocks())
    assert light.dtype == np.float32
    assert light.shape == (3, 16, 32)
    np.testing.assert_allclose(light[[0, 2], 0, 0], [0.0, 1.0], atol=1e-6)
    np.testing.assert_allclose(open_recording(path, 1000.0).times, [0, 1e-3, 2e-3])
    assert times is not film.times


@pytest.mark.parametrize("fps", [None, 30.0])
def test_a_varying_frame_rate_goes_by_the_time_stamps_of_the_file(fps):
    path = Path("tests/data/vfr.mp4")
    film = open_recording(path, fps, varying=True)
    assert film.varying
    # 30 frames a second, from 0.5 to 1.0 s 20
    assert film.times[[14, 24, 90]] == pytest.approx([0.464, 0.948, 3.151], abs=1e-3)
    with pytest.raises(InputError, match="expected a constant frame rate"):
        open_recording(path, fps)


@pytest.mark.parametrize(("kind", "bits"), [("yuv444p", 8), ("yuv444p10le", 10)])
def test_the_floor_of_a_video_is_half_a_step_of_its_depth(tmp_path, kind, bits):
    path = make_video(tmp_path / "a.mkv", flat(16, 126, 235), kind=kind)
    film = open_recording(path)
    assert film.bits == bits
    assert film.darkest == 0.5 / (2**bits - 1)


def test_arrays_are_frames_of_linear_light(tmp_path):
    light = np.linspace(0.0, 3.0, 24).reshape(4, 6)
    np.save(tmp_path / "0.npy", light)
    np.save(tmp_path / "1.npy", np.stack([light] * 3, axis=-1).astype(np.float32))
    film = open_recording(tmp_path, 100.0, srgb=True)
    assert film.bits is None
    frames = next(film.blocks())[1]
    np.testing.assert_allclose(frames, [light, light], rtol=1e-6)
    np.save(tmp_path / "1.npy", (255 * light).astype(int))
    with pytest.raises(
        InputError, match=r"1\.npy: expected floats of shape .* got int"
    ):
        list(film.blocks())


HEAD = "time_s,east_m,north_m,up_m,quaternion_i,quaternion_j,quaternion_k,quaternion_w"
ROWS = "0,1,2,3,0,0,0,1\n0.5,2,2,3,0,0,0,2\n"


def written(tmp_path, text):
    path = tmp_path / "flight.csv"
    path.write_text(text)
    return path


def test_columns_are_found_by_name_and_turns_have_length_one(tmp_path):
    text = f"# a flight\n{HEAD},velocity_east_m_s\n" + ROWS.replace("\n", ",9\n")
    path = read_camera_path(written(tmp_path, text))
    np.testing.assert_array_equal(path.time, [0.0, 0.5])
    np.testing.assert_array_equal(path.position, [[1, 2, 3], [2, 2, 3]])
    np.testing.assert_array_equal(path.quaternion, [[0, 0, 0, 1]] * 2)


BAD = {
    "no column": (HEAD.replace("up_m", "height_m") + "\n" + ROWS, "a column up_m"),
    "one row": (HEAD + "\n0,1,2,3,0,0,0,1\n", "two or more rows .* got 1"),
    "a word": (HEAD + "\n" + ROWS.replace("0.5,2", "0.5,x"), "line 3: .*finite"),
    "a short row": (HEAD + "\n" + ROWS + "0.7,1\n", "line 4: .*finite numbers"),
    "back in time": (
        HEAD + "\n" + ROWS.replace("0.5", "-1"),
        "line 3: .* -1 s after 0",
    ),
    "no turn": (HEAD + "\n" + ROWS.replace("0,0,0,2", "0,0,0,0"), "line 3: .*not zero"),
}


@pytest.mark.parametrize(("text", "said"), BAD.values(), ids=BAD)
def test_a_file_that_is_no_flight_is_refused_by_its_line(tmp_path, text, said):
    with pytest.raises(InputError, match=rf"flight\.csv: .*{said}"):
        read_camera_path(written(tmp_path, text))
