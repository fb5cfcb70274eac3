r"""Text as one table: encoding, comments, separator, header, units and decimal mark.

All text with a header is read here: logs, stations, covariances, samples of recorders
and trajectories. Text is UTF-8, UTF-16 with a byte order mark, or else Windows-1252,
which is noted. Lines that begin with # are comments. The separator is the one of comma,
semicolon and tab that splits the header into most names, unless the first line states
it (`sep=;`, as Excel writes).

A row of units stands below or above the names, or is the last row. A row of titles
above the names, as of merged cells in a spreadsheet, has blanks that the names fill.

0,05 has a decimal comma and 0.05 a decimal point. 1,234 may be 1.234 or 1234, and is
read only if another number of the file shows which mark separates decimals. Marks
between thousands are refused.

With `preamble=True` a table consists of numbers. It begins at the first run of rows
with numbers in the same columns, and its names are in the last line above that has one
for each of them, or in such a comment, as `numpy.savetxt` writes it. The lines above,
and text to the left of the first numbers, are the preamble of a logger or an
oscilloscope. Columns may then be separated by blanks, too.
"""

import csv
import io
import math
import re
from array import array
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, decoded, foreign_digits, shown
from jblast.observations.table import row_word
from jblast.results import Note, conversion
from jblast.units import spelt, unit_spelt, words_of

SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
"""Separators of fields and their names; the first of equals is used."""
SEPARATOR_LINE = re.compile(r"sep=(.)$", re.IGNORECASE)
"""First line in which Excel states the separator."""
NA_WORDS = frozenset(
    {"", "na", "n/a", "nan", "-", "--", "null", "none", "empty", "#n/a", "n.a."}
)
"""Entries of cells without a measurement, in lower case."""
NO_UNIT = NA_WORDS | {"unit", "units", "1", "name", "text"}
"""Entries in a row of units for columns without a unit."""
COUNTS = ("sequence", "index", "sample", "number", "n", "no", "nr", "point")
"""Entries in a row of units for a column that numbers its rows."""
TIME_WORDS = ("time", "t", "x", "elapsed", "zeit")
"""First words of columns of times."""
BRACKETS = "[](){} "
FORMS = {
    # with possible thousands separators
    **{f"{mark}?": rf"[+-]?[1-9]\d{{0,2}}{re.escape(mark)}\d{{3}}" for mark in ",."},
    **{mark: rf"[+-]?\d*{re.escape(mark)}\d*(?:[eE][+-]?\d+)?" for mark in ",."},
    "grouped": r"[-+\d.,]+",
}
"""Forms of numbers with marks: 1,234 may be 1.234 or 1234, 1,5 is one number, and marks
in 12.345.678 or 1.234,5 are between thousands."""
MINUS = "\u2212"
"""The typographic minus sign, which some spreadsheets write."""
INFINITY = "\N{INFINITY}"
"""Sign of oscilloscopes for a sample beyond the range."""
MAX_PREAMBLE = 200
"""Largest number of lines before numbers: headers of oscilloscopes have tens."""
RUN_ROWS = 5
"""Rows with numbers in the same columns that begin a table: a preamble has pairs of
such rows (ranges, offsets), hardly five."""


class Row(NamedTuple):
    """A line of a preamble.

    Attributes:
        line: Its number.
        cells: Its fields.
        is_comment: Whether it begins with #, which is removed.
    """

    line: int
    cells: list[str]
    is_comment: bool = False


