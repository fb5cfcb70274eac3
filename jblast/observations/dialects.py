"""Tables of other programs: names and units of columns, decimal commas, wide tables.

A column or quantity is identified by its name and the unit at the end of the name, or
by a row of units below the header. Blank rows and columns and columns of notes are
removed. Where a table allows two readings it is refused, never guessed.

0,05 has a decimal comma and 0.05 a decimal point. 1,234 may be 1.234 or 1234, and is
read only if another number of the file shows which mark separates decimals. Marks
between thousands are refused.

A wide table has a column for each quantity and is made long, one measurement a row.
Its columns of errors are in the unit of their quantity or in per cent of it. Quantities
whose errors are additive (times, angles) have no errors in per cent.
"""

import math
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from jblast.errors import InputError, argument, nearest, shown
from jblast.observations.sources import SEPARATORS, Table
from jblast.observations.table import (
    COLUMNS,
    DEGREES,
    NAME_COLUMNS,
    NEEDED,
    NUMBERS,
    POSITION,
    ColumnsIgnored,
    DecimalComma,
    Dialect,
    Faults,
    HeightTaken,
    MadeLong,
    Renamed,
    UnitsRow,
)
from jblast.quantities import ADDITIVE, QUANTITIES, TIMED
from jblast.units import (
    ANY,
    LEVEL,
    LN_PER_DB,
    SHARE,
    OurName,
    our_name,
    spelt,
    unit_spelt,
    what_to_write,
)

VALUES = ("value", "value_utc")
"""Columns of measured values, of which a log has at least one."""
NOTES = ("note", "notes")
"""First words of the names of columns that are ignored."""
NA_WORDS = frozenset(
    {"", "na", "n/a", "nan", "-", "--", "null", "none", "empty", "#n/a", "n.a."}
)
"""Entries of cells without a measurement, in lower case."""
NA_SPELT = frozenset(
    spelling
    for word in NA_WORDS - {""}
    for spelling in (word, word.upper(), word.title(), "NaN")
)
"""The same in their usual spellings."""
NO_UNIT = NA_WORDS | {"unit", "units", "1", "[-]", "(-)", "[]", "name", "text"}
"""Entries in a row of units for columns without a unit."""
GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?:([.,])\d{3})+")
"""Numbers with possible thousands separators: 1,234 or 12.345.678."""
DECIMALS = {
    mark: re.compile(rf"[+-]?\d*{re.escape(mark)}\d*(?:[eE][+-]?\d+)?") for mark in ",."
}
MINUS = "\u2212"
"""The typographic minus sign, which some spreadsheets write."""
Seen = tuple[int, str, str]
"""Line, column and text of a number."""
NAMES = ("sensor", "value_utc", *NAME_COLUMNS)
"""Columns of a wide table without numbers."""
FOR_ALL = "sigma_percent"
"""Column of the errors of all quantities whose errors are relative."""


@dataclass
class Header:
    """Names and units of the columns of a table.

    Attributes:
        theirs: By our column, its name as written.
        units: By our column, its unit, where it is not ours.
    """

    theirs: dict[str, str] = field(default_factory=dict)
    units: dict[str, OurName] = field(default_factory=dict)


@dataclass(frozen=True)
class UnitOf:
    """The unit of a column, and the line of the row of units."""

    suffix: str
    line: int


