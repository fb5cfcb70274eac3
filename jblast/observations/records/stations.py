"""Where recorders stood: a table that sound files are given their places by."""

import csv
import math
import os
from typing import NamedTuple

from jblast.errors import InputError, nearest, read_text, shown

PLACE = ("east_m", "north_m", "up_m")
DEGREES = ("lat_deg", "lon_deg", "alt_m")
COLUMNS = ("sensor", *PLACE, "clock")


class Station(NamedTuple):
    """Where a microphone stood.

    Attributes:
        position: East, north, up [m].
        clock: Its recorder's; "" for the common clock.
    """

    position: tuple[float, float, float]
    clock: str


def read_stations(path: str | os.PathLike[str]) -> dict[str, Station]:
    """Return where recorders stood, by name.

    Columns are `sensor,east_m,north_m,up_m` and perhaps `clock`; a sensor is the stem
    of a file's name, or stem.channel, channels counted from 1. `note` columns and lines
    that begin with # are comments.

    Args:
        path: A CSV file.

    Raises:
        InputError: The file is not as described; the message says where and how.
    """
    lines = [
        (number, line)
        for number, line in enumerate(
            read_text(path, "a CSV file of stations").split("\n"), start=1
        )
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if len(lines) < 2:
        raise InputError(
            f"{path}: expected a header {','.join(COLUMNS[:4])} and a station a row, "
            f"got {len(lines)} lines"
        )
    header = [name.strip() for name in next(csv.reader([lines[0][1]]))]
    _check_header(f"{path}: line {lines[0][0]}", header)
    stations: dict[str, Station] = {}
    for number, line in lines[1:]:
        where = f"{path}: line {number}"
        fields = [field.strip() for field in next(csv.reader([line]))]
        if len(fields) != len(header):
            raise InputError(
                f"{where}: expected {len(header)} fields as in the header, "
                f"got {len(fields)}"
            )
        row = dict(zip(header, fields, strict=True))
        name = row["sensor"]
        if not name or name in stations:
            got = f"{shown(name)} twice" if name else "nothing"
            raise InputError(f"{where}, column sensor: expected a new name, got {got}")
        east, north, up = (_number(where, key, row[key]) for key in PLACE)
        stations[name] = Station((east, north, up), row.get("clock", ""))
    return stations


def _check_header(where: str, header: list[str]) -> None:
    """Check the names of the columns."""
    if set(DEGREES[:2]) & set(header):
        raise InputError(
            f"{where}: {', '.join(DEGREES)} are not supported yet; expected "
            f"{', '.join(PLACE)}"
        )
    for name in header:
        if name not in COLUMNS and not name.startswith("note"):
            raise InputError(
                f"{where}: unknown column {shown(name)}{nearest(name, COLUMNS)}; "
                f"expected some of {', '.join(COLUMNS)}"
            )
        if header.count(name) > 1:
            raise InputError(f"{where}: expected column {name} once, got it twice")
    missing = [name for name in COLUMNS[:4] if name not in header]
    if missing:
        raise InputError(f"{where}: missing column {', '.join(missing)}")


def _number(where: str, column: str, text: str) -> float:
    """Return a finite number."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        got = shown(text) if text else "nothing"
        raise InputError(f"{where}, column {column}: expected a number, got {got}")
    return value
