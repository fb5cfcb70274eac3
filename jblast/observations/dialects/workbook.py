"""Spreadsheets: .xlsx by openpyxl and .ods by odfpy, through pandas; and Parquet."""

import io
from pathlib import PurePath
from typing import Any

from jblast.errors import InputError, shown
from jblast.observations.dialects.cells import cell_text, table_of_cells
from jblast.observations.dialects.headers_within import refuse_several_headers
from jblast.observations.dialects.table import Table
from jblast.observations.formats import FRAME, WORKBOOKS
from jblast.observations.understood import Dialect

LOWER_BOUND = "lower_bound"
"""Column of a data frame that says whether a value is one: numbers have no sign > ."""
PACKAGES = {"openpyxl": "openpyxl", "odf": "odfpy"}
FORMATS = {"openpyxl": "Excel workbook", "odf": "OpenDocument spreadsheet"}


def workbook_table(data: bytes, source: str) -> Table:
    """Return the one table of a workbook.

    Raises:
        InputError: It cannot be read, or holds several sheets or tables.
    """
    import pandas

    engine: Any = WORKBOOKS[PurePath(source).suffix.lower()]
    try:
        sheets = pandas.read_excel(
            io.BytesIO(data),
            sheet_name=None,
            header=None,
            dtype=object,
            na_filter=False,
            engine=engine,
        )
    except ImportError:
        raise InputError(_absent(source, PACKAGES[engine], "spreadsheet")) from None
    except Exception as error:  # what a damaged archive raises is anybody's guess
        raise InputError(
            f"{source}: expected an {FORMATS[engine]}, got what cannot be read as one "
            f"({type(error).__name__}: {error})"
        ) from None
    filled = {str(k): sheet for k, sheet in sheets.items() if len(sheet)}
    if len(filled) != 1:
        names = ", ".join(map(shown, filled)) or "none that holds anything"
        raise InputError(
            f"{source}: expected one sheet with one table, got {names}; keep one sheet"
        )
    ((name, sheet),) = filled.items()
    found = Dialect(format=FORMATS[engine], sheet=name)
    rows = sheet.to_numpy(object).tolist()
    refuse_several_headers(source, rows)
    table = table_of_cells(source, rows, 1, (found,))
    _refuse_side_by_side(table)
    return table


def parquet_table(data: bytes, source: str) -> Table:
    """Return the table of a Parquet file.

    Raises:
        InputError: It cannot be read.
    """
    import pandas

    try:
        frame = pandas.read_parquet(io.BytesIO(data), engine="pyarrow")
    except ImportError:
        raise InputError(_absent(source, "pyarrow", "parquet")) from None
    except Exception as error:  # as of a damaged archive
        raise InputError(
            f"{source}: expected a Parquet file, got what cannot be read as one "
            f"({type(error).__name__}: {error})"
        ) from None
    return frame_table(frame, source, "Parquet")


def frame_table(frame: Any, source: str = FRAME, format: str = FRAME) -> Table:
    """Return a data frame as a table; levels of its index that have names are columns.

    Args:
        frame: A `pandas.DataFrame`.
        source: Where it comes from.
        format: What it was.

    Raises:
        InputError: Its columns have several levels, or it has no row.
    """
    if frame.columns.nlevels > 1:
        raise InputError(
            f"{source}: expected columns of one level, got {frame.columns.nlevels}"
        )
    comments = tuple(frame.attrs.get("comments", ()))
    if any(name is not None for name in frame.index.names):
        frame = frame.reset_index()
    if LOWER_BOUND in frame.columns:
        bound = frame[LOWER_BOUND].astype(bool)
        value = frame["value"].astype(object)
        value = value.where(~bound, ">" + frame["value"].map(cell_text))
        frame = frame.drop(columns=LOWER_BOUND).assign(value=value)
    header = [str(name) for name in frame.columns]
    rows = [header, *frame.astype(object).to_numpy(object).tolist()]
    found = (Dialect(format=format),) if format != FRAME else ()
    table = table_of_cells(source, rows, 0, found)
    table.comments = (*comments, *table.comments)
    return table


def _refuse_side_by_side(table: Table) -> None:
    """Refuse named columns on both sides of an empty one."""
    empty = [
        not name and not any(column)
        for name, column in zip(table.header, table.columns, strict=True)
    ]
    named = [index for index, name in enumerate(table.header) if name]
    gaps = [i for i, e in enumerate(empty) if e and named and i < named[-1]]
    gaps = [i for i in gaps if i > named[0]]
    if gaps:
        before = max(i for i in named if i < gaps[0])
        after = min(i for i in named if i > gaps[0])
        raise InputError(
            f"{table.at(table.header_line)}: expected one table, got an empty column "
            f"between {shown(table.header[before])} and {shown(table.header[after])}: "
            "two tables side by side? Keep one, or close the gap"
        )


def _absent(source: str, package: str, extra: str) -> str:
    """Say which extra reads a format."""
    return (
        f"{source}: reading it needs {package}, which is not installed: "
        f"pip install 'jblast[{extra}]'"
    )