def read_header(
    table: Table, faults: Faults, units_row: Mapping[str, UnitOf]
) -> Header:
    """Rename a table's columns to our names.

    Args:
        table: The table; its header is changed, and unknown columns are removed.
        faults: Collects unknown columns.
        units_row: Units from a row of units, by column as written.

    Raises:
        InputError: A column is missing or repeated, or has two units.
    """
    where = table.at(table.header_line)
    header, unknown = Header(), set()
    for index, theirs in enumerate(table.header):
        ours = column_of(theirs, units_row.get(theirs), table)
        if ours is None:
            unknown.add(index)
            advice = _advice(theirs)
            faults.add(InputError(f"{where}: unknown column {shown(theirs)}{advice}"))
            continue
        name, unit = ours
        if name in header.theirs:
            first = header.theirs[name]
            units = {our.unit if (our := our_name(x)) else "" for x in (first, theirs)}
            two = ": two units for one column" if len(units) > 1 else ""
            both = f"{shown(first)} and {shown(theirs)}{two}"
            got = "it twice" if first == theirs else both
            raise InputError(f"{where}: expected column {name} once, got {got}")
        header.theirs[name] = theirs
        if unit is not None:
            header.units[name] = unit
            if unit.factor == 1.0 and spelt(theirs) != name and name not in ANY:
                table.understood = (*table.understood, Renamed(theirs, name))
        table.header[index] = name
    table.drop_columns(unknown)
    _check_all_there(table, where)
    return header


def column_of(
    theirs: str, stated: UnitOf | None, table: Table
) -> tuple[str, OurName | None] | None:
    """Return our column, and its unit if that is not ours; None for an unknown name.

    Args:
        theirs: Its name as written.
        stated: Its unit by a row of units.
        table: For the position in messages.

    Raises:
        InputError: The row of units has another unit than the name.
    """
    # the usual case first: most columns have our names
    if theirs in COLUMNS and stated is None:
        return theirs, None
    key = spelt(theirs)
    if stated is not None:
        return _with_units_row(theirs, key, stated, table)
    if key in COLUMNS:
        return key, None
    found = our_name(theirs)
    if found is None or found.name not in COLUMNS:
        return None
    return found.name, found


def _with_units_row(
    theirs: str, key: str, stated: UnitOf, table: Table
) -> tuple[str, OurName | None] | None:
    """Return our column, with its unit from a row of units."""
    own = our_name(theirs)
    there = our_name(f"{theirs}_{stated.suffix}")
    if own is not None and own.name in COLUMNS:
        # units are compared by dimension and factor: kPa and kilopascal are the same
        same = our_name(f"value_{stated.suffix}")
        if same is None or (same.dimension, same.factor) != (own.dimension, own.factor):
            raise InputError(
                f"{table.at(stated.line)}, column {theirs}: expected one unit per "
                f"column, got {own.unit} in its name and {stated.suffix} in the row of "
                "units"
            )
        return own.name, None if key in COLUMNS else own
    if there is not None and there.name in COLUMNS:
        return there.name, there
    return (key, None) if key in COLUMNS and key not in NUMBERS else None


def _advice(name: str) -> str:
    """Return the advice for an unknown column."""
    if not name:
        return "; expected a name above every column that is not empty"
    if name in QUANTITIES:
        return (
            "; it is a quantity, not a column: put it into column quantity, "
            "one measurement a row"
        )
    ours = our_name(name)
    expected = f"; expected some of {', '.join(COLUMNS)}"
    if ours is None:
        return what_to_write(name) or nearest(name, COLUMNS) + expected
    if ours.name in QUANTITIES:
        return (
            f"; it is a quantity, {ours.name}, not a column: put {shown(name)} into "
            "column quantity, one measurement a row"
        )
    return expected


def _check_all_there(table: Table, where: str) -> None:
    """Raise an error for missing columns; a height that is left out is 0."""
    got = table.header
    missing = [name for name in NEEDED if name not in got]
    if any(name in got for name in VALUES) and "value" in missing:
        missing.remove("value")
    if missing:
        raise InputError(
            f"{where}: missing column {', '.join(missing)}; expected "
            f"{', '.join(NEEDED)}; got {', '.join(got) or 'no known column'}"
        )
    partial = [name for name in POSITION if name not in got]
    # surveys on level ground have no heights
    if partial == ["up_m"]:
        table.header.append("up_m")
        east = table.columns[got.index("east_m")]
        table.columns.append(["0" if text else "" for text in east])
        table.understood = (*table.understood, HeightTaken())
    elif 0 < len(partial) < 3 and not set(DEGREES) & set(got):
        raise InputError(
            f"{where}: missing column {', '.join(partial)}; expected all of "
            f"{', '.join(POSITION)} or none of them"
        )


