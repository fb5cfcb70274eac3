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
from datetime import datetime
from typing import NamedTuple

from jblast.errors import InputError, argument, shown
from jblast.observations.instants import EXAMPLE, NotAnInstant, instant
from jblast.observations.names import read_header
from jblast.observations.places import Frame
from jblast.observations.positions import positions
from jblast.observations.records.recording import Recording
from jblast.observations.rows import converted_columns
from jblast.observations.rules import Rows, Rule
from jblast.observations.sources import table_of
from jblast.observations.text_table import take_decimal_commas
from jblast.results import Note

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
        start: UTC of the first sample of its record; None if unknown.
    """

    position: tuple[float, float, float]
    clock: str
    frame: Frame | None = None
    start: datetime | None = None


def read_stations(
    path: str | os.PathLike[str], understood: list[Note] | None = None
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
    table = table_of(path, f"a table of stations: {within}")
    header = read_header(table, COLUMNS)
    where = table.at(table.header_line)
    degrees = bool({*DEGREES} & {*table.header})
    needed = ("sensor", *(DEGREES[:2] if degrees else PLACE))
    missing = [name for name in needed if name not in table.header]
    if missing:
        table.faults.append(InputError(f"{where}: missing column {', '.join(missing)}"))
    elif not len(table.lines):
        table.faults.append(
            InputError(f"{path}: expected {within}, got the header alone")
        )
    # these leave nothing to check
    if missing or not len(table.lines):
        _raise(path, table.faults)
    numbers = [at for at, name in enumerate(table.header) if name in PLACE + DEGREES]
    take_decimal_commas(table, numbers)
    rows = Rows(table, header)
    sensors = rows.text("sensor")
    starts: list[datetime | None] = []
    for text in rows.text(START):
        try:
            starts.append(instant(text, None, None) if text else None)
        except NotAnInstant:
            starts.append(None)
    rows.refuse(
        [
            Rule(
                "sensor",
                [not x or x in sensors[:row] for row, x in enumerate(sensors)],
                lambda row: (
                    "expected a new name, got "
                    + (f"{shown(sensors[row])} twice" if sensors[row] else "nothing")
                ),
            ),
            *(Rule(name, ~rows.given(name), "a number") for name in needed[1:]),
            Rule(
                START,
                rows.given(START) & [start is None for start in starts],
                f"a day, a time and a zone, as {EXAMPLE}",
            ),
        ]
    )
    placed = positions(rows)
    _raise(path, table.faults)
    if understood is not None:
        understood += [*table.notes, *converted_columns(rows), *placed.notes]
    return {
        name: Station((float(x), float(y), float(z)), clock, placed.frame, start)
        for name, (x, y, z), clock, start in zip(
            sensors, placed.enu, rows.text("clock"), starts, strict=True
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
    whole = start.replace(microsecond=0)
    return replace(
        recording,
        epoch=whole,
        start_s=start.microsecond / 1e6 + later_s,
        clock_is_set=True,
    )
