import numpy as np
import pytest
from PIL import Image

from jblast.errors import InputError
from jblast.sensors.camera.files.images import read_depth
from jblast.sensors.camera.geometry import pixel_rays
from tests.sensors.camera.fireball_scenes import small_camera

CAMERA = small_camera((0.0, -60.0, 2.0), (0.0, 0.0, 2.0))


def saved(path, metres):
    if path.suffix == ".npy":
        np.save(path, metres)
    else:
        values = np.where(np.isfinite(metres), 1e3 * np.asarray(metres), 0.0)
        Image.fromarray(np.rint(values).astype(np.uint16)).save(path)
    return path


@pytest.mark.parametrize("name", ["wall.png", "wall.npy"])
def test_a_wall_across_the_axis_is_as_far_on_all_pixels_of_a_file(tmp_path, name):
    depth = read_depth(saved(tmp_path / name, np.full((18, 24), 21.5)), CAMERA)
    north = np.asarray(pixel_rays(CAMERA, ground=False).direction)[1]
    np.testing.assert_allclose(depth * north, 21.5, rtol=1e-12)


def test_zero_of_a_png_and_infinity_of_an_array_are_nothing_there(tmp_path):
    metres = np.full((18, 24), 5.0)
    metres[3, 4] = np.inf
    for name in ("a.png", "a.npy"):
        depth = read_depth(saved(tmp_path / name, metres), CAMERA)
        assert np.argwhere(np.isinf(depth)).tolist() == [[3, 4]]


BAD = {
    "another size": (np.ones((18, 23)), "expected 24 x 18 pixels .* got 23 x 18"),
    "negative": (np.full((18, 24), -1.0), "above 0 m, got -1 at row 0, column 0"),
    "nan": (np.full((18, 24), np.nan), "above 0 m, got nan at row 0, column 0"),
    "a cube": (np.ones((18, 24, 3)), r"rows and columns, .*\(18, 24, 3\)"),
    "whole numbers": (np.ones((18, 24), int), "expected floats, in metres, got int64"),
}


@pytest.mark.parametrize(("metres", "said"), BAD.values(), ids=BAD)
def test_an_array_that_is_none_is_refused_by_name(tmp_path, metres, said):
    with pytest.raises(InputError, match=f"depth.npy: expected {said}|{said}"):
        read_depth(saved(tmp_path / "depth.npy", metres), CAMERA)


def test_a_file_that_is_none_is_refused_by_name(tmp_path):
    for name in ("x.npy", "x.png"):
        (tmp_path / name).write_bytes(b"nothing")
    Image.fromarray(np.zeros((18, 24), np.uint8)).save(tmp_path / "grey.png")
    Image.fromarray(np.zeros((18, 24, 3), np.uint8)).save(tmp_path / "colours.png")
    np.save(tmp_path / "pickled.npy", np.array([{}]), allow_pickle=True)
    for name, said in {
        "no.npy": ".* but No such file",
        "x.npy": "expected .*not an array of numbers",
        "x.png": "expected .*PNG image",
        "grey.png": ".*millimetres.*got a PNG with 8 bits",
        "colours.png": ".*got a PNG with",
        "pickled.npy": "expected",
    }.items():
        with pytest.raises(InputError, match=f"{name}: {said}"):
            read_depth(tmp_path / name, CAMERA)
