"""Tables as text, from a path, a buffer or a data frame.

Text is UTF-8, or UTF-16 with a byte order mark. The separator is the one of comma,
semicolon and tab that splits the header into most known names, unless the first line
states it (`sep=;`, as Excel writes). Spreadsheets are read by pandas (openpyxl, odfpy),
Parquet by pyarrow. Cells become the text that a CSV file would contain, with all digits
of a number, so that all sources are checked by the same rules.

A source contains one table: a workbook with several sheets, a sheet with several
headers and two tables side by side are refused with their positions. So are records of
samples, which are recognised by a growing column of times and no column of a log, and
files of more than 1 GB.
"""

import csv
import datetime
import io
import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

import numpy as np

from jblast.errors import InputError, decoded, read_bytes, shown
from jblast.observations.table import (
    COLUMNS,
    FRAME,
    NEEDED,
    PARQUET,
    TEXTS,
    WORKBOOKS,
    Dialect,
    Faults,
    Understood,
    row_word,
)
from jblast.progress import counted
from jblast.quantities import QUANTITIES
from jblast.units import our_name, spelt, unit_spelt, words_of

EXPECTED = "a CSV file of observations"
MAX_BYTES = 1_000_000_000
"""Largest size of a log: it has some twenty million rows and takes 10 GB of memory."""
BYTE_ORDER_MARKS = {
    b"\xff\xfe": "UTF-16 (little-endian)",
    b"\xfe\xff": "UTF-16 (big-endian)",
}
RECORDINGS = (
    *(".wav", ".flac", ".mseed", ".miniseed", ".sac", ".tdms"),
    *(".h5", ".hdf5", ".nc", ".mat"),
)
"""Suffixes of files of samples."""
SEPARATORS = {",": "", ";": "semicolon", "\t": "tab"}
"""Separators of fields and their names; the comma is the default."""
PROGRESS_LINES = 50_000
"""Lines between two reports of progress, a fraction of a second apart."""
WITHIN = f"a header {','.join(NEEDED)} and one measurement a row"
"""Content of a log, for messages."""
SEPARATOR_LINE = re.compile(r"sep=(.)$", re.IGNORECASE)
"""First line in which Excel states the separator."""
LOWER_BOUND = "lower_bound"
"""Column of a data frame for lower bounds, as numbers cannot have the mark >."""
PACKAGES = {"openpyxl": "openpyxl", "odf": "odfpy"}
FORMATS = {"openpyxl": "Excel workbook", "odf": "OpenDocument spreadsheet"}
EXACT_INTEGERS = 2.0**53
"""Bound below which whole numbers are exact in double precision."""
LEAST_NAMES = 3
"""Smallest number of known names in a header: a row of a log has at most two words that
are names, its sensor and its quantity."""
MAX_NAMES_SHOWN = 4
"""Largest number of names of a header in a message."""
LOG_COLUMNS = ("sensor", "quantity", "value", "value_utc")
"""Columns that a record of samples does not have."""
MAX_TESTED_ROWS = 1000
"""Number of rows in which times must grow for a record of samples: a log of that many
rows sorted by time has other columns."""
MIN_SAMPLES = 3
"""Smallest number of rows of a record of samples: two rows of a log may be sorted by
chance."""


def source_name(source: Any) -> str:
    """Return the name of a source in messages."""
    if isinstance(source, (str, os.PathLike)):
        return str(source)
    if _is_frame(source):
        return FRAME
    name = getattr(source, "name", None)
    return name if isinstance(name, str) and name else "buffer"


@dataclass
class Table:
    """A header, and columns of fields.

    Attributes:
        source: The file, or another source.
        header: Names of columns as written, without outer blanks.
        columns: Fields by column and row as written, without outer blanks.
        lines: Line of each row.
        header_line: Line of the header.
        comments: Comments, without their #.
        understood: Properties of the format.
        blank_before: Lines of rows after an empty one.
    """

    source: str
    header: list[str]
    columns: list[list[str]]
    lines: Sequence[int]
    header_line: int
    comments: tuple[str, ...] = ()
    understood: tuple[Understood, ...] = ()
    blank_before: frozenset[int] = field(default_factory=frozenset)

    def at(self, line: int) -> str:
        """Return the source and a line of it, for a message."""
        return f"{self.source}: {row_word(self.source)} {line}"

    def drop_rows(self, dropped: set[int]) -> None:
        """Remove rows, by number from zero."""
        if dropped:
            kept = [row for row in range(len(self.lines)) if row not in dropped]
            self.columns = [[column[row] for row in kept] for column in self.columns]
            self.lines = [self.lines[row] for row in kept]

    def drop_columns(self, dropped: set[int]) -> None:
        """Remove columns, by number from zero."""
        kept = [index for index in range(len(self.header)) if index not in dropped]
        self.header = [self.header[index] for index in kept]
        self.columns = [self.columns[index] for index in kept]


