"""Where the headers of a sheet stand: two of them are two tables."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from jblast.errors import InputError, shown
from jblast.observations.table import COLUMNS
from jblast.quantity_table import QUANTITIES
from jblast.units import our_name
from jblast.units.spelling import spelt

LEAST_NAMES = 3
"""Names that we know in a row make a header of it: no measurement has as many words."""
MOST_SHOWN = 4


@dataclass(frozen=True)
class HeaderCells:
    """A header in a sheet.

    Attributes:
        row: Where it stands, from 1.
        column: Where it begins, from 0.
        names: Its cells, up to the next empty one.
    """

    row: int
    column: int
    names: tuple[str, ...]

    def __str__(self) -> str:
        last = self.column + len(self.names) - 1
        first = ", ".join(map(shown, self.names[:MOST_SHOWN]))
        more = ", ..." if len(self.names) > MOST_SHOWN else ""
        place = f"{_letters(self.column)}{self.row}:{_letters(last)}{self.row}"
        return f"{place} ({first}{more})"


def refuse_several_headers(source: str, rows: Sequence[Sequence[Any]]) -> None:
    """Refuse a sheet in which two headers of a log stand, and one with a title.

    Args:
        source: What the sheet comes from.
        rows: Its cells.

    Raises:
        InputError: There are two tables, wherever they stand, or there is something
            above the header.
    """
    found = headers_within(rows)
    if len(found) > 1:
        places = " and ".join(str(one) for one in found[:2])
        more = f" and {len(found) - 2} more" if len(found) > 2 else ""
        count = "two" if len(found) == 2 else str(len(found))
        raise InputError(
            f"{source}: row {found[1].row}: expected one table, got {count}: headers "
            f"stand in {places}{more}; keep one table a file"
        )
    for number, row in enumerate(rows[: found[0].row - 1] if found else (), start=1):
        filled = [cell for cell in row if isinstance(cell, str) and cell.strip()]
        if filled and not filled[0].lstrip().startswith("#"):
            raise InputError(
                f"{source}: row {number}: expected the header, got {shown(filled[0])}, "
                f"and the header in {found[0]}; begin what stands above it with #, or "
                "take it out"
            )


def headers_within(rows: Sequence[Sequence[Any]]) -> list[HeaderCells]:
    """Return the headers of a sheet: cells in a row that are names of our columns.

    Args:
        rows: Its cells.
    """
    found = []
    for number, row in enumerate(rows, start=1):
        if sum(isinstance(cell, str) and bool(cell) for cell in row) < LEAST_NAMES:
            continue
        for column, names in _runs(row):
            if sum(map(_is_ours, names)) >= LEAST_NAMES:
                found.append(HeaderCells(number, column, names))
    return found


def _runs(row: Sequence[Any]) -> list[tuple[int, tuple[str, ...]]]:
    """Return words that stand side by side, none twice, and where each row begins."""
    runs: list[tuple[int, tuple[str, ...]]] = []
    begin, names = 0, []
    for column, cell in enumerate((*row, None)):
        word = cell.strip() if isinstance(cell, str) else ""
        if not word or spelt(word) in map(spelt, names):
            if names:
                runs.append((begin, tuple(names)))
            names = []
        if word:
            begin = begin if names else column
            names.append(word)
    return runs


def _is_ours(word: str) -> bool:
    """Return whether a word names a column or a quantity."""
    ours = our_name(word)
    name = spelt(word) if ours is None else ours.name
    return name in COLUMNS or name in QUANTITIES


def _letters(column: int) -> str:
    """Return what a column is called in a sheet."""
    letters, left = "", column + 1
    while left:
        left, digit = divmod(left - 1, 26)
        letters = chr(ord("A") + digit) + letters
    return letters
