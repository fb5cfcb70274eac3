"""The reader of a scene's vehicle."""

from pathlib import Path
from typing import Any

import numpy as np

from jblast.errors import InputError, shown
from jblast.scene.reader.priors import LISTS, fixed_list, fixed_number
from jblast.scene.reader.schema import VEHICLE_MODELS
from jblast.scene.reader.tables import (
    choice,
    known_keys,
    name_of,
    table,
    true_or_false,
)
from jblast.scene.vehicle import VehicleSpec
from jblast.types import as_float_array

ALONG_AXES = ("kp_pos", "kd_pos", "ki_pos")
ALONE = ("kp_att", "kd_att", "integral_limit", "motor_lead")


def read_vehicle(document: dict[str, Any], source: str) -> VehicleSpec | None:
    """Read the vehicle of a scene file; None where it has none.

    Model and place have no default; but a mission begins at its plan's home. Its
    numbers are fixed: what is uncertain of where it stands to a blast is told of the
    charge.

    Raises:
        InputError: As in `read_scene`.
    """
    if "vehicle" not in document:
        return None
    entry = table(document, "vehicle", source)
    where = f"{source}: [vehicle]"
    for key, what in (
        ("model", f"one of {', '.join(VEHICLE_MODELS)}"),
        ("position_m", LISTS["position_m"]),
    ):
        if key not in entry and not (key == "position_m" and "mission" in entry):
            raise InputError(f"{where} {key}: expected {what}, got nothing")
    places = {
        name: fixed_list(entry[key], f"{where} {key}", LISTS[key])
        for name, key in (("position", "position_m"), ("velocity", "velocity_m_s"))
        if key in entry
    }
    control = _control(entry.get("control", {}), f"{where} control")
    if "mission" in entry:
        for key, given in (
            ("velocity_m_s", "velocity" in places),
            ("control target_m", "target" in control),
        ):
            if given:
                raise InputError(
                    f"{where} {key}: expected none beside a mission, which begins at "
                    "rest and says where to go, got one"
                )
        name = name_of(entry["mission"], f"{where} mission")
        control["mission"] = str(Path(source).parent / name)
        control["placed"] = "position" in places
        places.setdefault("position", np.zeros(3))
    return VehicleSpec(
        model=choice(entry["model"], VEHICLE_MODELS, f"{where} model"),
        **places,
        **control,
    )


def _control(entry: Any, where: str) -> dict[str, Any]:
    """Return what the table of the hold says."""
    if not isinstance(entry, dict):
        raise InputError(
            f"{where}: expected a table such as {{ integral = true }}, "
            f"got {shown(entry)}"
        )
    known_keys(entry, "control", where)
    said: dict[str, Any] = {"gains": _gains(entry, where)}
    if "integral" in entry:
        said["integral"] = true_or_false(entry["integral"], f"{where} integral")
    if "target_m" in entry:
        target = fixed_list(entry["target_m"], f"{where} target_m", LISTS["target_m"])
        said["target"] = as_float_array(target)
    if "yaw_rad" in entry:
        said["yaw"] = fixed_number(entry["yaw_rad"], f"{where} yaw_rad")
    return said


def _gains(entry: dict[str, Any], where: str) -> dict[str, Any]:
    """Return the gains, none of them negative."""
    gains: dict[str, Any] = {}
    for key in (*ALONG_AXES, *ALONE):
        if key not in entry:
            continue
        at = f"{where} {key}"
        along = key in ALONG_AXES
        numbers = np.asarray(
            fixed_list(entry[key], at, LISTS[key])
            if along
            else fixed_number(entry[key], at)
        )
        if (numbers < 0).any():
            expected = "numbers that are" if along else "a number that is"
            raise InputError(
                f"{at}: expected {expected} not negative, got {shown(entry[key])}"
            )
        if key == "motor_lead" and numbers < 1:
            raise InputError(
                f"{at}: expected a factor of 1 and more, got {shown(entry[key])}"
            )
        if key == "ki_pos" and not numbers.any():
            raise InputError(
                f"{at}: expected one above zero, got {shown(entry[key])}; without "
                "integral action is integral = false"
            )
        gains[key] = as_float_array(numbers)
    return gains