@dataclass
class Table:
    """A header, and columns of fields.

    Attributes:
        source: The file, or another source.
        header: Names of columns as written; empty if a table of numbers has none.
        columns: Fields by column and row as written; none for a table of numbers,
            which `numbers` reads.
        lines: Line of each row; of a table of numbers after `numbers` was called.
        header_line: Line of the header.
        units: Units of the columns from a row of units, "" without.
        units_line: Line of that row; 0 without.
        comments: Comments, without their #.
        notes: Properties of the format, and conversions.
        faults: Faults that leave the rest readable.
        is_wide: Whether it was wide, with a column for each quantity.
        preamble: Lines above a table of numbers, and fields left of it.
        numeric: Columns with numbers of such a table.
        first_line: Line of its first row.
        separator: Separator of its fields; None for blanks.
        decimal: Its decimal mark.
        text: Its text.
    """

    source: str
    header: list[str]
    columns: list[list[str]] = field(default_factory=list)
    lines: Sequence[int] = ()
    header_line: int = 1
    units: list[str] = field(default_factory=list)
    units_line: int = 0
    comments: tuple[str, ...] = ()
    notes: list[Note] = field(default_factory=list)
    faults: list[InputError] = field(default_factory=list)
    is_wide: bool = False
    preamble: tuple[Row, ...] = ()
    numeric: tuple[int, ...] = ()
    first_line: int = 0
    separator: str | None = ","
    decimal: str = "."
    text: str = ""

    def at(self, line: int, column: str = "") -> str:
        """Return the source, a line of it, and perhaps a column, for a message."""
        of = f", column {column}" if column else ""
        return f"{self.source}: {row_word(self.source)} {line}{of}"

    def drop_rows(self, dropped: Collection[int]) -> None:
        """Remove rows, by number from zero."""
        kept = [row for row in range(len(self.lines)) if row not in dropped]
        self.columns = [[column[row] for row in kept] for column in self.columns]
        self.lines = [self.lines[row] for row in kept]

    def names(self, expected: str) -> list[str]:
        """Return the header of a table of numbers.

        Args:
            expected: Example of a header, for the message.

        Raises:
            InputError: It has none, or not one for each column.
        """
        if self.header:
            return self.header
        first = next(cells_of(text, self.separator) for _, text in self._rows())
        lines = [row for row in self.preamble if any(map(has_letters, row.cells))]
        above = lines[-1] if lines else Row(self.first_line, first)
        raise InputError(
            f"{self.at(above.line)}: expected names of columns, one for each of "
            f"{len(first)}, as {expected}, got {shown(' '.join(above.cells))}"
        )

    def numbers(
        self, wanted: Sequence[int], *, finite: bool = True
    ) -> Float[np.ndarray, "column row"]:
        """Return columns of a table of numbers.

        Args:
            wanted: Columns.
            finite: Whether infinite numbers are refused, too.

        Raises:
            InputError: A cell is not a number; the message names the first.
        """
        # an array of integers: a list of them takes four times the memory
        lines = array("q")

        def rows() -> Iterator[str]:
            for number, line in self._rows():
                lines.append(number)
                if not line.isascii():
                    line = line.replace(INFINITY, "inf").replace(MINUS, "-")
                yield line.replace(",", ".") if self.decimal == "," else line

        with suppress(ValueError):
            # NumPy's parser is much faster than float of each field
            numbers = np.loadtxt(
                rows(), delimiter=self.separator, comments=None, quotechar='"',
                usecols=wanted, ndmin=2,
            ).T  # fmt: skip
            if np.isfinite(numbers).all() or not (finite or np.isnan(numbers).any()):
                self.lines = lines
                return np.ascontiguousarray(numbers)
        raise self._bad_cell(wanted, finite=finite)

    def _bad_cell(self, wanted: Sequence[int], *, finite: bool) -> InputError:
        """Return the error that names the first cell without a number."""
        header = [*self.header, *[""] * (1 + max(wanted) - len(self.header))]
        for line, text in self._rows():
            cells = cells_of(text, self.separator)
            if len(cells) <= max(wanted):
                return InputError(
                    f"{self.at(line)}: expected {len(header)} fields as in the header, "
                    f"got {len(cells)}"
                )
            for column in wanted:
                number = number_of(cells[column], self.decimal)
                if math.isnan(number) or (finite and math.isinf(number)):
                    got = shown(cells[column]) if cells[column] else "nothing"
                    where = self.at(line, header[column])
                    return InputError(f"{where}: expected a number, got {got}")
        return InputError(f"{self.at(self.first_line)}: expected numbers")

    def _rows(self) -> Iterator[tuple[int, str]]:
        rows = numbered(self.text)
        return ((n, x) for n, x in rows if n >= self.first_line and not is_comment(x))


