"""The names of a table's columns: which are ours, under which name, in which unit."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from jblast.errors import InputError, nearest, shown
from jblast.observations.dialects.table import Table
from jblast.observations.dialects.tidying import UnitOf
from jblast.observations.faults import Faults
from jblast.observations.table import COLUMNS, DEGREES, NEEDED, NUMBERS, POSITION
from jblast.observations.understood import HeightTaken, Renamed
from jblast.quantity_table import QUANTITIES
from jblast.units import OurName, our_name, what_to_write
from jblast.units.spelling import spelt

VALUES = ("value", "value_utc")
"""Columns one of which holds what was measured."""


PER_ROW = ("value", "sigma")
"""Columns whose unit is that of whatever a row measured."""


@dataclass
class Header:
    """What the columns of a table are.

    Attributes:
        theirs: By our column, its name as written.
        units: By our column, the unit it is in, where it has one of its own.
    """

    theirs: dict[str, str] = field(default_factory=dict)
    units: dict[str, OurName] = field(default_factory=dict)


def read_header(
    table: Table, faults: Faults, units_row: Mapping[str, UnitOf], *, strict: bool
) -> Header:
    """Give a table's columns our names.

    Args:
        table: Its header is changed; columns that mean nothing are taken out.
        faults: Takes columns that mean nothing.
        units_row: Units that a row of the table told, by column as written.
        strict: Whether names have to be ours to the letter.

    Raises:
        InputError: A column is missing or there twice, or has two units.
    """
    where = table.at(table.header_line)
    header, unknown = Header(), set()
    for index, theirs in enumerate(table.header):
        ours = column_of(theirs, units_row.get(theirs), table, strict=strict)
        if ours is None:
            unknown.add(index)
            advice = _advice(theirs, strict=strict)
            faults.tell(InputError(f"{where}: unknown column {shown(theirs)}{advice}"))
            continue
        name, unit = ours
        if name in header.theirs:
            raise InputError(f"{where}: {_twice(name, header.theirs[name], theirs)}")
        header.theirs[name] = theirs
        if unit is not None:
            header.units[name] = unit
            if unit.factor == 1.0 and spelt(theirs) != name and name not in PER_ROW:
                table.understood = (*table.understood, Renamed(theirs, name))
        table.header[index] = name
    table.drop_columns(unknown)
    _check_all_there(table, where, strict=strict)
    return header


def column_of(
    theirs: str, stated: UnitOf | None, table: Table, *, strict: bool
) -> tuple[str, OurName | None] | None:
    """Return our column, and its unit if it has one of its own; None if none is meant.

    Args:
        theirs: Its name as written.
        stated: Its unit by a row of units.
        table: Names the place of messages.
        strict: Whether names have to be ours to the letter.

    Raises:
        InputError: The row of units tells another unit than the name.
    """
    if theirs in COLUMNS and stated is None:
        return theirs, None
    if strict:
        return None
    key = spelt(theirs)
    if stated is not None:
        return _with_told_unit(theirs, key, stated, table)
    if key in COLUMNS:
        return key, None
    found = our_name(theirs)
    if found is None or found.name not in COLUMNS:
        return None
    return found.name, found


def _with_told_unit(
    theirs: str, key: str, stated: UnitOf, table: Table
) -> tuple[str, OurName | None] | None:
    """Return our column, its unit from a row of units."""
    own = our_name(theirs)
    there = our_name(f"{theirs}_{stated.suffix}")
    if own is not None and own.name in COLUMNS:
        same = our_name(f"value_{stated.suffix}")
        if same is None or (same.dimension, same.factor) != (own.dimension, own.factor):
            raise InputError(
                f"{table.at(stated.line)}, column {theirs}: expected one unit a "
                f"column, got {own.unit} in its name and {stated.suffix} in the row of "
                "units"
            )
        return own.name, None if key in COLUMNS else own
    if there is not None and there.name in COLUMNS:
        return there.name, there
    return (key, None) if key in COLUMNS and key not in NUMBERS else None


def _twice(name: str, first: str, second: str) -> str:
    """Say that two columns are one."""
    if first == second:
        return f"expected column {name} once, got it twice"
    units = {our.unit if (our := our_name(x)) else "" for x in (first, second)}
    two = ": two units for one column" if len(units) > 1 else ""
    return f"expected column {name} once, got {shown(first)} and {shown(second)}{two}"


def _advice(name: str, *, strict: bool) -> str:
    """Say what to write in place of an unknown column."""
    if not name:
        return "; expected a name above every column that holds something"
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
    if strict:
        return f"; ours is column {ours.name}: multiply by {ours.factor:.9g}"
    return expected


def _check_all_there(table: Table, where: str, *, strict: bool) -> None:
    """Refuse a table that lacks what every row needs; a height left out is 0."""
    got = table.header
    missing = [name for name in NEEDED if name not in got]
    if any(name in got for name in VALUES) and "value" in missing:
        missing.remove("value")
    if missing:
        raise InputError(
            f"{where}: missing column {', '.join(missing)}; expected "
            f"{', '.join(NEEDED)}; got {', '.join(got) or 'none that is known'}"
        )
    partial = [name for name in POSITION if name not in got]
    if partial == ["up_m"] and not strict:
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
    """Return whether a name of a column is a quantity, in whatever unit."""
    found = our_name(name)
    return name in QUANTITIES or (found is not None and found.name in QUANTITIES)
