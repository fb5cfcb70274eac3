"""Cells of spreadsheets and of data frames, as the text that a CSV file would hold."""

import datetime
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from jblast.errors import InputError
from jblast.observations.dialects.table import Table
from jblast.observations.understood import Understood

EXACT = 2.0**53
"""Whole numbers below are exact in double precision."""


def cell_text(value: Any) -> str:
    """Return a cell as text: numbers to the last digit, whole ones without a point.

    What was never filled in is empty; a date is ISO 8601, whoever made one of it.
    """
    if isinstance(value, str):  # a line break within a cell is a blank
        return value.strip() if value.isprintable() else " ".join(value.split())
    if value is None:
        return ""
    if isinstance(value, (bool, np.bool_)):
        return str(bool(value))
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return _number_text(value)
    if isinstance(value, (datetime.date, datetime.time)):
        return "" if value != value else value.isoformat()  # NaT is unlike itself
    text = str(value).strip()
    return "" if text in ("NaT", "<NA>") else text


def _number_text(value: float | np.floating[Any]) -> str:
    number = float(value)
    if math.isnan(number):
        return ""
    if isinstance(value, np.floating) and value.dtype.itemsize < 8:
        return repr(float(str(value)))  # 0.1 in single precision is meant as 0.1
    if number.is_integer() and abs(number) < EXACT:
        return str(int(number))
    return repr(number)


def table_of_cells(
    source: str,
    rows: Sequence[Sequence[Any]],
    first_line: int,
    understood: tuple[Understood, ...],
) -> Table:
    """Return rows of cells as a table: comments, a header, what stands below.

    Args:
        source: Where they come from.
        rows: Cells by row and column.
        first_line: What the first row is called.
        understood: How they were written.

    Raises:
        InputError: There is no row, or two tables stand there.
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
