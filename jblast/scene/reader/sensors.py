"""The reader of a scene's sensors."""

from itertools import pairwise
from typing import Any

import numpy as np

from jblast.errors import InputError, shown
from jblast.parameter_table import CLOCK, CLOCK_OFFSET
from jblast.quantities import TIMED
from jblast.scene.reader.instrument import read_instrument
from jblast.scene.reader.priors import LISTS, Uncertain, finite, fixed_list, read_number
from jblast.scene.reader.records import read_records
from jblast.scene.reader.schema import SENSOR_KINDS
from jblast.scene.reader.tables import choice, name_of, tables
from jblast.scene.sensor import Sensor


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
        sensors[name] = _sensor(name, entry, where)
        if (key := CLOCK.key.name) in entry:
            offset = read_number(entry[key], CLOCK, f"{where} {key}")
            offsets[f"{CLOCK_OFFSET}.{name}"] = offset
    return tuple(sensors.values()), offsets


def _sensor(name: str, entry: dict[str, Any], where: str) -> Sensor:
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
    position = _position(entry, f"{where} position_m")
    return Sensor(
        name=name,
        position_m=position,
        kind=kind,
        records=records,
        times_s=times,
        instrument=read_instrument(entry, kind, position, where),
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