def table_of(
    source: Any,
    faults: Faults,
    *,
    expected: str = EXPECTED,
    within: str = WITHIN,
) -> Table:
    """Return the content of a source as a table.

    Args:
        source: A path, an object with `read`, or a `pandas.DataFrame`.
        faults: Collects faults that leave the rest readable.
        expected: The expected kind of file, for messages.
        within: Its expected content, for messages.

    Raises:
        InputError: The source cannot be read, is not a table, or is too large.
    """
    name = source_name(source)
    if _is_frame(source):
        return frame_table(source)
    data = _data(source, name, expected)
    suffix = PurePath(name).suffix.lower()
    if isinstance(source, (str, os.PathLike)):
        if suffix in RECORDINGS:
            raise InputError(
                f"{name}: is a recording, not a log; pick its arrival and peak first "
                "(jblast pick)"
            )
        if suffix not in (*TEXTS, *WORKBOOKS, *PARQUET):
            endings = ", ".join((*TEXTS[1:], *WORKBOOKS, *PARQUET))
            raise InputError(
                f"{name}: expected a log in one of {endings}, got {suffix}"
            )
    # a buffer may have no name: its first bytes decide
    elif isinstance(data, bytes):
        suffix = suffix if suffix in (*WORKBOOKS, *PARQUET) else _looks_like(data)
        name = name if PurePath(name).suffix.lower() == suffix else f"{name}{suffix}"
    if isinstance(data, bytes):
        if suffix in WORKBOOKS:
            return workbook_table(data, name)
        if suffix in PARQUET:
            return parquet_table(data, name)
    encoding = ""
    if isinstance(data, bytes):
        encoding = BYTE_ORDER_MARKS.get(data[:2], "")
        data = decoded(data, name, expected, utf16=True)
    return text_table(data, name, faults, encoding=encoding, within=within)


def _data(source: Any, name: str, expected: str) -> bytes | str:
    """Return the content of a path or a buffer."""
    if isinstance(source, (str, os.PathLike)):
        try:
            size = os.path.getsize(source)
        except (OSError, ValueError):
            # the error is reported where it is opened
            size = 0
        if size > MAX_BYTES:
            raise InputError(
                f"{name}: expected a log of {MAX_BYTES / 1e9:g} GB at most, some "
                f"twenty million rows, got {size / 1e9:.3g} GB; split it, or pick the "
                "arrivals of samples of a recording (jblast pick)"
            )
        return read_bytes(source, expected)
    if not callable(getattr(source, "read", None)):
        wrap = "; io.BytesIO makes a buffer of it" if isinstance(source, bytes) else ""
        raise InputError(
            f"expected a path, an open file or buffer, or a data frame, got "
            f"{type(source).__name__}{wrap}"
        )
    data = source.read()
    # as a text file opened with newline="" still holds them
    if isinstance(data, str):
        return data.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    return bytes(data)


def _looks_like(data: bytes) -> str:
    """Return the suffix of the format by the first bytes; "" for text."""
    if data.startswith(b"PAR1"):
        return ".parquet"
    if data.startswith(b"PK\x03\x04"):
        return ".ods" if b"opendocument.spreadsheet" in data[:200] else ".xlsx"
    return ""


def _is_frame(source: Any) -> bool:
    """Return True if a source is a data frame."""
    # by name, as importing pandas takes longer than reading most logs
    kind = type(source)
    return kind.__module__.partition(".")[0] == "pandas" and hasattr(source, "columns")


