import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import quaternion_matrix
from jblast.scene.reader.scene import scene_from_document

LENS = {"width": 24, "height": 18, "focal_px": 30}
VEHICLE = {"model": "hummingbird", "position_m": [0, -20, 5]}


def read(camera, **tables):
    document = {"camera": LENS | camera, "vehicle": VEHICLE} | tables
    camera = scene_from_document(document, "s.toml").scene.camera
    assert camera is not None
    return camera


def test_on_a_vehicle_it_looks_forward_from_its_middle():
    camera = read({"mount": "vehicle"})
    assert camera.mount == "vehicle"
    np.testing.assert_array_equal(camera.position, 0.0)
    right, down, ahead = np.asarray(quaternion_matrix(camera.quaternion)).T
    np.testing.assert_allclose(right, [0, -1, 0], atol=1e-15)
    np.testing.assert_allclose(down, [0, 0, -1], atol=1e-15)
    np.testing.assert_allclose(ahead, [1, 0, 0], atol=1e-15)


def test_its_place_and_turn_on_the_body_may_be_told():
    told = {"offset_m": [0.1, 0, -0.05], "quaternion_xyzw": [0, 0, 0, 2]}
    camera = read({"mount": "vehicle"} | told)
    np.testing.assert_allclose(camera.position, [0.1, 0, -0.05])
    np.testing.assert_allclose(camera.quaternion, [0, 0, 0, 1])


BAD = {
    "a place": (
        {"mount": "vehicle", "position_m": [0, 0, 1]},
        "position_m: .*offset_m",
    ),
    "a target": ({"mount": "vehicle", "look_at_m": [0, 0, 1]}, "look_at_m: .*forward"),
    "another": ({"mount": "tripod"}, "mount: expected one of vehicle, got 'tripod'"),
    "no mount": (
        {"offset_m": [0, 0, 1], "position_m": [0, 0, 1], "look_at_m": [0, 9, 1]},
        'offset_m: expected mount = "vehicle"',
    ),
    "two numbers": ({"mount": "vehicle", "offset_m": [0, 0]}, "offset_m: .*forward, l"),
}


@pytest.mark.parametrize(("camera", "said"), BAD.values(), ids=BAD)
def test_what_cannot_be_is_refused_by_key(camera, said):
    with pytest.raises(InputError, match=rf"s\.toml: \[camera\] {said}"):
        read(camera)


def test_without_a_vehicle_nothing_carries_it():
    document = {"camera": LENS | {"mount": "vehicle"}}
    with pytest.raises(InputError, match=r"mount: expected a \[vehicle\]"):
        scene_from_document(document, "s.toml")
