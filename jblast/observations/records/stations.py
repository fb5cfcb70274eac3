"""Where recorders stood: a table that sound files are given their places by."""

import csv
import math
import os
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jblast.errors import InputError, nearest, read_text, shown
from jblast.observations.places.degrees import places_in_degrees
from jblast.observations.places.frame import Frame
from jblast.observations.times.instant import EXAMPLE, NotAnInstant, instant

PLACE = ("east_m", "north_m", "up_m")
DEGREES = ("lat_deg", "lon_deg", "alt_m")
START = "start_utc"
COLUMNS = ("sensor", *PLACE, *DEGREES, "clock", START)


class Station(NamedTuple):
    """Where a microphone stood.

    Attributes:
        position: East, north, up [m].
        clock: Its recorder's; "" for the common clock.
        frame: Where on the Earth that is counted from, of a table in degrees.
        start: Nanoseconds since 1970, UTC, of the first sample of its record; None
            where nobody said.
    """

    position: tuple[float, float, float]
    clock: str
    frame: Frame | None = None
    start: int | None = None


def read_stations(path: str | os.PathLike[str]) -> dict[str, Station]:
    """Return where recorders stood, by name.

    Columns are `sensor,east_m,north_m,up_m`, or `sensor,lat_deg,lon_deg,alt_m`, and
    perhaps `clock` and `start_utc`, when the first sample of a file was that does not
    say so itself (2020-08-04T15:08:18.310Z); a sensor is the stem of a file's name, or
    stem.channel, channels counted from 1. `note` columns and lines that begin with #
    are comments.

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
    table = _Table(str(path), [number for number, _ in lines[1:]], header)
    for number, line in lines[1:]:
        table.add(number, next(csv.reader([line])))
    on_earth = places_in_degrees(table) if set(DEGREES) & set(header) else None
    if on_earth is None:
        axes, frame = [table.number(name, optional=False) for name in PLACE], None
    else:
        axes, frame = on_earth[0].T, on_earth[1]
        table.refuse(np.isnan(axes[0]), "lat_deg", lambda _: "a number, got nothing")
    clocks = table.texts.get("clock") or [""] * len(table.lines)
    starts = _starts(table)
    return {
        name: Station((float(east), float(north), float(up)), clock, frame, start)
        for name, east, north, up, clock, start in zip(
            table.texts["sensor"], *axes, clocks, starts, strict=True
        )
    }


def _starts(table: "_Table") -> list[int | None]:
    """Return when records began; None where nothing is said."""
    starts: list[int | None] = []
    for row, text in enumerate(table.texts.get(START) or [""] * len(table.lines)):
        try:
            starts.append(instant(text, None, None) if text else None)
        except NotAnInstant as reason:
            where = f"{table.path}: line {table.lines[row]}, column {START}"
            raise InputError(
                f"{where}: expected a day, a time and a zone, as {EXAMPLE}, got "
                f"{shown(text)}"
            ) from reason
    return starts


class _Table:
    """The rows of a table of stations by column."""

    def __init__(self, path: str, lines: list[int], header: list[str]):
        self.path, self.lines = path, lines
        self.texts: dict[str, list[str]] = {name: [] for name in header}

    def add(self, number: int, fields: list[str]) -> None:
        """Take the fields of a line."""
        where = f"{self.path}: line {number}"
        if len(fields) != len(self.texts):
            raise InputError(
                f"{where}: expected {len(self.texts)} fields as in the header, "
                f"got {len(fields)}"
            )
        for text, column in zip(fields, self.texts.values(), strict=True):
            column.append(text.strip())
        *others, name = self.texts["sensor"]
        if not name or name in others:
            got = f"{shown(name)} twice" if name else "nothing"
            raise InputError(f"{where}, column sensor: expected a new name, got {got}")

    def number(
        self, column: str, *, optional: bool = True
    ) -> Float[np.ndarray, " row"]:
        """Return a column of finite numbers; NaN where an optional one is empty."""
        texts = self.texts.get(column, [""] * len(self.lines))
        numbers = np.array([_number(text) for text in texts])
        empty = optional & np.array([not text for text in texts])
        self.refuse(
            ~np.isfinite(numbers) & ~empty,
            column,
            lambda row: (
                f"a number, got {shown(texts[row]) if texts[row] else 'nothing'}"
            ),
        )
        return numbers

    def refuse(
        self,
        bad: Bool[np.ndarray, " row"] | list[bool],
        column: str,
        expected: Callable[[int], str],
    ) -> None:
        """Raise for the first bad row."""
        for row in map(int, np.flatnonzero(bad)):
            raise InputError(
                f"{self.path}: line {self.lines[row]}, column {column}: "
                f"expected {expected(row)}"
            )


def _check_header(where: str, header: list[str]) -> None:
    """Check the names of the columns."""
    for name in header:
        if name not in COLUMNS and not name.startswith("note"):
            raise InputError(
                f"{where}: unknown column {shown(name)}{nearest(name, COLUMNS)}; "
                f"expected some of {', '.join(COLUMNS)}"
            )
        if header.count(name) > 1:
            raise InputError(f"{where}: expected column {name} once, got it twice")
    needed = DEGREES[:2] if set(DEGREES) & set(header) else PLACE
    missing = [name for name in ("sensor", *needed) if name not in header]
    if missing:
        raise InputError(f"{where}: missing column {', '.join(missing)}")


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