def text_table(
    text: str,
    source: str,
    faults: Faults,
    *,
    encoding: str = "",
    within: str = WITHIN,
) -> Table:
    r"""Return text as a table.

    Args:
        text: Lines that end in `\n`.
        source: Its source, for messages.
        faults: Collects lines that are too short or too long.
        encoding: Encoding of the text, if not UTF-8.
        within: Its expected content, for messages.

    Raises:
        InputError: There is no header or no row below, or a quote is not closed.
    """
    comments, lines, numbers, named = [], [], [], ""
    for number, line in enumerate(text.split("\n"), start=1):
        stripped = line.strip()
        if stripped.startswith("#"):
            comments.append(stripped[1:].strip())
        elif stripped:
            lines.append(line)
            numbers.append(number)
    if lines and (match := SEPARATOR_LINE.match(lines[0].strip(" "))):
        named = match[1]
        del lines[0], numbers[0]
    if not lines:
        raise InputError(f"{source}: line 1: the file is empty; expected {within}")
    separator = named or separator_of(lines[0])
    if separator not in lines[0]:
        _refuse_other_separator(f"{source}: line {numbers[0]}", lines[0])
    records = _records(source, lines, numbers, separator, faults)
    header = [name.strip() for name in records[0]]
    if len(header) == 1:
        raise InputError(
            f"{source}: line {numbers[0]}: expected columns separated by commas, "
            f"semicolons or tabs, got one column {shown(header[0])}"
        )
    columns = [[field.strip() for field in column] for column in zip(*records[1:])]  # noqa: B905 (checked widths)
    found = Dialect(separator=SEPARATORS.get(separator, separator), encoding=encoding)
    return Table(
        source=source,
        header=header,
        columns=columns or [[] for _ in header],
        lines=numbers[1:],
        header_line=numbers[0],
        comments=tuple(comments),
        understood=() if found == Dialect() else (found,),
    )


def separator_of(header: str) -> str:
    """Return the separator of a header that gives most known names.

    Among equals it is the one that occurs most often, then the comma.
    """

    def known(separator: str) -> int:
        try:
            (names,) = csv.reader([header], delimiter=separator, skipinitialspace=True)
        except (csv.Error, ValueError):
            return 0
        return sum(
            spelt(name) in COLUMNS or our_name(name) is not None
            for name in names
            if len(names) > 1
        )

    # semicolons with decimal commas contain commas, too: known names decide first
    return max(SEPARATORS, key=lambda mark: (known(mark), header.count(mark)))


def _records(
    source: str,
    lines: Sequence[str],
    numbers: list[int],
    separator: str,
    faults: Faults,
) -> list[list[str]]:
    """Split lines into fields; each line is one record, as wide as the header."""
    # strict: a stray quote is an error, not a part of a field
    reader = csv.reader(lines, delimiter=separator, skipinitialspace=True, strict=True)
    records: list[list[str]] = []
    through = counted(len(lines), "lines")
    try:
        for record in reader:
            records.append(record)
            # a quote across lines would swallow rows, and line numbers would be wrong
            if reader.line_num != len(records):
                break
            if not len(records) % PROGRESS_LINES:
                through(len(records))
    except csv.Error as error:
        between = SEPARATORS.get(separator) or "comma"
        raise InputError(
            f"{source}: line {numbers[len(records)]}: expected {between}-separated "
            f"fields, got a stray or unclosed quote ({error})"
        ) from None
    if reader.line_num != len(records):
        raise InputError(
            f"{source}: line {numbers[len(records) - 1]}: expected one measurement a "
            "line, got a quote that is not closed on it"
        )
    width = len(records[0])
    uneven = [row for row, record in enumerate(records) if len(record) != width]
    for row in uneven:
        got = len(records[row])
        faults.add(
            InputError(
                f"{source}: line {numbers[row]}: expected {width} fields as in the "
                f"header, got {got}"
                + ("; is a decimal comma among them?" if got > width else "")
            )
        )
    # from the end, so that earlier indices stay valid
    for row in reversed(uneven):
        del records[row], numbers[row]
    return records


