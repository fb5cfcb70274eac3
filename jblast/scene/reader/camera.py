"""The reader of a scene's camera."""

from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, shown
from jblast.scene.camera import FORWARD, FRAMES_HZ, MOUNTS, Camera
from jblast.scene.pose import look_at
from jblast.scene.reader.priors import LISTS, finite, fixed_list
from jblast.scene.reader.tables import choice, table

LARGEST_IMAGE = 65_535
"""Pixels along a side: files of events keep x and y in 16 bits."""


def read_camera(document: dict[str, Any], source: str) -> Camera | None:
    """Read the camera of a scene file; None where it has none.

    Place, direction, size and focal length have no default; on a vehicle the place is
    its own and the direction forward. The principal point is the middle of the image if
    nothing else is said.

    Raises:
        InputError: As in `read_scene`.
    """
    if "camera" not in document:
        return None
    where = f"{source}: [camera]"
    _refuse_old_order(document["camera"], where)
    entry = table(document, "camera", source)
    mount = _mount(entry, document, where)
    place = "offset_m" if mount else "position_m"
    position = (
        np.zeros(3) if mount and place not in entry else _list(entry, place, where)
    )
    width, height = (_pixels(entry, key, where) for key in ("width", "height"))
    optional: dict[str, Any] = {}
    if "distortion" in entry:
        optional["distortion"] = _list(entry, "distortion", where)
    if "frames_hz" in entry:
        optional["frames_hz"] = _positive(entry["frames_hz"], f"{where} frames_hz")
    if "exposure_s" in entry:
        interval = 1 / optional.get("frames_hz", FRAMES_HZ)
        optional["exposure_s"] = _exposure(entry["exposure_s"], interval, where)
    if (key := "daylight_lux") in entry:
        optional["daylight"] = _positive(entry[key], f"{where} {key}")
    if "threshold" in entry:
        optional["threshold"] = _pair(entry, "threshold", where)
    return Camera(
        position=position,
        quaternion=np.array(FORWARD)
        if mount and "quaternion_xyzw" not in entry
        else _quaternion(entry, position, where),
        focal=_pair(entry, "focal_px", where),
        center=_list(entry, "center_px", where)
        if "center_px" in entry
        else np.array([(width - 1) / 2, (height - 1) / 2]),
        width=width,
        height=height,
        mount=mount,
        **optional,
    )


def _mount(entry: dict[str, Any], document: dict[str, Any], where: str) -> str:
    """Return what carries the camera; "" where nothing does."""
    if "mount" not in entry:
        if "offset_m" in entry:
            raise InputError(
                f'{where} offset_m: expected mount = "vehicle" with it, or position_m '
                "in its place, got no mount"
            )
        return ""
    mount = choice(entry["mount"], MOUNTS, f"{where} mount")
    for key, instead in (
        ("position_m", "offset_m, in the axes of the vehicle's body"),
        ("look_at_m", "quaternion_xyzw, camera to body, or neither to look forward"),
    ):
        if key in entry:
            raise InputError(
                f"{where} {key}: expected {instead}, for a camera on a vehicle, got "
                f"{shown(entry[key])}"
            )
    if "vehicle" not in document:
        raise InputError(
            f'{where} mount: expected a [vehicle] that carries it, got "{mount}" and '
            "no such table"
        )
    return mount


def _quaternion(entry: dict[str, Any], position: Float[np.ndarray, "3"], where: str):
    """Return camera to world as a unit quaternion, from whichever is given."""
    given = [key for key in ("look_at_m", "quaternion_xyzw") if key in entry]
    if len(given) != 1:
        raise InputError(
            f"{where} look_at_m: expected either look_at_m or quaternion_xyzw, "
            f"got {'both' if given else 'neither'}"
        )
    numbers = _list(entry, given[0], where)
    if given == ["look_at_m"]:
        if np.array_equal(numbers, position):
            raise InputError(
                f"{where} look_at_m: expected a place other than position_m, "
                f"got {shown(entry['look_at_m'])}"
            )
        return look_at(position, numbers)
    if not numbers.any():
        raise InputError(
            f"{where} quaternion_xyzw: expected {LISTS['quaternion_xyzw']} that is not "
            f"zero, got {shown(entry['quaternion_xyzw'])}"
        )
    scaled = (
        numbers / np.abs(numbers).max()
    )  # whose squares neither over- nor underflow
    return scaled / np.linalg.norm(scaled)


def _refuse_old_order(entry: Any, where: str) -> None:
    """Refuse the key that had the scalar first, with what to write in its place."""
    if not isinstance(entry, dict) or "quaternion" not in entry:
        return
    old, new = entry["quaternion"], LISTS["quaternion_xyzw"]
    if isinstance(old, list) and len(old) == 4:
        new = str([*old[1:], old[0]])
    raise InputError(
        f"{where} quaternion: expected quaternion_xyzw, scalar last, in its place, got "
        f"{shown(old)}, which was read scalar first: write quaternion_xyzw = {new}"
    )


def _list(entry: dict[str, Any], key: str, where: str) -> Float[np.ndarray, " number"]:
    if key not in entry:
        raise InputError(f"{where} {key}: expected {LISTS[key]}, got nothing")
    return fixed_list(entry[key], f"{where} {key}", LISTS[key])


def _pair(entry: dict[str, Any], key: str, where: str) -> Float[np.ndarray, "2"]:
    """Return two positive numbers; one stands for both."""
    value, where = entry.get(key), f"{where} {key}"
    if value is None:
        raise InputError(f"{where}: expected a number or {LISTS[key]}, got nothing")
    if not isinstance(value, list):
        return np.full(2, _positive(value, where))
    pair = fixed_list(value, where, LISTS[key])
    for index, number in enumerate(pair.tolist()):
        _positive(number, f"{where}[{index}]")
    return pair


def _positive(value: Any, where: str) -> float:
    number = finite(value, where, "a positive number")
    if number <= 0:
        raise InputError(f"{where}: expected a positive number, got {shown(value)}")
    return number


def _exposure(value: Any, interval: float, where: str) -> float:
    """Return the exposure: no frame begins before the last has ended."""
    exposure = finite(value, f"{where} exposure_s")
    if not 0 <= exposure <= interval:
        raise InputError(
            f"{where} exposure_s: expected between 0 and {interval:g}, the time from "
            f"frame to frame, got {shown(value)}"
        )
    return exposure


def _pixels(entry: dict[str, Any], key: str, where: str) -> int:
    value = entry.get(key)
    if type(value) is not int or not 1 <= value <= LARGEST_IMAGE:  # True is an int too
        raise InputError(
            f"{where} {key}: expected a whole number of pixels, 1 to {LARGEST_IMAGE}, "
            f"got {shown(value) if key in entry else 'nothing'}"
        )
    return value
