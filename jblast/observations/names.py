"""Names and units of the columns of a table, and wide tables.

A column or quantity is identified by its name and the unit at the end of the name, or
by a row of units. Columns of notes are ignored. Advice for an unknown name is searched
by its meaning first and then by its spelling.

A wide table has a column for each quantity and is made long, one measurement a row. Its
errors are in columns `sigma_NAME`, in the unit of the column NAME, or in
`sigma_percent`, for all quantities whose errors are relative.
"""

from collections.abc import Sequence

from jblast.errors import InputError, argument, closest, shown
from jblast.observations.table import COLUMNS, NAME_COLUMNS, NEEDED, NUMBERS, rows_by
from jblast.observations.text_table import NA_WORDS, Table, take_decimal_commas
from jblast.quantities import ADDITIVE, QUANTITIES, TIMED
from jblast.results import conversion
from jblast.units import (
    ANY,
    SIMILAR_NAMES,
    OurName,
    our_name,
    spelt,
    unit_spelt,
    what_to_write,
)

UNIT = "unit"
"""Column of the units of values, which end the names of their quantities."""
CALLED = {"gauge": "sensor", "units": UNIT}
"""Other names of columns without a unit."""
NOTES = ("note", "notes")
"""First words of the names of columns that are ignored."""
NAMES = ("sensor", "quantity", *NAME_COLUMNS, UNIT)
"""Columns without numbers and dates."""
FOR_ALL = "sigma_percent"
"""Column of the errors of all quantities whose errors are relative."""


Header = dict[str, tuple[str, OurName | None]]
"""By our column its name as written, and its unit, if it has one."""


def read_header(table: Table, known: Sequence[str] = (*COLUMNS, UNIT)) -> Header:
    """Rename a table's columns to our names.

    Args:
        table: The table; its header is changed, unknown columns are removed and added
            to its faults, and columns of notes are removed.
        known: Names of the columns that it may have.

    Raises:
        InputError: A column is repeated, or has two units.
    """
    where = table.at(table.header_line)
    header: Header = {}
    dropped, notes, held = set(), [], held_quantities(table)
    for index, theirs in enumerate(table.header):
        name, unit = _column(table, index, known)
        if name not in known:
            dropped.add(index)
            if spelt(theirs).partition("_")[0] in NOTES:
                notes.append(theirs)
                continue
            advice = advised(theirs, known)
            if not theirs:
                advice = "; expected a name above every column that is not empty"
            elif of := held.get(index):
                advice = (
                    f"; it is a quantity, not a column: expected one measurement per "
                    f"row, {of} in column quantity and its number in column value; or "
                    f"read a wide table with {argument('wide')}"
                )
            fault = f"{where}: unknown column {shown(theirs)}{advice}"
            table.faults.append(InputError(fault, line=table.header_line))
            continue
        if name in header:
            both = f"{shown(header[name][0])} and {shown(theirs)}"
            raise InputError(f"{where}: expected column {name} once, got {both}")
        header[name] = theirs, unit
        key = spelt(theirs)
        if key != name and name not in ANY and (unit is None or unit.factor == 1.0):
            table.notes.append(conversion("renamed", theirs=theirs, ours=name))
        table.header[index] = name
    if notes:
        table.notes.append(conversion("columns_ignored", names=notes))
    kept = [index for index in range(len(table.header)) if index not in dropped]
    table.header = [table.header[index] for index in kept]
    table.units = [table.units[index] for index in kept]
    table.columns = [table.columns[index] for index in kept]
    return header


def _column(
    table: Table, index: int, known: Sequence[str]
) -> tuple[str, OurName | None]:
    """Return our name of a column, and its unit, if it has one.

    Raises:
        InputError: The row of units has another unit than the name.
    """
    theirs, stated = table.header[index], table.units[index]
    key, own = spelt(theirs), our_name(theirs)
    if stated and own is not None and own.name in known:
        # units are compared by dimension and factor: kPa and kilopascal are the same
        same = our_name(f"value_{stated}")
        if same is None or (same.dimension, same.factor) != (own.dimension, own.factor):
            raise InputError(
                f"{table.at(table.units_line, theirs)}: expected one unit per column, "
                f"got {own.unit} in its name and {stated} in the row of units"
            )
    for found in (own, our_name(f"{theirs}_{stated}") if stated else None):
        if found is not None and found.name in known:
            return found.name, found
    # a number in an unknown unit is no number of ours
    return "" if stated and key in NUMBERS else CALLED.get(key, key), None


def advised(name: str, known: Sequence[str]) -> str:
    """Return advice for an unknown name: by its unit, its meaning, or its spelling."""
    ours = {x: x for x in known}
    ours |= {word: x for word, x in SIMILAR_NAMES.items() if x in known}
    similar = closest(name, ours)
    near = f"; did you mean {ours[similar]}?" if similar else ""
    return what_to_write(name) or f"{near}; expected some of {', '.join(known)}"


