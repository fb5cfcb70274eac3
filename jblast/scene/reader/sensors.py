"""The reader of a scene's sensors."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from jblast.errors import InputError, shown
from jblast.parameter_table import CLOCK, CLOCK_OFFSET
from jblast.quantities import BY_CAMERA, TIMED, components
from jblast.scene.camera import MOUNTS
from jblast.scene.reader.instrument import read_imu, read_instrument
from jblast.scene.reader.priors import LISTS, Uncertain, finite, fixed_list, read_number
from jblast.scene.reader.records import read_records
from jblast.scene.reader.schema import SENSOR_KINDS
from jblast.scene.reader.tables import choice, name_of, not_yet, tables
from jblast.scene.sensor import Sensor

QUATERNION = "quaternion_xyzw"


def read_sensors(
    document: dict[str, Any], source: str
) -> tuple[tuple[Sensor, ...], dict[str, Uncertain]]:
    """Read the sensors of a scene file, and the offsets of their clocks.

    Raises:
        InputError: As in `read_scene`.
    """
    sensors: dict[str, Sensor] = {}
    offsets: dict[str, Uncertain] = {}
    for index, entry in enumerate(tables(document, "sensor", source), start=1):
        where = f"{source}: [[sensor]] name"
        if "name" not in entry:
            raise InputError(
                f"{where}: expected a name for sensor {index}, got nothing"
            )
        name = name_of(entry["name"], where)
        if name in sensors:
            raise InputError(
                f"{where}: expected each name once, got {shown(name)} twice"
            )
        where = f"{source}: [[sensor]] {shown(name)}"
        sensors[name] = _sensor(name, entry, document, where)
        if (key := CLOCK.key.name) in entry:
            offset = read_number(entry[key], CLOCK, f"{where} {key}")
            offsets[f"{CLOCK_OFFSET}.{name}"] = offset
    return tuple(sensors.values()), offsets


def _sensor(
    name: str, entry: dict[str, Any], document: dict[str, Any], where: str
) -> Sensor:
    """Read one sensor; a position that is not there is NaN until a log gives it."""
    kind = ""
    if "kind" in entry:
        kind = choice(entry["kind"], SENSOR_KINDS, f"{where} kind")
    records = read_records(entry.get("records", {}), f"{where} records")
    times = _times(entry["times_s"], f"{where} times_s") if "times_s" in entry else ()
    if times and not any(quantity in TIMED for quantity, _ in records):
        raise InputError(
            f"{where} times_s: expected one of {', '.join(TIMED)} in records, which "
            "alone are taken at a time; got none"
        )
    mount = _mount(entry, document, where)
    carried = {}
    if mount:
        _refuse_unmountable(kind, records, where)
        carried = {"offset_m": np.zeros(3)} | {
            name: fixed_list(entry[key], f"{where} {key}", LISTS[key])
            for name, key in (("offset_m", "offset_m"), ("quaternion", QUATERNION))
            if key in entry
        }
        if not carried.get("quaternion", np.ones(4)).any():
            raise InputError(
                f"{where} {QUATERNION}: expected {LISTS[QUATERNION]} that is not zero, "
                f"got {shown(entry[QUATERNION])}"
            )
    position = _position(entry, f"{where} position_m")
    return Sensor(
        name=name,
        position_m=position,
        kind=kind,
        records=records,
        times_s=times,
        instrument=read_instrument(entry, kind, position, where),
        imu=read_imu(entry, kind, mount, where),
        mount=mount,
        **carried,
    )


def _position(entry: dict[str, Any], where: str) -> np.ndarray:
    if "position_m" not in entry:
        return np.full(3, np.nan)
    return fixed_list(entry["position_m"], where, LISTS["position_m"])


def _times(value: Any, where: str) -> tuple[float, ...]:
    expected = "a list of increasing times in seconds"
    if not isinstance(value, list) or not value:
        raise InputError(f"{where}: expected {expected}, got {shown(value)}")
    times = [finite(time, f"{where}[{i}]") for i, time in enumerate(value)]
    if any(late <= early for early, late in pairwise(times)):
        raise InputError(f"{where}: expected {expected}, got {shown(value)}")
    return tuple(times)


def _mount(entry: dict[str, Any], document: dict[str, Any], where: str) -> str:
    """Return what carries a sensor; "" where nothing does.

    Args:
        entry: Its keys and values.
        document: The whole file.
        where: File, table and sensor, for the messages.

    Raises:
        InputError: It has a place of its own beside its mount, or an offset from
            nothing, or nothing of that name carries it.
    """
    if "mount" not in entry:
        for key in ("offset_m", QUATERNION):
            if key in entry:
                raise InputError(
                    f'{where} {key}: expected mount = "vehicle" with it, got no mount'
                )
        return ""
    mount = choice(entry["mount"], MOUNTS, f"{where} mount")
    if "position_m" in entry:
        raise InputError(
            f"{where} position_m: expected offset_m, in the axes of the vehicle's "
            f"body, for a sensor on a vehicle, got {shown(entry['position_m'])}"
        )
    if "vehicle" not in document:
        raise InputError(
            f'{where} mount: expected a [vehicle] that carries it, got "{mount}" and '
            "no such table"
        )
    return mount


def _refuse_unmountable(
    kind: str, records: Sequence[tuple[str, float]], where: str
) -> None:
    """Refuse a sensor that cannot ride along.

    Args:
        kind: Of sensor; "" if unsaid.
        records: What it records, and the sigma of each.
        where: File, table and sensor, for the messages.

    Raises:
        InputError: It stands in the ground, or nothing is built for it.
    """
    if kind == "geophone":
        raise InputError(
            f"{where} mount: expected a sensor that can ride along, got a geophone, "
            "which stands on the ground"
        )
    if kind == "anemometer":
        raise not_yet(f"{where} mount", "an anemometer that rides along")
    for quantity, _ in records:
        of_ground = quantity.startswith("ground_") and quantity != "ground_arrival_s"
        apart = len(components(quantity)) > 1 or quantity in (*TIMED, *BY_CAMERA)
        if apart or of_ground:
            raise not_yet(f"{where} records {quantity}", "a sensor in motion")