def is_quantity(name: str) -> bool:
    """Return True if a column's name is a quantity, in any unit."""
    found = our_name(name)
    return name in QUANTITIES or (found is not None and found.name in QUANTITIES)


def is_empty(text: str) -> bool:
    """Return True if a field means that there is no measurement."""
    return not text or text in NA_SPELT


def drop_blanks(table: Table) -> None:
    """Remove empty rows and columns, comments in a field, and notes."""
    first = table.columns[0] if table.columns else []
    # most tables have neither blanks nor comments, and need no loop over their rows
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
    # notes are the only columns that are dropped: others might be misspelt
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
    """Refuse a repeated header, and a second one with other names.

    Args:
        table: The table.
        names: Its header as written.

    Raises:
        InputError: There is one; the message has its position.
    """
    # rows with a word as value and an unknown quantity
    words: set[int] = set()
    if {"quantity", "value"} <= set(table.header):
        values = table.columns[table.header.index("value")]
        quantities = table.columns[table.header.index("quantity")]
        words = {
            row
            for row, text in enumerate(values)
            if text[:1].isalpha()
            and not is_empty(text)
            and our_name(quantities[row]) is None
        }
    if names[0] not in table.columns[0] and not table.blank_before and not words:
        return
    first = [spelt(name) for name in names]
    for row, line in enumerate(table.lines):
        # a second table follows a blank row, or has words where numbers should be
        apart = line in table.blank_before or row in words
        if table.columns[0][row] != names[0] and not apart:
            continue
        cells = [column[row] for column in table.columns]
        again = [spelt(cell) for cell in cells] == first
        if again or (apart and not _holds_a_number(cells)):
            raise InputError(
                f"{table.at(line)}: expected one table, got "
                + ("its header again" if again else "another header")
                + f" ({', '.join(map(shown, cells[:4]))}); keep one table per file"
            )


def _holds_a_number(cells: list[str]) -> bool:
    """Return True if cells contain a number, as those of a measurement do."""
    for cell in cells:
        try:
            float(cell.lstrip("> ").replace(",", "."))
        except ValueError:
            continue
        return True
    return False


def take_units_row(table: Table) -> dict[str, UnitOf]:
    """Remove a row of units, second or last, and return them by name of column.

    In a row of units every field is a unit, possibly in brackets, or means no unit, and
    at least one is a unit.
    """
    if not table.lines:
        return {}
    # pandas writes a row of units first, some loggers last
    for row in dict.fromkeys((0, len(table.lines) - 1)):
        cells = [column[row] for column in table.columns]
        units = [cell.strip("[](){} ") for cell in cells]
        meant = [bool(unit_spelt(unit)) for unit in units]
        blank = [unit.lower() in NO_UNIT for unit in units]
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


