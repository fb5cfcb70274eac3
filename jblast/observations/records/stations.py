"""Stations: positions, clocks and start times of recorders, from a table.

A station is identified by the name of its channel: the stem of the file, or
stem.channel. Its position is east, north, up [m] or latitude, longitude, altitude. The
column `start_utc` gives the time of the first sample for files without a time stamp; it
is refused for files that contain one, and must be the same for all channels of a file.
"""

import os
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from jblast.errors import InputError, nearest, shown
from jblast.observations.clocks import EXAMPLE, SECOND, NotAnInstant, instant, moment
from jblast.observations.dialects import (
    Header,
    UnitOf,
    column_of,
    drop_blanks,
    refuse_two_tables,
    take_decimal_commas,
    take_units_row,
)
from jblast.observations.places import Frame, places_in_degrees
from jblast.observations.records.recording import Recording
from jblast.observations.rows import Fields, told_columns
from jblast.observations.sources import Table, table_of
from jblast.observations.table import Faults, Understood
from jblast.units import spelt

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


def read_stations(
    path: str | os.PathLike[str], understood: list[Understood] | None = None
) -> dict[str, Station]:
    """Return where recorders stood, by name.

    Columns are `sensor,east_m,north_m,up_m`, or `sensor,lat_deg,lon_deg,alt_m`, and
    perhaps `clock` and `start_utc`, when the first sample of a file was that does not
    say so itself (2020-08-04T15:08:18.310Z); a sensor is the stem of a file's name, or
    stem.channel, channels counted from 1. `note` columns and lines that begin with #
    are comments. Dialects and units of length are those of a log (`read`).

    Args:
        path: Text, a spreadsheet or Parquet.
        understood: What was converted is appended here.

    Raises:
        InputError: The file is not as described; the message says where and how.
    """
    within = f"a header {','.join(COLUMNS[:4])} and a station a row"
    faults = Faults()
    table = table_of(
        path, faults, strict=False, expected="a table of stations", within=within
    )
    drop_blanks(table)
    header = _header(table, take_units_row(table))
    if not len(table.lines):
        raise InputError(f"{path}: expected {within}, got the header alone")
    refuse_two_tables(table, [header.theirs.get(name, name) for name in table.header])
    take_decimal_commas(table, (*PLACE, *DEGREES))
    rows = Fields(table, header, faults)
    sensors = rows.text("sensor")
    rows.refuse(
        [not name or name in sensors[:row] for row, name in enumerate(sensors)],
        "sensor",
        lambda row: (
            "a new name, got "
            + (f"{shown(sensors[row])} twice" if sensors[row] else "nothing")
        ),
    )
    on_earth = places_in_degrees(rows) if set(DEGREES) & set(table.header) else None
    if on_earth is None:
        axes, frame = [rows.number(name, optional=False) for name in PLACE], None
    else:
        axes, frame = on_earth[0].T, on_earth[1]
        given = rows.texts["lat_deg"]
        rows.refuse(
            [not x for x in given], "lat_deg", lambda _: "a number, got nothing"
        )
    if understood is not None:
        understood += [*table.understood, *told_columns(rows)]
    return {
        name: Station((float(east), float(north), float(up)), clock, frame, start)
        for name, east, north, up, clock, start in zip(
            sensors, *axes, rows.text("clock"), _starts(rows), strict=True
        )
    }


def _starts(rows: Fields) -> list[int | None]:
    """Return when records began; None where nothing is said."""
    starts: list[int | None] = []
    for row, text in enumerate(rows.text(START)):
        try:
            starts.append(instant(text, None, None) if text else None)
        except NotAnInstant:
            bad = [at == row for at in range(len(rows.lines))]
            expected = f"a day, a time and a zone, as {EXAMPLE}, got {shown(text)}"
            rows.refuse(bad, START, lambda _, said=expected: said)
    return starts


def _header(table: Table, units_row: Mapping[str, UnitOf]) -> Header:
    """Give a table's columns our names.

    Raises:
        InputError: A column means nothing, is missing or is there twice.
    """
    where = table.at(table.header_line)
    header = Header()
    for index, theirs in enumerate(table.header):
        found = column_of(theirs, units_row.get(theirs), table, strict=False)
        name, unit = (START, None) if spelt(theirs) == START else found or ("", None)
        if name not in COLUMNS:
            raise InputError(
                f"{where}: unknown column {shown(theirs)}{nearest(theirs, COLUMNS)}; "
                f"expected some of {', '.join(COLUMNS)}"
            )
        if name in header.theirs:
            got = "it twice" if header.theirs[name] == theirs else shown(theirs)
            raise InputError(f"{where}: expected column {name} once, got {got}")
        header.theirs[name] = theirs
        if unit is not None:
            header.units[name] = unit
        table.header[index] = name
    needed = DEGREES[:2] if set(DEGREES) & set(table.header) else PLACE
    missing = [name for name in ("sensor", *needed) if name not in table.header]
    if missing:
        raise InputError(f"{where}: missing column {', '.join(missing)}")
    return header


def started(recording: Recording, stations: Mapping[str, Station]) -> Recording:
    """Return a recording whose first sample is at the time that its station tells.

    Args:
        recording: A file's.
        stations: By name of channel.

    Raises:
        InputError: The file tells the time of day itself, or its channels are told to
            begin at several times.
    """
    starts = {stations[name].start for name in recording.names if name in stations}
    if starts <= {None}:
        return recording
    if recording.epoch is not None:
        raise InputError(
            f"{recording.source}: tells the time of day itself; expected nothing in "
            f"column {START} of {shown(recording.names[0])}"
        )
    start = starts.pop()
    if starts or start is None:
        raise InputError(
            f"{recording.source}: expected one {START} for all channels of a file, got "
            "several"
        )
    whole = start // SECOND * SECOND  # an epoch holds microseconds, samples finer ones
    return replace(recording, epoch=moment(whole), start_s=(start - whole) / SECOND)
