"""Sources of tables: paths, buffers, spreadsheets, Parquet and data frames.

Text is read by `text_table`, spreadsheets by pandas (openpyxl, odfpy), Parquet by
pyarrow. Cells become the text that a CSV file would contain, with all digits of a
number, so that all sources are checked by the same rules. A workbook has one sheet with
content. Files of more than 1 GB are refused.
"""

import datetime
import io
import math
import os
from pathlib import PurePath
from typing import Any

import numpy as np

from jblast.errors import InputError, needed, read_bytes, reading, shown
from jblast.observations.table import FORMATS, FRAME, PARQUET, TEXTS
from jblast.observations.text_table import Row, Table, table_of_rows, text_table
from jblast.results import Note, conversion

MAX_BYTES = 1_000_000_000
"""Largest size of a table: it has some twenty million rows and takes 10 GB of
memory."""
LOWER_BOUND = "lower_bound"
"""Column of a data frame for lower bounds, as numbers cannot have the mark >."""
EXACT_INTEGERS = 2.0**53
"""Bound below which whole numbers are exact in double precision."""


def source_name(source: Any) -> str:
    """Return the name of a source in messages."""
    if isinstance(source, (str, os.PathLike)):
        return str(source)
    if _is_frame(source):
        return FRAME
    return str(getattr(source, "name", "") or "buffer")


def table_of(source: Any, expected: str) -> Table:
    """Return the content of a source as a table.

    Args:
        source: A path, an object with `read`, or a `pandas.DataFrame`.
        expected: Its expected content, for messages.

    Raises:
        InputError: The source cannot be read, is not a table, or is too large.
    """
    name = source_name(source)
    if _is_frame(source):
        return frame_table(source, name)
    suffix = PurePath(name).suffix.lower()
    if isinstance(source, (str, os.PathLike)):
        size = os.path.getsize(source) if os.path.isfile(source) else 0
        if size > MAX_BYTES:
            raise InputError(
                f"{name}: expected {MAX_BYTES / 1e9:g} GB at most, some twenty million "
                f"rows, got {size / 1e9:.3g} GB; split it"
            )
        data = read_bytes(source, expected)
        if suffix not in (*TEXTS, *FORMATS):
            raise InputError(
                f"{name}: expected a log in one of {', '.join((*TEXTS[1:], *FORMATS))}"
                f", got {suffix}; of a recording the arrival and peak are picked first "
                "(jblast pick)"
            )
    elif callable(getattr(source, "read", None)):
        data = source.read()
        data = data if isinstance(data, str) else bytes(data)
        # a buffer may have no name: its first bytes decide
        if suffix not in FORMATS and not isinstance(data, str):
            sheets = ".ods" if b"opendocument.spreadsheet" in data[:200] else ".xlsx"
            starts = {b"PAR1": ".parquet", b"PK\x03\x04": sheets}
            suffix = starts.get(data[:4], "")
            name = f"{name}{suffix}"
    else:
        wrap = "; io.BytesIO makes a buffer of it" if isinstance(source, bytes) else ""
        raise InputError(
            f"expected a path, an open file or buffer, or a data frame, got "
            f"{type(source).__name__}{wrap}"
        )
    if suffix in FORMATS and not isinstance(data, str):
        return _binary_table(data, name, suffix)
    return text_table(data, name, expected=expected)


def _is_frame(source: Any) -> bool:
    """Return True if a source is a data frame."""
    # by name, as importing pandas takes longer than reading most logs
    kind = type(source)
    return kind.__module__.partition(".")[0] == "pandas" and hasattr(source, "columns")


def _binary_table(data: bytes, source: str, suffix: str) -> Table:
    """Return the one table of a workbook or a Parquet file.

    Raises:
        InputError: It cannot be read, or has several sheets with content.
    """
    kind, package, extra = FORMATS[suffix]
    for module in (package, "pandas"):
        pandas = needed(module, extra, source, f"its format ({kind}) is read")
    with reading(source, f"a complete {kind}"):
        if extra == PARQUET:
            frame = pandas.read_parquet(io.BytesIO(data), engine="pyarrow")
            return frame_table(frame, source, (conversion("format", format=kind),))
        sheets = pandas.read_excel(
            io.BytesIO(data), sheet_name=None, header=None, dtype=object,
            na_filter=False,
        )  # fmt: skip
    filled = {str(k): sheet for k, sheet in sheets.items() if len(sheet)}
    if len(filled) != 1:
        names = ", ".join(map(shown, filled)) or "only empty ones"
        raise InputError(
            f"{source}: expected one sheet with one table, got {names}; keep one sheet"
        )
    ((name, sheet),) = filled.items()
    note = conversion("sheet", format=kind, sheet=name)
    rows = sheet.to_numpy(object).tolist()
    return table_of_rows(source, _text_rows(rows, 1), (note,))


def frame_table(frame: Any, source: str, notes: tuple[Note, ...] = ()) -> Table:
    """Return a data frame as a table; named levels of its index become columns.

    Args:
        frame: A `pandas.DataFrame`.
        source: Its source, for messages.
        notes: Properties of its format.

    Raises:
        InputError: Its columns have several levels.
    """
    if frame.columns.nlevels > 1:
        raise InputError(
            f"{source}: expected columns of one level, got {frame.columns.nlevels}"
        )
    # a named index holds data, as after groupby; an unnamed one is a row number
    if any(name is not None for name in frame.index.names):
        frame = frame.reset_index()
    if LOWER_BOUND in frame.columns:
        bound = frame[LOWER_BOUND].astype(bool)
        value = frame["value"].astype(object)
        # the mark of a lower bound cannot be part of a number
        value = value.where(~bound, ">" + frame["value"].map(cell_text))
        frame = frame.drop(columns=LOWER_BOUND).assign(value=value)
    header = [str(name) for name in frame.columns]
    rows = [header, *frame.astype(object).to_numpy(object).tolist()]
    table = table_of_rows(source, _text_rows(rows, 0), notes)
    table.comments = (*frame.attrs.get("comments", ()), *table.comments)
    return table


def _text_rows(rows: list[list[Any]], first: int) -> list[Row]:
    return [Row(n, list(map(cell_text, row))) for n, row in enumerate(rows, first)]


def cell_text(value: Any) -> str:
    """Return a cell as text: numbers to the last digit, whole ones without a point.

    Missing values are empty; dates are ISO 8601, also those made by a spreadsheet.
    """
    if isinstance(value, (float, np.floating)):
        # the shortest digits: 0.1 in single precision is meant as 0.1
        number = float(str(value))
        if math.isnan(number):
            return ""
        # spreadsheets store 3 as 3.0
        whole = number.is_integer() and abs(number) < EXACT_INTEGERS
        return str(int(number)) if whole else repr(number)
    if isinstance(value, (datetime.date, datetime.time)):
        value = value.isoformat()
    # a line break within a cell is a blank
    text = "" if value is None else " ".join(str(value).splitlines()).strip()
    return "" if text in ("NaT", "<NA>") else text