def _refuse_other_separator(where: str, header: str) -> None:
    """Refuse a header of one name that contains another separator."""
    for separator, name in ((";", "semicolons"), ("\t", "tabs")):
        if separator in header:
            raise InputError(
                f"{where}: expected columns separated by commas, got {name}; save the "
                "file with commas (and decimal points)"
            )


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
    except Exception as error:  # a damaged archive may raise any
        raise InputError(
            f"{source}: expected an {FORMATS[engine]}, got a file that cannot be read "
            f"as one ({type(error).__name__}: {error})"
        ) from None
    filled = {str(k): sheet for k, sheet in sheets.items() if len(sheet)}
    if len(filled) != 1:
        names = ", ".join(map(shown, filled)) or "only empty ones"
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
            f"{source}: expected a Parquet file, got a file that cannot be read as "
            f"one ({type(error).__name__}: {error})"
        ) from None
    return frame_table(frame, source, "Parquet")


def frame_table(frame: Any, source: str = FRAME, format: str = FRAME) -> Table:
    """Return a data frame as a table; named levels of its index become columns.

    Args:
        frame: A `pandas.DataFrame`.
        source: Its source, for messages.
        format: Its original format.

    Raises:
        InputError: Its columns have several levels, or it has no row.
    """
    if frame.columns.nlevels > 1:
        raise InputError(
            f"{source}: expected columns of one level, got {frame.columns.nlevels}"
        )
    comments = tuple(frame.attrs.get("comments", ()))
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
            "are these two tables? Keep one, or remove the empty column"
        )


def _absent(source: str, package: str, extra: str) -> str:
    """Return the message for a format whose extra is not installed."""
    return (
        f"{source}: reading it needs {package}, which is not installed: "
        f"pip install 'jblast[{extra}]'"
    )


def cell_text(value: Any) -> str:
    """Return a cell as text: numbers to the last digit, whole ones without a point.

    Missing values are empty; dates are ISO 8601, also those made by a spreadsheet.
    """
    # a line break within a cell is a blank
    if isinstance(value, str):
        return value.strip() if value.isprintable() else " ".join(value.split())
    if value is None:
        return ""
    if isinstance(value, (bool, np.bool_)):
        return str(bool(value))
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        number = float(value)
        if math.isnan(number):
            return ""
        if isinstance(value, np.floating) and value.dtype.itemsize < 8:
            # 0.1 in single precision is meant as 0.1
            return repr(float(str(value)))
        # spreadsheets store 3 as 3.0
        whole = number.is_integer() and abs(number) < EXACT_INTEGERS
        return str(int(number)) if whole else repr(number)
    if isinstance(value, (datetime.date, datetime.time)):
        # NaT is unlike itself
        return "" if value != value else value.isoformat()
    text = str(value).strip()
    return "" if text in ("NaT", "<NA>") else text


def table_of_cells(
    source: str,
    rows: Sequence[Sequence[Any]],
    first_line: int,
    understood: tuple[Understood, ...],
) -> Table:
    """Return rows of cells as a table: comments, a header, rows below it.

    Args:
        source: Their source, for messages.
        rows: Cells by row and column.
        first_line: Number of the first row.
        understood: Properties of the format.

    Raises:
        InputError: There is no row.
    """
    comments: list[str] = []
    texts: list[list[str]] = []
    lines: list[int] = []
    after_blank: set[int] = set()
    blank = False
    for line, cells in enumerate(rows, start=first_line):
        row = [cell_text(cell) for cell in cells]
        filled = [text for text in row if text]
        if not filled:
            blank = True
            continue
        if filled[0].startswith("#") and len(filled) == 1:
            comments.append(filled[0][1:].strip())
            continue
        # rows after a blank one may begin a second table (`dialects`)
        if blank and texts:
            after_blank.add(line)
        blank = False
        texts.append(row)
        lines.append(line)
    if not texts:
        raise InputError(
            f"{source}: is empty; expected a header and one measurement a row"
        )
    return Table(
        source=source,
        header=texts[0],
        columns=[list(column) for column in zip(*texts[1:], strict=True)]
        or [[] for _ in texts[0]],
        lines=lines[1:],
        header_line=lines[0],
        comments=tuple(comments),
        understood=understood,
        blank_before=frozenset(after_blank),
    )


@dataclass(frozen=True)
class HeaderCells:
    """A header in a sheet.

    Attributes:
        row: Its row, from 1.
        column: Its first column, from 0.
        names: Its cells, up to the next empty one.
    """

    row: int
    column: int
    names: tuple[str, ...]

    def __str__(self) -> str:
        last = self.column + len(self.names) - 1
        first = ", ".join(map(shown, self.names[:MAX_NAMES_SHOWN]))
        more = ", ..." if len(self.names) > MAX_NAMES_SHOWN else ""
        place = f"{_letters(self.column)}{self.row}:{_letters(last)}{self.row}"
        return f"{place} ({first}{more})"


