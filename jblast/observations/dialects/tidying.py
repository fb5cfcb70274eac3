"""What tables of other programs have around their numbers: blanks, notes, units."""

from dataclasses import dataclass

from jblast.errors import InputError, shown
from jblast.observations.dialects.table import Table
from jblast.observations.understood import ColumnsIgnored, UnitsRow
from jblast.units import our_name, unit_spelt
from jblast.units.spelling import spelt

NOTES = ("note", "notes")
"""First words of columns that are for people."""
NA_WORDS = frozenset(
    {"", "na", "n/a", "nan", "-", "--", "null", "none", "empty", "#n/a", "n.a."}
)
"""What stands where nothing was measured, in lower case."""
NA_SPELT = frozenset(
    spelling
    for word in NA_WORDS - {""}
    for spelling in (word, word.upper(), word.title(), "NaN")
)
"""The same as they are found."""
NO_UNIT = NA_WORDS | {"unit", "units", "1", "[-]", "(-)", "[]", "name", "text"}
"""What a row of units has below columns without one."""


def is_empty(text: str) -> bool:
    """Return whether a field says that nothing was measured."""
    return not text or text in NA_SPELT


def drop_blanks(table: Table) -> None:
    """Take out rows and columns of nothing, comments in a field, and notes."""
    first = table.columns[0] if table.columns else []
    empty: set[int] = set()
    comments = []
    for row, text in enumerate(first if "" in first or "#" in "".join(first) else ()):
        if text and not text.startswith("#"):
            continue
        if not any(column[row] for column in table.columns[1:]):
            empty.add(row)
            if text:
                comments.append(text[1:].strip())
    table.drop_rows(empty)
    table.comments = (*table.comments, *comments)
    unnamed = {
        index
        for index, name in enumerate(table.header)
        if not name and not any(table.columns[index])
    }
    notes = {
        index
        for index, name in enumerate(table.header)
        if spelt(name).partition("_")[0] in NOTES
    }
    if notes:
        names = tuple(table.header[index] for index in sorted(notes))
        table.understood = (*table.understood, ColumnsIgnored(names))
    table.drop_columns(unnamed | notes)


def refuse_two_tables(table: Table, names: list[str]) -> None:
    """Refuse a header that comes again, and a second one of other names.

    Args:
        table: The table.
        names: Its header as it was written.

    Raises:
        InputError: There is one; the message says where.
    """
    words = _words_for_values(table)
    if names[0] not in table.columns[0] and not table.blank_before and not words:
        return
    first = [spelt(name) for name in names]
    for row, line in enumerate(table.lines):
        apart = line in table.blank_before or row in words
        if table.columns[0][row] != names[0] and not apart:
            continue
        cells = [column[row] for column in table.columns]
        again = [spelt(cell) for cell in cells] == first
        if again or (apart and not _holds_a_number(cells)):
            raise InputError(
                f"{table.at(line)}: expected one table, got "
                + ("its header again" if again else "another header")
                + f" ({', '.join(map(shown, cells[:4]))}); keep one table a file"
            )


def _words_for_values(table: Table) -> set[int]:
    """Return rows that have a word for a value, and no quantity that we know."""
    if not {"quantity", "value"} <= set(table.header):
        return set()
    values = table.columns[table.header.index("value")]
    quantities = table.columns[table.header.index("quantity")]
    return {
        row
        for row, text in enumerate(values)
        if text[:1].isalpha()
        and not is_empty(text)
        and our_name(quantities[row]) is None
    }


def _holds_a_number(cells: list[str]) -> bool:
    """Return whether a row of measurements could stand here."""
    for cell in cells:
        try:
            float(cell.lstrip("> ").replace(",", "."))
        except ValueError:
            continue
        return True
    return False


@dataclass(frozen=True)
class UnitOf:
    """The unit of a column, and where it was told."""

    suffix: str
    line: int


def take_units_row(table: Table) -> dict[str, UnitOf]:
    """Take out a row of units, second or last, and return them by name of column.

    It is one where every field is a unit, perhaps in brackets, or says that there is
    none, and at least one is a unit.
    """
    if not table.lines:
        return {}
    for row in dict.fromkeys((0, len(table.lines) - 1)):
        cells = [column[row] for column in table.columns]
        units = [cell.strip("[](){} ") for cell in cells]
        meant = [bool(unit_spelt(unit)) for unit in units]
        blank = [unit.lower() in NO_UNIT for unit in (*units,)]
        if not any(meant) or not all(m or b for m, b in zip(meant, blank, strict=True)):
            continue
        line = table.lines[row]
        table.drop_rows({row})
        table.understood = (*table.understood, UnitsRow(line))
        return {
            name: UnitOf(unit, line)
            for name, unit, is_unit in zip(table.header, units, meant, strict=True)
            if is_unit
        }
    return {}
