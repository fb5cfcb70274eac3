"""The reader of the clocks of a scene: of recorders, by a log's column `clock`."""

from collections.abc import Collection
from typing import Any

from jblast.errors import InputError, shown
from jblast.parameter_table import CLOCK, CLOCK_OFFSET
from jblast.scene.reader.priors import Uncertain, read_number
from jblast.scene.reader.tables import name_of, tables
from jblast.scene.sensor import Clock


def read_clocks(
    document: dict[str, Any], source: str, sensors: Collection[str]
) -> tuple[tuple[Clock, ...], dict[str, Uncertain]]:
    """Read the tables [[clock]] of a scene file, and their offsets.

    Args:
        document: The tables of the file.
        source: Its name, for the messages.
        sensors: Names of sensors that have an offset of their own.

    Raises:
        InputError: As in `read_scene`.
    """
    clocks: dict[str, Clock] = {}
    offsets: dict[str, Uncertain] = {}
    for index, entry in enumerate(tables(document, "clock", source), start=1):
        where = f"{source}: [[clock]]"
        if "name" not in entry:
            raise InputError(
                f"{where} name: expected a name for clock {index}, got nothing"
            )
        name = name_of(entry["name"], f"{where} name")
        if name in clocks:
            raise InputError(
                f"{where} name: expected each name once, got {shown(name)} twice"
            )
        where = f"{where} {shown(name)}"
        if name in sensors:
            raise InputError(
                f"{where}: the [[sensor]] of that name has a clock_offset_s; expected "
                "one of the two"
            )
        clocks[name] = Clock(name)
        if "offset_s" in entry:
            offset = read_number(entry["offset_s"], CLOCK, f"{where} offset_s")
            offsets[f"{CLOCK_OFFSET}.{name}"] = offset
    return tuple(clocks.values()), offsets
