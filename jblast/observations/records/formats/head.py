"""How a text of samples begins: names, what is between fields, and the first sample."""

import math
import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from jblast.errors import InputError, shown
from jblast.observations.records.formats.columns import word_and_unit
from jblast.observations.records.formats.scale import plain_unit, time_factor

SEPARATORS = (";", "\t", ",", None)
"""None: blanks. In the order in which they are looked for in the names."""
MOST_HEAD = 200
"""Lines before the samples, at most."""


class Table(NamedTuple):
    """How a text holds samples.

    Attributes:
        names: Of the columns, their units with them.
        separator: Between them; None is blanks.
        decimal: What parts whole from broken: a point or a comma.
        header: Line of the names.
        first: Line of the first sample.
        encoding: Of the text.
    """

    names: list[str]
    separator: str | None
    decimal: str
    header: int
    first: int
    encoding: str


def table_at(path: Path) -> Table:
    """Look at the first lines of a text.

    Raises:
        InputError: It is no text, or has no names above its numbers.
    """
    encoding = _encoding(path)
    head: list[tuple[int, str]] = []
    try:
        for number, line in lines_of(path, encoding):
            head.append((number, line))
            if len(head) >= 3 or number > MOST_HEAD:
                break
    except UnicodeDecodeError:
        raise InputError(
            f"{path}: expected text with columns of time and pressure, got bytes that "
            "are no UTF-8"
        ) from None
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
    if len(head) > 2 and not any(is_number(cell, ",") for cell in cells):
        units = [cell.strip("()[] ") for cell in cells]
        names = [
            _with_unit(name, unit, f"{path}: line {first}")
            for name, unit in zip(names, units, strict=False)
        ]
        first, row = head[2]
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
    """Return a name with the unit that a row of units has.

    Raises:
        InputError: It has another unit already.
    """
    own = word_and_unit(name)[1]
    if not own or not unit or plain_unit(own) == plain_unit(unit):
        return f"{name} ({unit})" if not own else name
    raise InputError(
        f"{where}, column {name}: expected one unit a column, got {own} in its name "
        f"and {unit} in the row of units"
    )


def _names_in_comment(
    path: Path, encoding: str, first: tuple[int, str]
) -> list[tuple[int, str]]:
    """Return the comment above the first sample, if it has as many fields and names."""
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
    """Go through the lines that are neither empty nor comments, numbered from 1."""
    with path.open(encoding=encoding, newline=None) as file:
        for number, line in enumerate(file, start=1):
            stripped = line.strip()
            if stripped and not stripped.startswith("#"):
                yield number, stripped


def _encoding(path: Path) -> str:
    with path.open("rb") as file:
        start = file.read(4)
    return "utf-16" if start[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"


def cells_of(line: str, separator: str | None) -> list[str]:
    """Return the fields of a line, without quotes.

    Args:
        line: The line.
        separator: Between fields; None: blanks.
    """
    return [cell.strip().strip('"').strip() for cell in line.split(separator)]


def is_number(text: str, decimal: str) -> bool:
    """Return whether a field is a finite number.

    Args:
        text: The field.
        decimal: A point or a comma.
    """
    try:
        return math.isfinite(float(text.replace(",", ".") if decimal == "," else text))
    except ValueError:
        return False