def take_decimal_commas(table: Table, numbers: Collection[str]) -> None:
    """Replace decimal commas by points, and typographic minus signs by plain ones.

    Args:
        table: The table, which is changed.
        numbers: Columns of numbers, as written in the header.

    Raises:
        InputError: Both marks occur, or a number has two readings.
    """
    held = [i for i, name in enumerate(table.header) if name in numbers]
    separated = next((f for f in table.understood if isinstance(f, Dialect)), None)
    semicolons = separated is not None and separated.separator == SEPARATORS[";"]
    for i in held:
        if any(MINUS in text for text in table.columns[i]):
            table.columns[i] = [x.replace(MINUS, "-") for x in table.columns[i]]
    columns = [table.columns[i] for i in held]
    if not semicolons and not any("," in "".join(column) for column in columns):
        return
    sure, unsure = _marks(table, held)
    # a mark is certain if a number has only one reading with it: 1,5 but not 1,234
    if "," in sure and "." in sure:
        raise InputError(
            f"{_at(table, sure[','])}: expected one decimal mark in the file, got a "
            f"comma here and a point at {_at(table, sure['.'])}"
        )
    if not sure and unsure:
        mark, seen = next(iter(unsure.items()))
        text = seen[2]
        decimal, whole = text.replace(mark, "."), text.replace(mark, "")
        raise InputError(
            f"{_at(table, seen)}: may be {decimal} or {whole}, which no other number "
            f"decides; expected {decimal} with a point in a file with commas "
            f"between fields, or {whole} without a mark"
        )
    for mark in unsure.keys() - sure.keys():
        (known,) = sure.values()
        raise InputError(
            f"{_at(table, unsure[mark])}: expected no mark between thousands, and "
            f"decimals as in {known[2]} at {_at(table, known, text=False)}; write "
            f"{unsure[mark][2].replace(mark, '')} for a whole number"
        )
    if "," not in sure:
        return
    for i in held:
        table.columns[i] = [
            text.replace(",", ".")
            if DECIMALS[","].fullmatch(text.lstrip("> "))
            else text
            for text in table.columns[i]
        ]
    line, _, text = sure[","]
    table.understood = (*table.understood, DecimalComma(line, text))


def _marks(table: Table, held: list[int]) -> tuple[dict[str, Seen], dict[str, Seen]]:
    """Return the first number by mark: with one reading, and with two readings.

    Raises:
        InputError: A number has both marks, or one of them twice.
    """
    sure: dict[str, Seen] = {}
    unsure: dict[str, Seen] = {}
    for i in held:
        for line, cell in zip(table.lines, table.columns[i], strict=True):
            if "," not in cell and "." not in cell:
                continue
            text = cell.lstrip("> ")
            seen = line, table.header[i], text
            # a mark before three digits may separate thousands or decimals
            match = GROUPED.fullmatch(text)
            if match and text.count(match[1]) == 1:
                unsure.setdefault(match[1], seen)
                continue
            for mark, decimal in DECIMALS.items():
                if decimal.fullmatch(text):
                    sure.setdefault(mark, seen)
                    break
            else:
                if any(c.isdigit() for c in text) and not text.strip("+-0123456789.,"):
                    raise InputError(
                        f"{_at(table, seen)}: expected a number without marks between "
                        "thousands"
                    )
    return sure, unsure


def _at(table: Table, seen: Seen, *, text: bool = True) -> str:
    """Return the position of a number, and the number, for a message."""
    line, column, number = seen
    got = f", got {shown(number)}" if text else ""
    return f"{table.at(line)}, column {column}{got}"


def refuse_wide(table: Table, units_row: dict[str, UnitOf]) -> None:
    """Refuse a table with a column for each quantity, with advice.

    Raises:
        InputError: The table is wide.
    """
    keys = [spelt(name) for name in table.header]
    if "quantity" in keys or any(key.startswith("value") for key in keys):
        return
    held = [n for n in table.header if is_quantity(_with_unit(n, units_row))]
    if not held:
        return
    one = shown(held[0])
    raise InputError(
        f"{table.at(table.header_line)}: column {one} is a quantity, not a column: a "
        f"wide table, with {len(held)} of them; expected one measurement per row, "
        f"{one} in column quantity and its number in column value; or read it with "
        f"{argument('wide')}"
    )


