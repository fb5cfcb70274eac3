import tomllib

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Camera, look_at
from jblast.scene.reader.scene import read_camera

PLACED = {
    "position_m": "[0, -50, 2]",
    "look_at_m": "[0, 0, 5]",
    "width": "346",
    "height": "260",
    "focal_px": "300",
}


@pytest.fixture
def camera():
    def read(**changed):
        entries = {**PLACED, **changed}
        lines = [f"{key} = {value}" for key, value in entries.items() if value]
        document = tomllib.loads("\n".join(["[camera]", *lines, ""]))
        camera = read_camera(document, "scene.toml")
        assert camera is not None
        return camera

    return read


def test_what_is_not_said_takes_its_default(camera):
    read = camera()
    assert read.position.tolist() == [0, -50, 2]
    expected = look_at(np.array([0.0, -50, 2]), np.array([0.0, 0, 5]))
    assert read.quaternion.tolist() == expected.tolist()
    assert (read.width, read.height) == (346, 260)
    assert read.focal.tolist() == [300, 300]
    assert read.center.tolist() == [172.5, 129.5]  # the first pixel's centre is 0
    assert read.distortion.tolist() == [0] * 5
    assert (read.frames_hz, read.exposure_s) == (1000, 0)
    assert read.threshold.tolist() == [0.2, 0.2]


def test_every_key_arrives_where_it_belongs(camera):
    read = camera(
        look_at_m=None,
        quaternion_xyzw="[-2, 0, 0, 2]",
        focal_px="[300, 310.5]",
        center_px="[170, 131.25]",
        distortion="[-0.3, 0.1, 1e-3, -2e-3, 0.01]",
        frames_hz="500",
        exposure_s="2e-3",
        threshold="[0.2, 0.3]",
    )
    assert read.quaternion.tolist() == pytest.approx([-(0.5**0.5), 0, 0, 0.5**0.5])
    assert read.focal.tolist() == [300, 310.5]
    assert read.center.tolist() == [170, 131.25]
    assert read.distortion.tolist() == [-0.3, 0.1, 1e-3, -2e-3, 0.01]
    assert (read.frames_hz, read.exposure_s) == (500, 2e-3)
    assert read.threshold.tolist() == [0.2, 0.3]


def test_a_long_quaternion_becomes_a_unit_one(camera):
    read = camera(look_at_m=None, quaternion_xyzw="[1e200, 0, 0, 0]")
    assert read.quaternion.tolist() == [1, 0, 0, 0]


BAD = {
    "no focal length": ({"focal_px": None}, ["focal_px: expected a number or [x, y]"]),
    "zero focal length": ({"focal_px": "0"}, ["focal_px", "positive", "got 0"]),
    "one zero of two": ({"focal_px": "[1, 0]"}, ["focal_px[1]", "positive", "got 0"]),
    "free focal length": ({"focal_px": "['free', 1]"}, ["not supported yet"]),
    "a negative threshold": ({"threshold": "-0.2"}, ["threshold", "got -0.2"]),
    "unknown key": ({"focal_mm": "8"}, ["focal_mm: unknown key; did", "focal_px"]),
    "no place": ({"position_m": None}, ["position_m", "[east, north, up]", "nothing"]),
    "two coordinates": ({"position_m": "[0, 1]"}, ["position_m", "got [0, 1]"]),
    "free place": ({"position_m": "[0, 'free', 0]"}, ["not supported yet"]),
    "looking at itself": (
        {"look_at_m": "[0, -50, 2]"},
        ["look_at_m: expected a position other than position_m"],
    ),
    "looking nowhere": ({"look_at_m": None}, ["either look_at_m or", "got neither"]),
    "both": ({"quaternion_xyzw": "[1, 0, 0, 0]"}, ["either look_at_m or", "got both"]),
    "zero quaternion": (
        {"look_at_m": None, "quaternion_xyzw": "[0, 0, 0, 0]"},
        ["quaternion_xyzw: expected [x, y, z, w] that is not zero"],
    ),
    "short quaternion": (
        {"look_at_m": None, "quaternion_xyzw": "[1, 0, 0]"},
        ["quaternion_xyzw: expected [x, y, z, w], got [1, 0, 0]"],
    ),
    "no width": ({"width": None}, ["width", "a whole number", "got nothing"]),
    "half a pixel": ({"width": "346.5"}, ["width", "a whole number", "346.5"]),
    "no height": ({"height": "0"}, ["height", "1 to 65535", "got 0"]),
    "four of distortion": (
        {"distortion": "[0, 0, 0, 0]"},
        ["distortion: expected [k1, k2, p1, p2, k3]"],
    ),
    "no frames": ({"frames_hz": "0"}, ["frames_hz", "positive", "got 0"]),
    "long exposure": (
        {"frames_hz": "500", "exposure_s": "0.003"},
        ["exposure_s: expected between 0 and 0.002", "got 0.003"],
    ),
    "negative exposure": ({"exposure_s": "-1e-3"}, ["exposure_s", "got -0.001"]),
}


@pytest.mark.parametrize(("changed", "said"), BAD.values(), ids=BAD.keys())
def test_bad_input_is_told_by_file_key_expectation_and_find(camera, changed, said):
    with pytest.raises(InputError) as caught:
        camera(**changed)
    message = str(caught.value)
    assert "scene.toml: [camera] " in message
    for words in said:
        assert words in message, message


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"focal": [300.0, 0.0]}, r"camera focal: expected positive.*\[300.0, 0.0\]"),
        ({"focal": [np.nan, 1.0]}, "camera focal: expected finite"),
        ({"threshold": [0.2, -0.2]}, "camera threshold: expected positive"),
        ({"quaternion": [0.0, 0.0, 0.0, 0.0]}, "camera quaternion: .* not zero"),
        ({"exposure_s": -1.0}, "camera exposure_s: expected zero or more, got -1.0"),
        ({"height": 0}, "camera height: expected at least 1 px, got 0"),
    ],
)
def test_a_camera_made_in_python_is_checked_too(changed, said):
    good = {
        "position": np.zeros(3),
        "quaternion": [0.0, 0.0, 0.0, 1.0],
        "focal": [300.0, 300.0],
        "center": [172.5, 129.5],
        "width": 346,
        "height": 260,
    }
    arrays = {k: np.array(v) if isinstance(v, list) else v for k, v in changed.items()}
    for name in ("quaternion", "focal", "center"):
        good[name] = np.array(good[name])
    with pytest.raises(InputError, match=said):
        Camera(**{**good, **arrays})