def text_table(
    data: bytes | str,
    name: str,
    *,
    preamble: bool = False,
    expected: str = "a table with a header",
) -> Table:
    """Return text as a table.

    Args:
        data: Content of a file, or text.
        name: Its name, for messages.
        preamble: True for a table of numbers, perhaps below other lines.
        expected: Its expected content, for messages.

    Raises:
        InputError: It is not text, has no header, or a quote is not closed.
    """
    text, notes = decoded_text(data, name, expected)
    if preamble:
        return _numeric_table(text, name, notes, expected)
    lines = list(numbered(text))
    remarks = [line.strip()[1:].strip() for _, line in lines if is_comment(line)]
    lines = [(number, line) for number, line in lines if not is_comment(line)]
    stated = SEPARATOR_LINE.match(lines[0][1].strip()) if lines else None
    if stated:
        del lines[0]
    if not lines:
        raise InputError(f"{name}: line 1: the file is empty; expected {expected}")
    # separators within quotes are none
    bare = re.sub(r'"[^"]*"', "", lines[0][1])
    separator = stated[1] if stated else max(SEPARATORS, key=bare.count)
    options: dict[str, Any] = {"delimiter": separator, "skipinitialspace": True}
    rows: list[Row] = []
    faults: list[InputError] = []
    for line, written in lines:
        try:
            # strict: a stray quote is an error, not a part of a field; line by line, as
            # a quote across lines would swallow rows
            (cells,) = csv.reader([written], strict=True, **options)
        except csv.Error as error:
            raise InputError(
                f"{name}: line {line}: expected fields separated by "
                f"{SEPARATORS.get(separator, separator)}, got a stray or unclosed "
                f"quote ({error})"
            ) from None
        width = len(rows[0].cells) if rows else len(cells)
        if width == 1:
            raise InputError(
                f"{name}: line {line}: expected columns separated by commas, "
                f"semicolons or tabs, got one column {shown(cells[0])}"
            )
        if len(cells) == width:
            rows.append(Row(line, [cell.strip() for cell in cells]))
            continue
        why = "; is a decimal comma among them?" if len(cells) > width else ""
        faults.append(
            InputError(
                f"{name}: line {line}: expected {width} fields as in the header, got "
                f"{len(cells)}{why}"
            )
        )
    if separator != ",":
        by = SEPARATORS.get(separator, repr(separator))
        notes.append(conversion("separator", separator=by))
    table = table_of_rows(name, rows, notes)
    table.separator, table.comments = separator, (*remarks, *table.comments)
    table.faults += faults
    return table


def decoded_text(data: bytes | str, name: str, expected: str) -> tuple[str, list[Note]]:
    r"""Return text with line ends `\n`, and a note on an encoding other than UTF-8.

    Raises:
        InputError: It is not text.
    """
    encodings = ("", "Windows-1252")
    if isinstance(data, str):
        data, encodings = data.encode("utf-8", "surrogatepass"), ()
    elif data.startswith((b"\xff\xfe", b"\xfe\xff")):
        encodings = ("UTF-16",)
    for encoding in encodings:
        # bytes without a meaning in any are refused as no UTF-8
        with suppress(UnicodeDecodeError):
            data = data.decode(encoding or "utf-8").encode()
            notes = [conversion("encoding", encoding=encoding)] if encoding else []
            return decoded(data, name, expected), notes
    return decoded(data, name, expected), []


def numbered(text: str) -> Iterator[tuple[int, str]]:
    """Yield the lines that are not blank, numbered from 1."""
    for number, line in enumerate(io.StringIO(text), start=1):
        if line.strip():
            yield number, line.rstrip("\n")


def is_comment(line: str) -> bool:
    """Return True for a comment."""
    return line.lstrip().startswith("#")


def table_of_rows(
    source: str, rows: Sequence[Row], notes: Sequence[Note] = ()
) -> Table:
    """Return rows of equal width as a table, without blank rows and columns.

    Args:
        source: Their source, for messages.
        rows: A header, perhaps below a row of titles, and rows below it.
        notes: Properties of the format.

    Raises:
        InputError: There is no row.
    """
    comments: list[str] = []
    filled: list[Row] = []
    for row in rows:
        texts = [cell for cell in row.cells if cell]
        if len(texts) == 1 and texts[0].startswith("#"):
            comments.append(texts[0][1:].strip())
        elif texts:
            filled.append(row)
    if not filled:
        raise InputError(f"{source}: is empty; expected a header and rows below it")
    names, word = filled.pop(0), row_word(source)
    table = Table(source, names.cells, header_line=names.line, notes=list(notes))
    table.comments = tuple(comments)
    # titles of merged cells leave blanks, which names below them fill
    while filled:
        below = filled[0].cells
        blank = [
            cell
            for at, (name, cell) in enumerate(zip(table.header, below, strict=True))
            if not name and any(row.cells[at] for row in filled)
        ]
        if not (blank and all(blank) and all(map(is_text, filter(None, below)))):
            break
        lines = {"first": table.header_line, "line": filled.pop(0).line}
        table.notes.append(conversion("titles", word=word, **lines))
        table.header = [n or t for n, t in zip(below, table.header, strict=True)]
        table.header_line = lines["line"]
    kept = [
        at
        for at, name in enumerate(table.header)
        if name or any(row.cells[at] for row in filled)
    ]
    table.header = [table.header[at] for at in kept]
    table.columns = [[row.cells[at] for row in filled] for at in kept]
    table.lines = [row.line for row in filled]
    table.units = [""] * len(kept)
    # pandas writes a row of units first, some loggers last
    for at in dict.fromkeys((0, len(table.lines) - 1)) if table.lines else ():
        cells = [column[at].strip(BRACKETS) for column in table.columns]
        if is_units_row(cells, only_known=True):
            table.units = [unit if unit_spelt(unit) else "" for unit in cells]
            table.units_line = table.lines[at]
            note = conversion("units_row", word=word, line=table.units_line)
            table.notes.append(note)
            table.drop_rows({at})
            break
    return table