def made_long(table: Table, units_row: dict[str, UnitOf]) -> Table:
    """Return a wide table as one measurement per row, sensor by sensor.

    A column `sigma_QUANTITY` or `QUANTITY_sigma` has the errors of QUANTITY in the same
    unit, `sigma_percent` those of all quantities with relative errors
    (`error_columns`). Rows of other quantities have no sigma. An empty cell is no
    measurement.

    Args:
        table: Table with a column for each quantity, as `peak_overpressure_kpa`.
        units_row: Units from a row of units, of which those of quantities are used.

    Raises:
        InputError: The table has no such column, or also `quantity` or `value`, or a
            column of errors without its quantity.
    """
    where = table.at(table.header_line)
    keys = [spelt(name) for name in table.header]
    long = [name for name in ("quantity", "value", "sigma") if name in keys]
    if long:
        raise InputError(
            f"{where}: expected a wide table, a column for each quantity; got a column "
            f"{long[0]}, as long ones have"
        )
    names = [_with_unit(name, units_row) for name in table.header]
    held = {i: name for i, name in enumerate(names) if is_quantity(name)}
    if not held:
        raise InputError(
            f"{where}: expected a wide table, a column for each quantity; got "
            f"{', '.join(map(shown, table.header))}"
        )
    _refuse_twice(where, held)
    # before the columns are combined: a mark is decided by all numbers of the file
    numbers = {name for name in table.header if spelt(name) not in NAMES}
    take_decimal_commas(table, numbers)
    errors = error_columns(table, held, units_row)
    taken = {*held, *(error.column for error in errors.values())}
    others = [i for i in range(len(keys)) if i not in taken]
    picked: list[tuple[int, int]] = [
        (row, i)
        for row in range(len(table.lines))
        for i in held
        if not is_empty(table.columns[i][row])
    ]

    def field(of: Callable[[int, int], str]) -> list[str]:
        return [of(row, i) for row, i in picked]

    def sigma(row: int, i: int) -> str:
        if i not in errors:
            return ""
        written = table.columns[errors[i].column][row]
        return errors[i].sigma(table.columns[i][row], written)

    timed = {i for i, name in held.items() if _quantity_named(name) in TIMED}
    columns = []
    for other in others:
        cells, is_time = table.columns[other], keys[other].startswith("time")
        columns.append(
            [cells[row] if not is_time or i in timed else "" for row, i in picked]
        )
    header = [table.header[i] for i in others]
    without = tuple(name for i, name in held.items() if i not in errors)
    shares = tuple(held[i] for i, error in errors.items() if error.is_share)
    return Table(
        source=table.source,
        header=[*header, "quantity", "value", "sigma"],
        columns=[
            *columns,
            field(lambda _, i: held[i]),
            field(lambda row, i: table.columns[i][row]),
            field(sigma),
        ],
        lines=[table.lines[row] for row, _ in picked],
        header_line=table.header_line,
        comments=table.comments,
        understood=(*table.understood, MadeLong(tuple(held.values()), without, shares)),
    )


def _with_unit(name: str, units_row: dict[str, UnitOf]) -> str:
    """Return a name with its unit from a row of units, if that makes it a quantity."""
    stated = units_row.get(name)
    if stated is None or is_quantity(name):
        return name
    with_unit = f"{name}_{stated.suffix}"
    return with_unit if is_quantity(with_unit) else name


def _refuse_twice(where: str, held: dict[int, str]) -> None:
    """Refuse two columns of one quantity."""
    first: dict[str, str] = {}
    for name in held.values():
        other = first.setdefault(_quantity_named(name), name)
        if other != name:
            raise InputError(
                f"{where}: expected a column for each quantity, got {shown(other)} and "
                f"{shown(name)}: two units for one column"
            )


def _quantity_named(name: str) -> str:
    """Return our quantity of a column."""
    found = our_name(name)
    return found.name if found else name


class ErrorColumn(NamedTuple):
    """A column of errors.

    Attributes:
        column: Number of the column, from zero.
        is_share: True if they are in per cent of the value.
        is_level: True if that value is a level in dB.
    """

    column: int
    is_share: bool
    is_level: bool

    def sigma(self, value: str, written: str) -> str:
        """Return an error in the unit of its value.

        Args:
            value: The value as written.
            written: The error as written.
        """
        if not self.is_share or is_empty(written):
            return written
        # an error of a level is in decibels, whatever the level is
        value = "1" if self.is_level else value.lstrip("> ")
        # text that is not a number is refused later, with the text itself
        try:
            share = float(value) * float(written) / 100.0
        except ValueError:
            return written
        if not math.isfinite(share):
            return written
        return repr(share / LN_PER_DB if self.is_level else share)


