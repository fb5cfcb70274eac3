"""Stations: positions, clocks and start times of recorders, from a table.

A station is identified by the name of its channel: the stem of the file, or
stem.channel with the channel's name or number. Its position is east, north, up [m] or
latitude, longitude, altitude. The column `start_utc` gives the time of the first sample
for files without a time stamp; it is refused for files that contain one, and must be
the same for all channels of a file.
"""

import os
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from jblast.errors import InputError, argument, nearest, shown
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
from jblast.observations.rows import Fields, converted_columns
from jblast.observations.sources import Table, table_of
from jblast.observations.table import Faults, Understood
from jblast.units import spelt

PLACE = ("east_m", "north_m", "up_m")
DEGREES = ("lat_deg", "lon_deg", "alt_m")
START = "start_utc"
MAX_FAULTS = 20
"""Largest number of faults that one message lists."""
COLUMNS = ("sensor", *PLACE, *DEGREES, "clock", START)


class Station(NamedTuple):
    """Position and clock of a microphone.

    Attributes:
        position: East, north, up [m].
        clock: Clock of its recorder; "" for the common clock.
        frame: Origin of the position on the Earth, for a table in degrees.
        start: Nanoseconds since 1970, UTC, of the first sample of its record; None
            if unknown.
    """

    position: tuple[float, float, float]
    clock: str
    frame: Frame | None = None
    start: int | None = None


def read_stations(
    path: str | os.PathLike[str], understood: list[Understood] | None = None
) -> dict[str, Station]:
    """Return the stations of a table by name.

    Columns are `sensor,east_m,north_m,up_m`, or `sensor,lat_deg,lon_deg,alt_m`, and
    optionally `clock` and `start_utc`, the time of the first sample of a file without a
    time stamp (2020-08-04T15:08:18.310Z). A sensor is the stem of a file's name, or
    stem.channel, with the name or number of the channel. `note` columns and lines that
    begin with # are comments. Dialects and units of length are those of a log (`read`).

    Args:
        path: Text, a spreadsheet or Parquet.
        understood: Conversions are appended here.

    Raises:
        InputError: The file is not as described; the message has position and fault,
            of all faults.
    """
    within = f"a header {','.join(COLUMNS[:4])} and a station a row"
    gathered: list[InputError] = []
    faults = Faults(gathered)
    table = table_of(path, faults, expected="a table of stations", within=within)
    drop_blanks(table)
    header = _header(table, take_units_row(table))
    if not len(table.lines):
        _raise(path, gathered)
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
    axes, frame = [rows.number(name, optional=False) for name in PLACE], None
    if set(DEGREES) & set(table.header):
        if on_earth := places_in_degrees(rows):
            axes, frame = on_earth[0].T, on_earth[1]
        given = rows.texts["lat_deg"]
        rows.refuse(
            [not x for x in given], "lat_deg", lambda _: "a number, got nothing"
        )
    starts = _starts(rows)
    _raise(path, gathered)
    if understood is not None:
        understood += [*table.understood, *converted_columns(rows)]
    return {
        name: Station((float(east), float(north), float(up)), clock, frame, start)
        for name, east, north, up, clock, start in zip(
            sensors, *axes, rows.text("clock"), starts, strict=True
        )
    }


def _raise(path: str | os.PathLike[str], faults: list[InputError]) -> None:
    """Raise one error for all faults of a table, if there are any."""
    if len(faults) == 1:
        raise faults[0]
    if faults:
        texts = [fault.worded(argument) for fault in faults[:MAX_FAULTS]]
        texts = [text.removeprefix(f"{path}: ") for text in texts]
        more = len(faults) - MAX_FAULTS
        texts += [f"and {more} more"] if more > 0 else []
        raise InputError(f"{path}: {len(faults)} faults: {'; '.join(texts)}")


def _starts(rows: Fields) -> list[int | None]:
    """Return the start times of records; None without one, and for faults."""
    starts: list[int | None] = []
    for row, text in enumerate(rows.text(START)):
        try:
            starts.append(instant(text, None, None) if text else None)
        except NotAnInstant:
            starts.append(None)
            bad = [at == row for at in range(len(rows.lines))]
            expected = f"a day, a time and a zone, as {EXAMPLE}, got {shown(text)}"
            # bound as a default, since a closure would read the last text of the loop
            rows.refuse(bad, START, lambda _, message=expected: message)
    return starts


def _header(table: Table, units_row: Mapping[str, UnitOf]) -> Header:
    """Rename a table's columns to our names.

    Raises:
        InputError: A column is unknown, missing or repeated.
    """
    where = table.at(table.header_line)
    header = Header()
    unknown: list[str] = []
    for index, theirs in enumerate(table.header):
        found = column_of(theirs, units_row.get(theirs), table)
        name, unit = (START, None) if spelt(theirs) == START else found or ("", None)
        if name not in COLUMNS:
            unknown.append(f"{shown(theirs)}{nearest(theirs, COLUMNS)}")
            continue
        if name in header.theirs:
            got = "it twice" if header.theirs[name] == theirs else shown(theirs)
            raise InputError(f"{where}: expected column {name} once, got {got}")
        header.theirs[name] = theirs
        if unit is not None:
            header.units[name] = unit
        table.header[index] = name
    needed = DEGREES[:2] if set(DEGREES) & set(table.header) else PLACE
    missing = [name for name in ("sensor", *needed) if name not in table.header]
    if unknown:
        also = f"; missing column {', '.join(missing)}" if missing else ""
        raise InputError(
            f"{where}: unknown column {', '.join(unknown)}; "
            f"expected some of {', '.join(COLUMNS)}{also}"
        )
    if missing:
        raise InputError(f"{where}: missing column {', '.join(missing)}")
    return header


def started(
    recording: Recording, stations: Mapping[str, Station], later_s: float = 0.0
) -> Recording:
    """Return a recording with the names of its stations, and their start time.

    A table may name channels by number: stem.1 for stem.gauge.

    Args:
        recording: Recording of a file.
        stations: Stations by name of channel.
        later_s: Time from the first sample of the file to that of the recording [s].

    Raises:
        InputError: The file has a time stamp, or its channels have several start times.
    """
    if recording.aliases:
        both = zip(recording.names, recording.aliases, strict=True)
        names = (n if n in stations or a not in stations else a for n, a in both)
        recording = replace(recording, names=tuple(names))
    starts = {stations[name].start for name in recording.names if name in stations}
    if starts <= {None}:
        return recording
    if recording.epoch is not None:
        raise InputError(
            f"{recording.source}: expected no {START} for "
            f"{shown(recording.names[0])}, as the file has a time stamp; got one"
        )
    start = starts.pop()
    if starts or start is None:
        raise InputError(
            f"{recording.source}: expected one {START} for all channels of a file, got "
            "several"
        )
    # a datetime has microseconds: the nanoseconds stay in the seconds after it
    whole = start // SECOND * SECOND
    return replace(
        recording,
        epoch=moment(whole),
        start_s=(start - whole) / SECOND + later_s,
        clock_is_set=True,
    )
