"""Samples as text: one sample a row, a column of time and one or more of pressure.

Separators are commas, semicolons, tabs or blanks; with any but the first a decimal
comma is understood. Lines that begin with # are comments, of which the last may contain
the names, as `numpy.savetxt` writes it. Units are in the names of columns
(`time_ms,pressure_kpa`; `Time (ms),A (mV)`) or in a row of their own below. Times of
day are refused: the time of the first sample belongs into the table of stations.
"""

import math
import re
from array import array
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, shown
from jblast.observations.records.recording import (
    Recording,
    Scaling,
    channel_names,
    columns_of,
    even_clock,
    plain_unit,
    scale_of,
    time_factor,
    word_and_unit,
)

SEPARATORS = (";", "\t", ",", None)
"""Separators in the order in which they are searched in the names; None for blanks."""
MAX_HEAD_LINES = 200
"""Largest number of lines before the samples: headers of oscilloscopes have tens."""


def open_csv(path: Path, scaling: Scaling) -> tuple[Recording, ...]:
    """Return the recording of a text: one channel for each column of pressure.

    Raises:
        InputError: The text is not as described; the message names line and column.
    """
    table = table_at(path)
    columns = columns_of(table.names, f"{path}: line {table.header}")
    wanted = (columns.time, *columns.pressures)
    numbers, lines = _numbers(path, table, wanted)

    def place(sample: int) -> str:
        return f"{path}: line {lines[sample]}, column {table.names[columns.time]}"

    # in seconds first, so that messages and the rounded rate are in SI units
    start_s, rate_hz = even_clock(columns.seconds * numbers[0], place)
    scales = [
        scale_of(unit, scaling, f"{path}: column {table.names[at]}")
        for at, unit in zip(columns.pressures, columns.units, strict=True)
    ]
    factors = np.array([scale.factor for scale in scales])
    samples = factors[:, None] * numbers[1:]
    recording = Recording(
        source=str(path),
        names=channel_names(path.stem, len(samples)),
        labels=tuple(f"column {table.names[at]}" for at in columns.pressures),
        rate_hz=rate_hz,
        length=samples.shape[1],
        read=lambda start, stop: samples[:, start:stop],
        start_s=start_s,
        notes=(f"columns left out, not pressure: {', '.join(columns.left_out)}",)
        if columns.left_out
        else (),
        first_line=int(lines[0]),
    )
    return (recording,)


def is_stations(path: Path) -> bool:
    """Return True if a text is a table of sensors or a log, not a record of samples."""
    try:
        names = table_at(path).names
    except InputError:
        return False
    return "sensor" in (name.strip().lower() for name in names)


class Table(NamedTuple):
    """Layout of a text of samples.

    Attributes:
        names: Names of the columns, with units.
        separator: Separator of the columns; None for blanks.
        decimal: Decimal mark: a point or a comma.
        header: Line of the names.
        first: Line of the first sample.
        encoding: Encoding of the text.
    """

    names: list[str]
    separator: str | None
    decimal: str
    header: int
    first: int
    encoding: str


def _numbers(
    path: Path, table: Table, wanted: tuple[int, ...]
) -> tuple[Float[np.ndarray, "column sample"], array]:
    """Return columns as numbers, and the line of each row.

    Raises:
        InputError: A cell is not a finite number.
    """
    # an array of integers: a list of them takes four times the memory
    lines = array("q")

    def rows() -> Iterator[str]:
        for number, line in lines_of(path, table.encoding):
            if number >= table.first:
                lines.append(number)
                yield line.replace(",", ".") if table.decimal == "," else line

    try:
        # NumPy's parser is much faster than float of each field; errors are located
        # afterwards
        numbers = np.loadtxt(
            rows(),
            delimiter=table.separator,
            comments=None,
            usecols=wanted,
            ndmin=2,
        )
    except ValueError:
        raise _bad_cell(path, table, wanted) from None
    if not np.isfinite(numbers).all():
        raise _bad_cell(path, table, wanted)
    return np.ascontiguousarray(numbers.T), lines


def _bad_cell(path: Path, table: Table, wanted: tuple[int, ...]) -> InputError:
    """Return the error that names the first cell without a finite number."""
    # a column without any number is probably not one of samples: a different advice
    filled: set[int] = set()
    for number, line in lines_of(path, table.encoding):
        if number >= table.first:
            cells = cells_of(line, table.separator)
            there = [at for at in wanted if at < len(cells)]
            filled.update(at for at in there if is_number(cells[at], table.decimal))
    for at in wanted:
        if at not in filled:
            return InputError(
                f"{path}: line {table.first}, column {table.names[at]}: expected "
                "samples, got no finite number; remove the column"
            )
    for number, line in lines_of(path, table.encoding):
        if number < table.first:
            continue
        cells = cells_of(line, table.separator)
        if len(cells) <= max(wanted):
            return InputError(
                f"{path}: line {number}: expected {len(table.names)} fields as in the "
                f"header, got {len(cells)}"
            )
        for at in wanted:
            if not is_number(cells[at], table.decimal):
                got = shown(cells[at]) if cells[at] else "nothing"
                return InputError(
                    f"{path}: line {number}, column {table.names[at]}: expected a "
                    f"number, got {got}"
                )
    return InputError(f"{path}: expected numbers below line {table.header}")