def error_columns(
    table: Table, held: Mapping[int, str], units_row: Mapping[str, UnitOf]
) -> dict[int, ErrorColumn]:
    """Return the column of errors of each column of values.

    `sigma_QUANTITY` and `QUANTITY_sigma` are in the unit of QUANTITY. With the suffix
    `_percent`, or % in the row of units, they are relative. `sigma_percent` alone is
    that of every quantity with relative errors that has no other.

    Args:
        table: A wide table.
        held: Quantities with their units by column.
        units_row: Units from a row of units, by column as written.

    Raises:
        InputError: A column is in another unit than its quantity, or per cent of a
            quantity without relative errors, or belongs to no quantity.
    """
    keys = [spelt(name) for name in table.header]
    found: dict[int, ErrorColumn] = {}
    for i, name in held.items():
        ours = our_name(name)
        for key, is_share in _names(spelt(table.header[i]), ours):
            # the first name that matches counts: exact names come before those of the
            # stem
            if key in keys and i not in found:
                at = keys.index(key)
                is_share = is_share or _is_share_by_units_row(
                    table, at, ours, units_row
                )
                if is_share and _quantity_named(name) in ADDITIVE:
                    raise InputError(
                        f"{table.at(table.header_line)}, column {table.header[at]}: "
                        f"expected a sigma in the unit of {name}, whose errors are not "
                        "relative, got %"
                    )
                found[i] = ErrorColumn(at, is_share, _dimension(ours) == LEVEL)
    # a column of its own takes precedence over the common one
    if FOR_ALL in keys:
        at = keys.index(FOR_ALL)
        for i, name in held.items():
            if i not in found and _quantity_named(name) not in ADDITIVE:
                found[i] = ErrorColumn(at, True, _dimension(our_name(name)) == LEVEL)
    used = {error.column for error in found.values()}
    for i, key in enumerate(keys):
        words = key.split("_")
        if "sigma" not in (words[0], words[-1]) and words[-2:] != ["sigma", "percent"]:
            continue
        if i not in used and i not in held:
            raise InputError(
                f"{table.at(table.header_line)}: expected sigma_ and the name of a "
                f"quantity's column, as sigma_{spelt(table.header[min(held)])}, in its "
                f"unit, or {FOR_ALL}, of quantities whose errors are relative; got "
                f"{shown(table.header[i])}"
            )
    return found


def _names(key: str, ours: OurName | None) -> list[tuple[str, bool]]:
    """Return possible names of a column of errors, with True for relative ones."""
    names = [(f"sigma_{key}", False), (f"{key}_sigma", False)]
    stem = key if ours is None else key.removesuffix(f"_{ours.unit.lower()}")
    for of in dict.fromkeys((key, stem)):
        names += [(f"sigma_{of}_percent", True), (f"{of}_sigma_percent", True)]
    return names


def _is_share_by_units_row(
    table: Table, at: int, ours: OurName | None, units_row: Mapping[str, UnitOf]
) -> bool:
    """Return True if errors are in per cent of their values by the row of units.

    Raises:
        InputError: It has another unit than that of the values.
    """
    stated = units_row.get(table.header[at])
    if stated is None or ours is None:
        return False
    meant = {unit.dimension for unit in unit_spelt(stated.suffix)}
    if meant == {SHARE}:
        return True
    same = our_name(f"value_{stated.suffix}")
    if same is None or (same.dimension, same.factor) != (ours.dimension, ours.factor):
        raise InputError(
            f"{table.at(stated.line)}, column {table.header[at]}: expected "
            f"{ours.unit}, the unit of its quantity, or %, got {stated.suffix}"
        )
    return False


def _dimension(ours: OurName | None) -> str:
    return "" if ours is None else ours.dimension