def is_units_row(cells: Sequence[str], *, only_known: bool = False) -> bool:
    """Return True for a row of units, of which at least one is known.

    Args:
        cells: Its fields without brackets.
        only_known: Whether all others must state that there is no unit; else they may
            be unknown units, but no names with a unit and no numbers.
    """
    known = [bool(unit_spelt(cell)) for cell in cells]
    if only_known:
        others = (cell.lower() in NO_UNIT for cell in cells)
    else:
        others = (cell.lower() in COUNTS or not _is_named(cell) for cell in cells)
    return any(known) and all(k or o for k, o in zip(known, others, strict=True))


def _is_named(cell: str) -> bool:
    """Return True for a number, a time, or a name that ends in a unit."""
    words = words_of(cell)
    return not is_text(cell) or spelt(cell) in TIME_WORDS or (
        len(words) > 1 and any(unit_spelt(" ".join(words[n:])) for n in (-2, -1))
    )  # fmt: skip


def _numeric_table(text: str, name: str, notes: list[Note], expected: str) -> Table:
    """Return a table of numbers, whose cells are not read yet."""
    lines = list(islice(numbered(text), MAX_PREAMBLE + RUN_ROWS))
    rows = [(number, line) for number, line in lines if not is_comment(line)]
    found = _run(rows, 2) or _run(rows, 1)
    if found is None:
        got = "no numbers" if rows else "an empty file"
        raise InputError(f"{name}: line 1: expected {expected}, got {got}")
    separator, at, columns = found
    first = rows[at][0]
    table = Table(name, [], header_line=first, notes=notes, numeric=columns)
    table.first_line, table.separator, table.text = first, separator, text
    # text of comments may be names, or keys and values, as of other lines
    table.preamble = tuple(
        Row(n, cells_of(line.lstrip("# \t"), separator), is_comment(line))
        for n, line in sorted(lines)
        if n < first
    )
    samples = [cells_of(line, separator) for _, line in rows[at:]]
    width = len(_trimmed(samples[0]))
    _take_names(table, width)
    if columns[0]:
        left = (Row(rows[at + n][0], c[: columns[0]]) for n, c in enumerate(samples))
        table.preamble += tuple(row for row in left if any(row.cells))
    # between commas there is no decimal comma
    held = "".join(c for row in samples for at, c in enumerate(row) if at in columns)
    marks = [mark for mark in ",." if separator != "," and mark in held]
    if len(marks) > 1:
        raise InputError(
            f"{table.at(first)}: expected a decimal point or a decimal comma, got both"
        )
    table.decimal = "," if "," in marks else "."
    return table


def _take_names(table: Table, width: int) -> None:
    """Set names and units of a table of numbers from the lines above it.

    Args:
        table: The table, with its preamble.
        width: Number of fields of its first row.
    """
    lines = [row for row in table.preamble if any(map(has_letters, row.cells))]
    # comments hold names only without other lines
    near = [row for row in lines if not row.is_comment][-2:] or lines[-1:]
    for row in near[::-1]:
        cells = [*row.cells, *[""] * (width - len(row.cells))]
        bare = [cell.strip(BRACKETS) for cell in cells[:width]]
        # above the names it may be an entry of a preamble: Vertical Units,V
        above = bool(table.header)
        if len(near) > 1 and is_units_row(bare, only_known=above):
            table.units, table.units_line = bare, row.line
        elif (
            not above
            and len(_trimmed(row.cells)) >= width
            and all(map(is_text, filter(None, bare)))
        ):
            table.header, table.header_line = cells, row.line
    table.units += [""] * (max(width, len(table.header)) - len(table.units))


