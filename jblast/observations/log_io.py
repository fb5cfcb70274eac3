"""Input and output of logs: text, spreadsheets, Parquet and pandas.

`read` turns any source into a table of text, identifies its columns, refuses records of
samples and tables in which more than one reading is possible, and checks each row.
`write` writes CSV in UTF-8 with the shortest digits that read back as the same number,
so a log that is written and read again is the same log. Where the log has a frame or
an epoch, positions are written as degrees and clock times as UTC. Covariances of errors
are written to a side file (`covariances`).
"""

import math
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, shown
from jblast.files import write_text
from jblast.observations.covariances import with_covariances, write_covariances
from jblast.observations.instants import written
from jblast.observations.names import (
    check_all_there,
    clean_numbers,
    made_long,
    read_header,
)
from jblast.observations.rows import AT_LEAST, observations_of
from jblast.observations.sources import LOWER_BOUND, source_name, table_of
from jblast.observations.table import (
    COLUMNS,
    DEGREES,
    NAME_COLUMNS,
    NEEDED,
    POSITION,
    SAMPLES,
    Observations,
    observed,
    plain_text,
    quoted,
)
from jblast.progress import stages
from jblast.quantities import CLOCK_TIMES
from jblast.units import spelt

STAGES = {"loading": 1.0, "checking columns": 8.0}
"""Stages of reading, and their approximate durations in seconds a million rows."""
EXPECTED = (
    f"a CSV file of observations: a header {','.join(NEEDED)} and one measurement a row"
)


def read(
    source: Any,
    *,
    wide: bool = False,
    faults: list[InputError] | None = None,
    date: str | None = None,
    zone: str | None = None,
) -> Observations:
    """Read a log of observations: one measurement a row.

    Columns are `sensor,quantity,value,sigma`, then either `east_m,north_m,up_m`,
    `lat_deg,lon_deg,alt_m` or `range_m`, or neither where the scene has the position
    of the sensor; `time_s`, `path`, `shot`, `clock` and `record` may follow. Their
    order is free. Lines that begin with # are comments. An empty sigma stands for the
    scatter of the law only. A value `>0.12` is a lower bound of the measured value. A
    clock time may stand in `value_utc`, as 2020-08-04T15:08:18.310Z, in place of
    `value`. Covariances of the errors of one record are read from
    `LOG.covariance.csv`, if it is next to `LOG.csv`.

    Other dialects are recognised where only one reading is possible, never guessed:
    units in the names of columns and quantities, separators, decimal commas, encodings,
    spreadsheets, empty fields. What was converted, skipped or supplied is listed in
    `understood`.

    Args:
        source: A path (text, .xlsx, .ods, .parquet), an open file or buffer of text or
            bytes, or a `pandas.DataFrame`.
        wide: True if each quantity has a column of its own.
        faults: Every fault is appended here, and reading continues with the other rows
            and columns; None: the first is raised.
        date: The day, YYYY-MM-DD, of times in `value_utc` that have none.
        zone: The zone of those that have none: +02:00, UTC, Asia/Beirut.

    Returns:
        The log: a row a measurement, in SI units. Where faults are gathered, it has the
        rows without faults, which may be none.

    Raises:
        InputError: The file is not as described; the message has the place and fault.

    Example:
        `observations = jblast.read("log.csv")`
    """
    gathered: list[InputError] = []
    log = observed((), (), (), (), source=source_name(source))
    try:
        log = _read(source, gathered, wide, date, zone)
        log = with_covariances(log)
    except InputError as fault:
        gathered.append(fault)
    if faults is not None:
        faults += gathered
    elif gathered:
        raise gathered[0]
    return log


def _read(
    source: Any,
    gathered: list[InputError],
    wide: bool,
    date: str | None,
    zone: str | None,
) -> Observations:
    begin = stages(STAGES)
    begin("loading")
    table = table_of(source, EXPECTED)
    # the same list, so that faults before an exception are kept
    gathered += table.faults
    table.faults = gathered
    if not {"sensor", "gauge", "quantity"} & set(map(spelt, table.header)):
        raise InputError(
            f"{table.at(table.header_line)}: expected {EXPECTED.partition(': ')[2]}, "
            f"got {shown(', '.join(filter(None, table.header)))}; of a record of "
            "samples the arrival and peak are picked first (jblast pick)"
        )
    if not len(table.lines):
        raise InputError(
            f"{table.at(table.header_line)}: nothing after the header; expected one "
            "measurement a row"
        )
    # before columns are combined: a decimal mark is decided by all numbers of the file
    clean_numbers(table)
    if wide:
        made_long(table)
    begin("checking columns")
    header = read_header(table)
    check_all_there(table)
    return observations_of(table, header, date, zone)


