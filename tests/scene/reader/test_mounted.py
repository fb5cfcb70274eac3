"""Sensors and a camera that ride along: where on the vehicle, and which cannot."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import quaternion_matrix
from jblast.scene.reader.scene import scene_from_document

VEHICLE = {"model": "iris", "position_m": [10.0, 0.0, 2.0]}


def read(vehicle: bool = True, **keys):
    document = {"sensor": [{"name": "a"} | keys]}
    document |= {"vehicle": VEHICLE} if vehicle else {}
    return scene_from_document(document, "s.toml").scene.sensors[0]


def test_a_mounted_sensor_has_an_offset_and_no_place():
    sensor = read(
        mount="vehicle", offset_m=[0.1, 0.2, 0.3], quaternion_xyzw=[0, 0, 1, 0]
    )
    assert sensor.mount == "vehicle"
    np.testing.assert_allclose(sensor.offset_m, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(sensor.quaternion, [0, 0, 1, 0])
    assert np.isnan(sensor.position_m).all()
    np.testing.assert_allclose(read(mount="vehicle").offset_m, 0)
    assert read(position_m=[0, 0, 0]).mount == ""


REFUSED = {
    "a place, too": (
        {"mount": "vehicle", "position_m": [0, 0, 1]},
        "'a' position_m: expected offset_m",
    ),
    "another": ({"mount": "tree"}, "'a' mount: expected one of vehicle, got 'tree'"),
    "no mount": ({"offset_m": [0, 0, 0]}, 'offset_m: expected mount = "vehicle"'),
    "a turn alone": ({"quaternion_xyzw": [0, 0, 0, 1]}, "quaternion_xyzw: .*no mount"),
    "no turn": (
        {"mount": "vehicle", "quaternion_xyzw": [0, 0, 0, 0]},
        "quaternion_xyzw: .*not zero",
    ),
    "two numbers": ({"mount": "vehicle", "offset_m": [0, 0]}, "offset_m: .*forward, l"),
    "a geophone": ({"mount": "vehicle", "kind": "geophone"}, "mount: .*on the ground"),
    "a difference": (
        {"mount": "vehicle", "records": {"arrival_difference_s": 1e-3}},
        "records arrival_difference_s: .*not supported yet",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_ride_along_is_refused(name):
    keys, message = REFUSED[name]
    with pytest.raises(InputError, match=message):
        read(**keys)


def test_a_mount_needs_a_vehicle():
    with pytest.raises(InputError, match=r"mount: expected a \[vehicle\]"):
        read(vehicle=False, mount="vehicle")


LENS = {"width": 24, "height": 18, "focal_px": 30}
CARRIER = {"model": "hummingbird", "position_m": [0, -20, 5]}


def read_camera(camera, **tables):
    document = {"camera": LENS | camera, "vehicle": CARRIER} | tables
    camera = scene_from_document(document, "s.toml").scene.camera
    assert camera is not None
    return camera


def test_a_camera_on_a_vehicle_looks_forward_from_its_middle():
    camera = read_camera({"mount": "vehicle"})
    assert camera.mount == "vehicle"
    np.testing.assert_array_equal(camera.position, 0.0)
    right, down, ahead = np.asarray(quaternion_matrix(camera.quaternion)).T
    np.testing.assert_allclose(right, [0, -1, 0], atol=1e-15)
    np.testing.assert_allclose(down, [0, 0, -1], atol=1e-15)
    np.testing.assert_allclose(ahead, [1, 0, 0], atol=1e-15)


def test_place_and_turn_of_a_camera_on_the_body_may_be_told():
    told = {"offset_m": [0.1, 0, -0.05], "quaternion_xyzw": [0, 0, 0, 2]}
    camera = read_camera({"mount": "vehicle"} | told)
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
def test_what_a_mounted_camera_cannot_be_is_refused_by_key(camera, said):
    with pytest.raises(InputError, match=rf"s\.toml: \[camera\] {said}"):
        read_camera(camera)


def test_without_a_vehicle_nothing_carries_a_camera():
    document = {"camera": LENS | {"mount": "vehicle"}}
    with pytest.raises(InputError, match=r"mount: expected a \[vehicle\]"):
        scene_from_document(document, "s.toml")