def _run(
    rows: Sequence[tuple[int, str]], least: int
) -> tuple[str | None, int, tuple[int, ...]] | None:
    """Return separator, first row and columns of the first run of numbers.

    Args:
        rows: Lines with their numbers.
        least: Number of columns: of one column all later rows have numbers.
    """
    found = []
    for order, separator in enumerate((";", "\t", ",", None)):
        cells = [cells_of(line, separator) for _, line in rows]
        mark = "." if separator == "," else ","
        numeric = [
            frozenset(c for c, cell in enumerate(row) if not is_text(cell, mark))
            for row in cells
        ]
        for at in range(len(rows)):
            ahead = numeric[at : at + RUN_ROWS] if least > 1 else numeric[at:]
            columns = frozenset.intersection(*ahead)
            if len(columns) < least:
                continue
            # a faulty cell does not move the first row: it is reported later
            while at and _continues(cells[at - 1], cells[at], numeric[at - 1], columns):
                at -= 1
            # the right separator leaves the fewest fields of text
            others = sum(bool(cell) and is_text(cell, mark) for cell in cells[at])
            fewest = (at, others, -len(cells[at]), order)
            found.append((fewest, separator, tuple(sorted(columns))))
            break
    if not found:
        return None
    fewest, separator, columns = min(found, key=lambda one: one[0])
    return separator, fewest[0], columns


def _continues(
    above: list[str], row: list[str], numeric: frozenset[int], columns: frozenset[int]
) -> bool:
    """Return True if the row above a row of numbers has numbers and no words there."""
    some = columns & numeric
    words = any(has_letters(above[c]) for c in columns - some if c < len(above))
    return bool(some) and len(above) == len(row) and not words


def _trimmed(cells: Sequence[str]) -> list[str]:
    """Return fields without the empty ones at the end."""
    count = max((n for n, cell in enumerate(cells, start=1) if cell), default=0)
    return list(cells[:count])


def cells_of(line: str, separator: str | None) -> list[str]:
    """Return the fields of a line, without quotes.

    Args:
        line: The line.
        separator: Separator of the fields; None for blanks.
    """
    return [cell.strip().strip('"').strip() for cell in line.split(separator)]


def has_letters(text: str) -> bool:
    """Return True if a text contains a letter."""
    return re.search(r"[^\W\d_]", text) is not None


def number_of(text: str, decimal: str = ".") -> float:
    """Return a field as a number; NaN for other text.

    Args:
        text: The field.
        decimal: Decimal mark: a point or a comma.
    """
    text = text.replace(INFINITY, "inf").replace(MINUS, "-")
    # float reads Python's 1_000 and digits of other scripts, which are mistakes in data
    if "_" in text or foreign_digits(text):
        return math.nan
    try:
        return float(text.replace(",", ".") if decimal == "," else text)
    except ValueError:
        return math.nan


def is_text(text: str, decimal: str = ",") -> bool:
    """Return True if a field is neither a number nor a missing number (nan)."""
    return math.isnan(number_of(text, decimal)) and text.lower() != "nan"


def take_decimal_commas(table: Table, numbers: Collection[int]) -> None:
    """Replace decimal commas by points, and typographic minus signs by plain ones.

    Args:
        table: The table, which is changed.
        numbers: Its columns of numbers.

    Raises:
        InputError: Both marks occur, or a number has two readings.
    """
    for i in numbers:
        if any(MINUS in text for text in table.columns[i]):
            table.columns[i] = [x.replace(MINUS, "-") for x in table.columns[i]]
    if table.separator != ";" and not any(
        "," in x for i in numbers for x in table.columns[i]
    ):
        return
    # by form the first number and its place
    seen: dict[str, tuple[str, str]] = {}
    for i in numbers:
        for line, cell in zip(table.lines, table.columns[i], strict=True):
            text = cell.lstrip("> ")
            if "," in text or "." in text:
                of = next((f for f in FORMS if re.fullmatch(FORMS[f], text)), "")
                if of not in seen:
                    seen[of] = table.at(line, table.header[i]), text
    if "grouped" in seen:
        where, text = seen["grouped"]
        raise InputError(
            f"{where}: expected a number without marks between thousands, got "
            f"{shown(text)}"
        )
    if "," in seen and "." in seen:
        (here, text), (there, other) = seen[","], seen["."]
        raise InputError(
            f"{here}: expected one decimal mark in the file, got a comma here "
            f"({text}) and a point at {there} ({other})"
        )
    for mark in ",.":
        if f"{mark}?" in seen and mark not in seen:
            where, text = seen[f"{mark}?"]
            there, other = seen.get(".,"[",.".index(mark)], ("", ""))
            known = f"; {there} has {other}" if other else ""
            raise InputError(
                f"{where}: expected {text.replace(mark, '.')} with a decimal point, or "
                f"{text.replace(mark, '')} without a mark between thousands, got "
                f"{shown(text)}, which may be either{known}"
            )
    if "," in seen:
        for i in numbers:
            table.columns[i] = [
                x.replace(",", ".") if re.fullmatch(FORMS[","], x.lstrip("> ")) else x
                for x in table.columns[i]
            ]
        where, text = seen[","]
        place = where.removeprefix(f"{table.source}: ")
        table.notes.append(conversion("decimal_comma", text=text, place=place))