def write(
    path: str | os.PathLike[str],
    observations: Observations,
    *,
    comments: Sequence[str] = (),
) -> None:
    """Write observations as tidy CSV; empty columns are left out.

    Covariances are written to the side file, `LOG.covariance.csv` next to `LOG.csv`. An
    old side file is removed, so that the same log is read back. Files of samples are
    named by their path from there.

    Args:
        path: The file, replaced if it exists.
        observations: The log.
        comments: Provenance, written before what `comments` of the observations holds.

    Raises:
        ValueError: There are no rows, or a name or comment would not read back: it has
            line breaks, control characters or outer spaces.
    """
    # names of sample files are relative to the log, which may be written elsewhere
    observations = _with_samples_from(Path(path).parent, observations)
    write_text(path, log_text(observations, comments))
    write_covariances(path, observations)


def log_text(observations: Observations, comments: Sequence[str] = ()) -> str:
    """Return the text of the file that `write` writes, with its errors."""
    if not len(observations):
        raise ValueError("observations has no rows; an empty file would not read back")
    comments = (*comments, *observations.comments)
    lines = [f"# {plain_text(line)}".rstrip() for line in comments]
    texts = {
        name: ["" if math.isnan(x) else repr(float(x)) for x in column]
        if isinstance(column, np.ndarray)
        else [quoted(x) for x in column]
        for name, column in typed_columns(observations).items()
    }
    for row in np.flatnonzero(observations.bounds()):
        texts["value"][row] = AT_LEAST + texts["value"][row]
    lines.append(",".join(texts))
    lines.extend(",".join(row) for row in zip(*texts.values(), strict=True))
    return "\n".join(lines) + "\n"


def _with_samples_from(folder: Path, observations: Observations) -> Observations:
    """Return a log whose files of samples are named by their path from a folder."""
    beside = Path(observations.source).parent
    if SAMPLES not in observations.quantity or beside.resolve() == folder.resolve():
        return observations
    records = list(observations.records())
    for row in np.flatnonzero(np.isin(observations.quantity, SAMPLES)):
        if not Path(records[row]).is_absolute():
            there = os.path.relpath(beside / records[row], folder)
            records[row] = Path(there).as_posix()
    return replace(observations, record=tuple(records))


def typed_columns(
    observations: Observations,
) -> dict[str, Float[np.ndarray, " row"] | tuple[str, ...]]:
    """Return every column that is needed or not empty, in the order of a file.

    Positions are degrees where the log has a frame, clock times UTC where it has an
    epoch; a value is NaN in a row with a `value_utc`.
    """
    log = observations
    place, names = log.position, POSITION
    if log.frame is not None:
        place, names = log.frame.to_geodetic(place), DEGREES
    columns = {name: getattr(log, name) for name in (*NEEDED, *NAME_COLUMNS)}
    columns |= zip(names, place.T, strict=True)
    columns |= {"range_m": log.slant_range, "time_s": log.time}
    if log.epoch is not None:
        timed = np.isin(log.quantity, CLOCK_TIMES)
        columns["value_utc"] = tuple(
            written(log.epoch, value) if is_time else ""
            for is_time, value in zip(timed, log.value.tolist(), strict=True)
        )
        # the same time twice, as seconds and as UTC, could contradict itself after
        # editing
        columns["value"] = np.where(timed, np.nan, log.value)
    # NaN is unlike itself
    return {
        name: columns[name]
        for name in COLUMNS
        if name in NEEDED or any(x == x and x != "" for x in columns.get(name, ()))
    }


def to_pandas(observations: Observations) -> Any:
    """Return a log as a `pandas.DataFrame`, columns as `write` writes them.

    Lower bounds are in a column `lower_bound`, comments in `attrs`. `read` accepts the
    data frame, which has no covariances.
    """
    import pandas

    columns: dict[str, Any] = dict(typed_columns(observations))
    if observations.bounds().any():
        columns[LOWER_BOUND] = observations.bounds()
    frame = pandas.DataFrame({name: list(held) for name, held in columns.items()})
    frame.attrs = {"comments": list(observations.comments)}
    return frame
