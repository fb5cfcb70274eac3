"""The reader of observation files: tidy CSV, one measurement a row."""

import csv
import os
from collections.abc import Sequence

from jblast.errors import InputError, nearest, read_text, shown
from jblast.observations.aliases import our_name
from jblast.observations.faults import Faults
from jblast.observations.records.covariances import with_covariances
from jblast.observations.rows import Rows
from jblast.observations.table import (
    COLUMNS,
    DEGREES,
    NEEDED,
    POSITION,
    QUANTITIES,
    Observations,
    no_rows,
)
from jblast.progress import counted, stages

STAGES = {"loading": 1.0, "taking lines apart": 4.0, "checking columns": 8.0}
"""Of reading, and about how long each takes, in seconds a million rows."""
MANY = 50_000
"""Lines between two reports of how far it is."""


def read(
    path: str | os.PathLike[str],
    *,
    strict: bool = False,
    wide: bool = False,
    faults: list[InputError] | None = None,
    date: str | None = None,
    zone: str | None = None,
) -> Observations:
    """Read a tidy CSV of observations.

    Columns are `sensor,quantity,value,sigma`, then either `east_m,north_m,up_m`,
    `lat_deg,lon_deg,alt_m` or `range_m`, or neither where the scene says where the
    sensor stands; `time_s`, `path`, `shot`, `clock` and `record` may follow. Their
    order is free. Lines that begin with # are comments. An empty sigma leaves the law's
    scatter alone. A value `>0.12` is a lower bound: what was measured is no less. A
    clock time may stand in `value_utc`, as 2020-08-04T15:08:18.310Z, in place of
    `value`. How the errors of one record go together is read from
    `LOG.covariance.csv`, if that stands beside `LOG.csv`.

    Args:
        path: The file.
        strict: Whether to take our own columns and units alone.
        wide: Whether each quantity has a column of its own.
        faults: Every fault is appended here, and reading goes on with the other rows
            and columns; None: the first is raised.
        date: The day, YYYY-MM-DD, of times in `value_utc` that have none.
        zone: The zone of those that have none: +02:00, UTC, Asia/Beirut.

    Returns:
        The log: a row a measurement, in SI units. Where faults are gathered, of the
        rows that have none; it may have no rows.

    Raises:
        InputError: The file is not as described; the message says where and how.

    Example:
        `observations = jblast.read("log.csv")`
    """
    told = Faults(faults)
    try:
        return with_covariances(_read(path, told, date, zone), told)
    except InputError as fault:
        if faults is None:
            raise
        faults.append(fault)
        return no_rows(str(path))


def _read(
    path: str | os.PathLike[str], faults: Faults, date: str | None, zone: str | None
) -> Observations:
    begin = stages(STAGES)
    begin("loading")
    text = read_text(path, "a CSV file of observations")
    begin("taking lines apart")
    comments, lines, numbers = [], [], []
    for number, line in enumerate(text.split("\n"), start=1):
        stripped = line.strip()
        if stripped.startswith("#"):
            comments.append(stripped[1:].strip())
        elif stripped:
            lines.append(line)
            numbers.append(number)
    if not lines:
        raise InputError(
            f"{path}: line 1: the file is empty; expected a header "
            f"{','.join(NEEDED)} and one measurement a row"
        )
    records = _records(str(path), lines, numbers)
    header = _header(str(path), records[0], numbers[0])
    if len(records) == 1:
        raise InputError(
            f"{path}: line {numbers[0]}: nothing after the header; "
            "expected one measurement a row"
        )
    begin("checking columns")
    rows = Rows(str(path), numbers[1:], header, records[1:], faults, date, zone)
    return rows.observations(tuple(comments))


def _records(path: str, lines: list[str], numbers: list[int]) -> list[list[str]]:
    """Split lines into fields; each line is one record, as wide as the header."""
    reader = csv.reader(lines, skipinitialspace=True, strict=True)
    records: list[list[str]] = []
    through = counted(len(lines), "lines")
    try:
        for record in reader:
            records.append(record)
            if reader.line_num != len(records):
                break
            if not len(records) % MANY:
                through(len(records))
    except csv.Error as error:
        raise InputError(
            f"{path}: line {numbers[len(records)]}: expected comma-separated fields, "
            f"got a stray or unclosed quote ({error})"
        ) from None
    if reader.line_num != len(records):
        raise InputError(
            f"{path}: line {numbers[len(records) - 1]}: expected one measurement a "
            "line, got a quote that is not closed on it"
        )
    width = len(records[0])
    for number, record in zip(numbers, records, strict=True):
        if len(record) != width:
            raise InputError(
                f"{path}: line {number}: expected {width} fields as in the header, "
                f"got {len(record)}"
                + ("; is a decimal comma among them?" if len(record) > width else "")
            )
    return records


def _header(path: str, record: Sequence[str], line: int) -> list[str]:
    """Check the names of the columns."""
    where = f"{path}: line {line}"
    if len(record) == 1:
        for separator, name in ((";", "semicolons"), ("\t", "tabs")):
            if separator in record[0]:
                raise InputError(
                    f"{where}: expected columns separated by commas, got {name}; "
                    "save the file with commas (and decimal points)"
                )
    header = [name.strip() for name in record]
    for name in header:
        if name not in COLUMNS:
            raise InputError(f"{where}: unknown column {shown(name)}{_advice(name)}")
        if header.count(name) > 1:
            raise InputError(f"{where}: expected column {name} once, got it twice")
    named = {"value" if name == "value_utc" else name for name in header}
    missing = [name for name in NEEDED if name not in named]
    if missing:
        raise InputError(
            f"{where}: missing column {', '.join(missing)}; expected "
            f"{', '.join(NEEDED)}; got {', '.join(header)}"
        )
    partial = [name for name in POSITION if name not in header]
    if 0 < len(partial) < 3 and not set(DEGREES) & set(header):
        raise InputError(
            f"{where}: missing column {', '.join(partial)}; expected all of "
            f"{', '.join(POSITION)} or none of them"
        )
    return header


def _advice(name: str) -> str:
    """Say what to write in place of an unknown column."""
    if name in QUANTITIES:
        return (
            "; it is a quantity, not a column: put it into column quantity, "
            "one measurement a row"
        )
    ours = our_name(name)
    if ours is None:
        return (nearest(name, COLUMNS)) + f"; expected some of {', '.join(COLUMNS)}"
    column = "column" if ours[0] in COLUMNS else "quantity"
    return f"; ours is {column} {ours[0]}: multiply by {ours[1]:g}"
