"""Wide tables, a column for each quantity, made long: a row for each measurement."""

from collections.abc import Callable

from jblast.errors import InputError, argument, shown
from jblast.observations.dialects.decimals import take_decimal_commas
from jblast.observations.dialects.error_columns import error_columns
from jblast.observations.dialects.header import is_quantity
from jblast.observations.dialects.table import Table
from jblast.observations.dialects.tidying import UnitOf, is_empty
from jblast.observations.table import NAMED
from jblast.observations.understood import MadeLong
from jblast.quantities import TIMED
from jblast.units import our_name
from jblast.units.spelling import spelt

NAMES = ("sensor", "value_utc", *NAMED)
"""Columns of a wide table that hold no numbers."""


def refuse_wide(table: Table, units_row: dict[str, UnitOf]) -> None:
    """Refuse a table with a column for each quantity, and say how it is made long.

    Raises:
        InputError: It is one.
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
        f"wide table, with {len(held)} of them; expected a measurement a row, {one} in "
        f"column quantity and its number in column value; or read it with "
        f"{argument('wide')}"
    )


def made_long(table: Table, units_row: dict[str, UnitOf]) -> Table:
    """Return a wide table as one measurement a row, sensor by sensor.

    A column `sigma_QUANTITY` or `QUANTITY_sigma` holds the errors of QUANTITY in the
    same unit, `sigma_percent` those of all that are a share (`error_columns`); without
    one its rows have no sigma. An empty cell is no measurement.

    Args:
        table: Has a column for each quantity, as `peak_overpressure_kpa`.
        units_row: Units told by a row of the table; those of quantities are taken.

    Raises:
        InputError: It has no such column, or has `quantity` or `value` besides, or
            errors of nothing.
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

    timed = {i for i, name in held.items() if _ours(name) in TIMED}
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
    """Return a name with the unit that a row of units told, if a quantity has it."""
    stated = units_row.get(name)
    if stated is None or is_quantity(name):
        return name
    with_unit = f"{name}_{stated.suffix}"
    return with_unit if is_quantity(with_unit) else name


def _refuse_twice(where: str, held: dict[int, str]) -> None:
    """Refuse two columns of one quantity."""
    first: dict[str, str] = {}
    for name in held.values():
        other = first.setdefault(_ours(name), name)
        if other != name:
            raise InputError(
                f"{where}: expected a column for each quantity, got {shown(other)} and "
                f"{shown(name)}: two units for one column"
            )


def _ours(name: str) -> str:
    """Return which of our quantities a column is."""
    found = our_name(name)
    return found.name if found else name