def check_all_there(table: Table) -> None:
    """Raise an error for missing columns of a log; a height left out is 0."""
    got = table.header
    needed = ["value_utc" if x == "value" and "value_utc" in got else x for x in NEEDED]
    if missing := [name for name in needed if name not in got]:
        raise InputError(
            f"{table.at(table.header_line)}: missing column {', '.join(missing)}; "
            f"expected {', '.join(NEEDED)}; got {', '.join(got) or 'no known column'}"
        )
    # surveys on level ground have no heights
    if {"east_m", "north_m"} <= set(got) and "up_m" not in got:
        table.header.append("up_m")
        east = table.columns[got.index("east_m")]
        table.columns.append(["0" if text else "" for text in east])
        table.notes.append(conversion("height_taken"))


def quantity_of(name: str) -> str:
    """Return our quantity for a column's name in any unit; "" for other names."""
    found = our_name(name)
    ours = name if found is None else found.name
    return ours if ours in QUANTITIES else ""


def clean_numbers(table: Table) -> None:
    """Empty the fields of numbers and dates without a value; take decimal commas.

    Raises:
        InputError: A number has two readings.
    """
    keys = [CALLED.get(key, key) for key in map(spelt, table.header)]
    held = [
        i
        for i, key in enumerate(keys)
        if key not in NAMES and key.partition("_")[0] not in NOTES
    ]
    for i in held:
        column = table.columns[i]
        table.columns[i] = ["" if x.lower() in NA_WORDS else x for x in column]
    take_decimal_commas(table, [i for i in held if keys[i] != "value_utc"])


def held_quantities(table: Table) -> dict[int, str]:
    """Return the columns of quantities, and their names with units."""
    held = {}
    for index, (name, unit) in enumerate(zip(table.header, table.units, strict=True)):
        for whole in filter(quantity_of, (name, f"{name}_{unit}")):
            held.setdefault(index, whole)
    return held


def made_long(table: Table) -> None:
    """Make one measurement per row of a wide table, sensor by sensor.

    An empty cell is no measurement. Rows of quantities without a column of errors have
    no sigma.

    Args:
        table: Table with a column for each quantity, as `peak_overpressure_kpa`, which
            is changed.

    Raises:
        InputError: The table has no such column, or two of a quantity, or a column of
            errors without its quantity.
    """
    where = table.at(table.header_line)
    keys = [spelt(name) for name in table.header]
    expected = f"{where}: expected a wide table, a column for each quantity; got"
    held = held_quantities(table)
    if not held:
        advice = next(filter(None, map(what_to_write, table.header)), "")
        raise InputError(f"{expected} {', '.join(map(shown, table.header))}{advice}")
    for alike in rows_by(map(quantity_of, held.values())).values():
        if len(alike) > 1:
            one, other = (shown([*held.values()][i]) for i in alike[:2])
            raise InputError(
                f"{where}: expected a column for each quantity, got {one} and {other}: "
                "two units for one column"
            )
    errors = _error_columns(table, held)
    others = [i for i in range(len(keys)) if i not in {*held, *errors.values()}]
    cells = table.columns
    picked = [
        (row, i) for row in range(len(table.lines)) for i in held if cells[i][row]
    ]
    timed = {i for i, name in held.items() if quantity_of(name) in TIMED}

    def sigma(row: int, i: int) -> str:
        text = cells[errors[i]][row] if i in errors else ""
        return f"{text}%" if text and keys[errors[i]] == FOR_ALL else text

    def unchanged(at: int) -> list[str]:
        # other quantities have no time
        needs = None if not keys[at].startswith("time") else timed
        return [
            cells[at][row] if needs is None or i in needs else "" for row, i in picked
        ]

    table.columns = [
        *map(unchanged, others),
        [held[i] for _, i in picked],
        [cells[i][row] for row, i in picked],
        [sigma(row, i) for row, i in picked],
    ]
    table.header = [*(table.header[i] for i in others), "quantity", "value", "sigma"]
    table.units = [*(table.units[i] for i in others), "", "", ""]
    table.lines = [table.lines[row] for row, _ in picked]
    table.is_wide = True
    table.notes.append(conversion("made_long", names=list(held.values())))
    if missing := [name for i, name in held.items() if i not in errors]:
        table.notes.append(conversion("no_errors", names=missing))


def _error_columns(table: Table, held: dict[int, str]) -> dict[int, int]:
    """Return the column of errors of each column of values.

    Raises:
        InputError: A column is in another unit than its quantity, or belongs to none.
    """
    at = {spelt(name): i for i, name in enumerate(table.header)}
    found = {}
    for i, name in held.items():
        if (own := f"sigma_{spelt(table.header[i])}") in at:
            found[i] = at[own]
            unit, its = table.units[at[own]], table.units[i]
            if unit and unit_spelt(unit) != unit_spelt(its):
                raise InputError(
                    f"{table.at(table.units_line, table.header[at[own]])}: expected "
                    f"{its or 'no unit'}, the unit of its quantity, got {unit}"
                )
        elif FOR_ALL in at and quantity_of(name) not in ADDITIVE:
            found[i] = at[FOR_ALL]
    for key, i in at.items():
        if "sigma" in key.split("_") and i not in {*found.values(), *held}:
            raise InputError(
                f"{table.at(table.header_line)}: expected sigma_ and the name of a "
                f"quantity's column, as sigma_{spelt(table.header[min(held)])}, in its "
                f"unit, or {FOR_ALL}, of quantities whose errors are relative; got "
                f"{shown(table.header[i])}"
            )
    return found