def table_at(path: Path) -> Table:
    """Return the layout of a text by its first lines.

    Raises:
        InputError: The file is not text, or has no names above its numbers.
    """
    with path.open("rb") as file:
        marked = file.read(2) in (b"\xff\xfe", b"\xfe\xff")
    # spreadsheets write UTF-16, and UTF-8 with a mark
    encoding = "utf-16" if marked else "utf-8-sig"
    head: list[tuple[int, str]] = []
    try:
        for number, line in lines_of(path, encoding):
            head.append((number, line))
            if len(head) >= 3 or number > MAX_HEAD_LINES:
                break
    except UnicodeDecodeError:
        raise InputError(
            f"{path}: expected text with columns of time and pressure, got bytes that "
            "are not UTF-8"
        ) from None
    # numpy.savetxt writes the names as a comment
    if head and all(is_number(cell, ",") for cell in re.split(r"[;,\s]+", head[0][1])):
        head = [*_names_in_comment(path, encoding, head[0]), *head]
    if len(head) < 2:
        raise InputError(
            f"{path}: expected names of columns and a sample a row, got "
            + ("one line" if head else "none")
        )
    (header, names_line), (first, row) = head[:2]
    separator = next(s for s in SEPARATORS if s is None or s in names_line)
    names = cells_of(names_line, separator)
    if all(is_number(name, ".") for name in names):
        raise InputError(
            f"{path}: line {header}: expected names of columns, as "
            f"time_s,pressure_pa, got {shown(names_line)}"
        )
    cells = cells_of(row, separator)
    # a row without a number below the names, and above numbers, is one of units
    if len(head) > 2 and not any(is_number(cell, ",") for cell in cells):
        units = [cell.strip("()[] ") for cell in cells]
        names = [
            _with_unit(name, unit, f"{path}: line {first}")
            for name, unit in zip(names, units, strict=False)
        ]
        first, row = head[2]
    # a comma that does not separate columns separates decimals
    decimal = "," if separator != "," and "," in row else "."
    fields = len(cells_of(row, separator))
    if len(names) not in (fields, len(cells_of(row.rstrip(separator), separator))):
        raise InputError(
            f"{path}: line {first}: expected {len(names)} fields as in the header, "
            f"got {fields}: {shown(row)}"
        )
    if decimal == "," and "." in row:
        raise InputError(
            f"{path}: line {first}: expected a decimal point or a decimal comma, "
            f"got both: {shown(row)}"
        )
    return Table(names, separator, decimal, header, first, encoding)


def _with_unit(name: str, unit: str, where: str) -> str:
    """Return a name with its unit from a row of units.

    Raises:
        InputError: The name contains another unit.
    """
    own = word_and_unit(name)[1]
    if not own or not unit or plain_unit(own) == plain_unit(unit):
        return f"{name} ({unit})" if not own else name
    raise InputError(
        f"{where}, column {name}: expected one unit per column, got {own} in its name "
        f"and {unit} in the row of units"
    )


def _names_in_comment(
    path: Path, encoding: str, first: tuple[int, str]
) -> list[tuple[int, str]]:
    """Return the comment above the first sample if it has as many fields and a time."""
    number, row = first
    with path.open(encoding=encoding, newline=None) as file:
        above = [line.strip() for line in islice(file, number - 1) if line.strip()]
    if not above:
        return []
    names = above[-1].lstrip("# \t")
    separator = next(s for s in SEPARATORS if s is None or s in row)
    cells = cells_of(names, separator)
    if len(cells) != len(cells_of(row, separator)):
        return []
    timed = any(time_factor(word_and_unit(cell)[1]) is not None for cell in cells)
    return [(number - 1, names)] if timed else []


def lines_of(path: Path, encoding: str) -> Iterator[tuple[int, str]]:
    """Yield the lines that are neither empty nor comments, numbered from 1."""
    with path.open(encoding=encoding, newline=None) as file:
        for number, line in enumerate(file, start=1):
            stripped = line.strip()
            if stripped and not stripped.startswith("#"):
                yield number, stripped


def cells_of(line: str, separator: str | None) -> list[str]:
    """Return the fields of a line, without quotes.

    Args:
        line: The line.
        separator: Separator of the fields; None for blanks.
    """
    return [cell.strip().strip('"').strip() for cell in line.split(separator)]


def is_number(text: str, decimal: str) -> bool:
    """Return True if a field is a finite number.

    Args:
        text: The field.
        decimal: Decimal mark: a point or a comma.
    """
    try:
        return math.isfinite(float(text.replace(",", ".") if decimal == "," else text))
    except ValueError:
        return False