def refuse_several_headers(source: str, rows: Sequence[Sequence[Any]]) -> None:
    """Refuse a sheet with several headers of a log, or with a title above one.

    Args:
        source: Source of the sheet, for messages.
        rows: Its cells.

    Raises:
        InputError: There are several tables, below or next to one another, or cells
            other than comments above the header.
    """
    found: list[HeaderCells] = []
    for number, row in enumerate(rows, start=1):
        if sum(isinstance(cell, str) and bool(cell) for cell in row) < LEAST_NAMES:
            continue
        for column, names in _runs(row):
            if sum(map(_is_ours, names)) >= LEAST_NAMES:
                found.append(HeaderCells(number, column, names))
    if len(found) > 1:
        places = " and ".join(str(one) for one in found[:2])
        more = f" and {len(found) - 2} more" if len(found) > 2 else ""
        count = "two" if len(found) == 2 else str(len(found))
        raise InputError(
            f"{source}: row {found[1].row}: expected one table, got {count}: headers "
            f"are in {places}{more}; keep one table per file"
        )
    for number, row in enumerate(rows[: found[0].row - 1] if found else (), start=1):
        filled = [cell for cell in row if isinstance(cell, str) and cell.strip()]
        if filled and not filled[0].lstrip().startswith("#"):
            raise InputError(
                f"{source}: row {number}: expected the header, got {shown(filled[0])}, "
                f"and the header in {found[0]}; begin the rows above it with #, or "
                "remove them"
            )


def _runs(row: Sequence[Any]) -> list[tuple[int, tuple[str, ...]]]:
    """Return runs of adjacent words without repetition, and their first columns."""
    runs: list[tuple[int, tuple[str, ...]]] = []
    begin, names = 0, []
    for column, cell in enumerate((*row, None)):
        word = cell.strip() if isinstance(cell, str) else ""
        # a repeated name begins another header in the same row
        if not word or spelt(word) in map(spelt, names):
            if names:
                runs.append((begin, tuple(names)))
            names = []
        if word:
            begin = begin if names else column
            names.append(word)
    return runs


def _is_ours(word: str) -> bool:
    """Return True if a word names a column or a quantity."""
    ours = our_name(word)
    name = spelt(word) if ours is None else ours.name
    return name in COLUMNS or name in QUANTITIES


def _letters(column: int) -> str:
    """Return the letters of a column in a sheet."""
    # bijective base 26: there is no digit zero, so each digit counts from 1
    letters, left = "", column + 1
    while left:
        left, digit = divmod(left - 1, 26)
        letters = chr(ord("A") + digit) + letters
    return letters


def refuse_series(table: Table) -> None:
    """Refuse samples: a growing column of times, and no column of a log.

    Raises:
        InputError: The table is a record of samples.
    """
    keys = [spelt(name) for name in table.header]
    if any(name in keys for name in LOG_COLUMNS) or len(keys) < 2:
        return
    timed = [i for i, name in enumerate(table.header) if _is_time(name)]
    headless = all(_is_number(name) for name in table.header)
    if not timed and not headless:
        return
    try:
        texts = table.columns[timed[0] if timed else 0][:MAX_TESTED_ROWS]
        times = np.array([float(text.replace(",", ".")) for text in texts])
    except ValueError:
        return
    if len(times) >= MIN_SAMPLES and np.all(times[1:] > times[:-1]):
        raise InputError(
            f"{table.at(table.header_line)}: got {', '.join(table.header[:4])} over "
            f"{len(table.lines):,} growing times: a record of samples, not a log of "
            "measurements; pick its arrival and peak first (jblast pick)"
        )


def _is_time(name: str) -> bool:
    """Return True if a column's name is a time, with or without a unit."""
    words = [word.lower() for word in words_of(name)]
    if not words or words[0] not in ("time", "t", "zeit"):
        return False
    rest = words[1:]
    return not rest or any(
        unit.dimension == "time" for unit in unit_spelt("_".join(rest))
    )


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True
