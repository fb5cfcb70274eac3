"""The reader of logs: one measurement a row, however it is written."""

from typing import Any

from jblast.errors import InputError
from jblast.observations.dialects.decimals import take_decimal_commas
from jblast.observations.dialects.header import read_header
from jblast.observations.dialects.series import refuse_series
from jblast.observations.dialects.sources import source_name, table_of
from jblast.observations.dialects.tidying import (
    UnitOf,
    drop_blanks,
    refuse_two_tables,
    take_units_row,
)
from jblast.observations.dialects.wide import made_long, refuse_wide
from jblast.observations.faults import Faults
from jblast.observations.records.covariances import with_covariances
from jblast.observations.records.side_file import COVARIANCES
from jblast.observations.rows import Rows
from jblast.observations.table import NUMBERS, Observations, no_rows
from jblast.progress import stages

STAGES = {"loading": 1.0, "taking lines apart": 4.0, "checking columns": 8.0}
"""Of reading, and about how long each takes, in seconds a million rows."""


def read(
    source: Any,
    *,
    strict: bool = False,
    wide: bool = False,
    faults: list[InputError] | None = None,
    date: str | None = None,
    zone: str | None = None,
) -> Observations:
    """Read a log of observations: one measurement a row.

    Columns are `sensor,quantity,value,sigma`, then either `east_m,north_m,up_m`,
    `lat_deg,lon_deg,alt_m` or `range_m`, or neither where the scene says where the
    sensor stands; `time_s`, `path`, `shot`, `clock` and `record` may follow. Their
    order is free. Lines that begin with # are comments. An empty sigma leaves the law's
    scatter alone. A value `>0.12` is a lower bound: what was measured is no less. A
    clock time may stand in `value_utc`, as 2020-08-04T15:08:18.310Z, in place of
    `value`. How the errors of one record go together is read from
    `LOG.covariance.csv`, if that stands beside `LOG.csv`, or from the `attrs` of a data
    frame.

    Other dialects are recognised by what can be read one way only, never guessed:
    units in the names of columns and quantities, separators, decimal commas, encodings,
    spreadsheets, empty fields. What was converted, skipped or supplied is told in
    `understood`.

    Args:
        source: A path (text, .xlsx, .ods, .parquet), an open file or buffer of text or
            bytes, or a `pandas.DataFrame`.
        strict: Whether to take UTF-8 text with commas, our own columns and units alone.
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
    found = Faults(faults)
    try:
        log = _read(source, found, strict=strict, wide=wide, date=date, zone=zone)
        attached = getattr(source, "attrs", {}).get(COVARIANCES)
        return with_covariances(log, found, attached)
    except InputError as fault:
        if faults is None:
            raise
        faults.append(fault)
        return no_rows(source_name(source))


def _read(
    source: Any,
    faults: Faults,
    *,
    strict: bool,
    wide: bool,
    date: str | None,
    zone: str | None,
) -> Observations:
    begin = stages(STAGES)
    begin("loading")
    table = table_of(source, faults, strict=strict)
    begin("taking lines apart")
    where = table.at(table.header_line)
    nothing = f"{where}: nothing after the header; expected one measurement a row"
    units_row: dict[str, UnitOf] = {}
    if not strict:
        drop_blanks(table)
        units_row = take_units_row(table)
    if wide:
        table = made_long(table, units_row)
    else:
        refuse_series(table)
        if not strict:
            refuse_wide(table, units_row)
    header = read_header(table, faults, units_row, strict=strict)
    if not len(table.lines):
        raise InputError(nothing)
    refuse_two_tables(table, [header.theirs.get(name, name) for name in table.header])
    if not strict and not wide:
        take_decimal_commas(table, NUMBERS)
    begin("checking columns")
    rows = Rows(table, header, faults, strict=strict, date=date, zone=zone)
    if not rows.lines:
        n, first = len(rows.skipped), rows.skipped[0]
        raise InputError(
            f"{table.at(first)}: expected a value in some row, got "
            + (f"{n} rows without a value" if n > 1 else "a row without a value, alone")
        )
    return rows.observations()
