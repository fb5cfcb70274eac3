"""Sensors that ride along: where on the vehicle, and which cannot."""

import numpy as np
import pytest

from jblast.errors import InputError
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
