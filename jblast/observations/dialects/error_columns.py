"""The columns of a wide table that hold errors: of which quantity, in its unit or %."""

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import NamedTuple

from jblast.errors import InputError, shown
from jblast.observations.dialects.table import Table
from jblast.observations.dialects.tidying import UnitOf, is_empty
from jblast.quantities import ADDITIVE
from jblast.units import (
    LEVEL,
    LN_PER_DB,
    SHARE,
    OurName,
    our_name,
    products,
    unit_spelt,
)
from jblast.units.spelling import spelt

FOR_ALL = "sigma_percent"
"""The column that holds the errors of all quantities whose errors are a share."""


class ErrorColumn(NamedTuple):
    """A column of errors.

    Attributes:
        column: Which column, by number from zero.
        is_share: Whether they are per cent of the value.
        is_level: Whether that value is a level in dB.
    """

    column: int
    is_share: bool
    is_level: bool

    def sigma(self, value: str, written: str) -> str:
        """Return an error in the unit of its value, as a log has it.

        Args:
            value: The value as written.
            written: The error as written.
        """
        if not self.is_share or is_empty(written):
            return written
        value = "1" if self.is_level else value.lstrip("> ")
        (share,) = products(Fraction(1, 100), [value], [written])
        if not math.isfinite(share):  # what is no number is refused as it stands
            return written
        return repr(float(share / LN_PER_DB if self.is_level else share))


def error_columns(
    table: Table, held: Mapping[int, str], units_row: Mapping[str, UnitOf]
) -> dict[int, ErrorColumn]:
    """Return which column holds the errors of which.

    `sigma_QUANTITY` and `QUANTITY_sigma` are in the unit of QUANTITY; with `_percent`
    behind, or % in the row of units, they are a share of it. `sigma_percent` alone is
    that of every quantity whose errors are a share and that has no other.

    Args:
        table: A wide one.
        held: Quantities with their units by column.
        units_row: Units that a row of the table told, by column as written.

    Raises:
        InputError: A column is in another unit than its quantity, or per cent of what
            has no share, or belongs to none.
    """
    keys = [spelt(name) for name in table.header]
    found: dict[int, ErrorColumn] = {}
    for i, name in held.items():
        ours = our_name(name)
        for key, is_share in _names(spelt(table.header[i]), ours):
            if key in keys and i not in found:
                at = keys.index(key)
                is_share = is_share or _told_share(table, at, ours, units_row)
                _refuse_share_of_none(table, at, name, is_share=is_share)
                found[i] = ErrorColumn(at, is_share, _dimension(ours) == LEVEL)
    if FOR_ALL in keys:
        at = keys.index(FOR_ALL)
        for i, name in held.items():
            if i not in found and _ours(name) not in ADDITIVE:
                found[i] = ErrorColumn(at, True, _dimension(our_name(name)) == LEVEL)
    _refuse_idle(table, keys, held, {error.column for error in found.values()})
    return found


def _names(key: str, ours: OurName | None) -> list[tuple[str, bool]]:
    """Return what the errors of a column may be called, and whether they are shares."""
    names = [(f"sigma_{key}", False), (f"{key}_sigma", False)]
    stem = key if ours is None else key.removesuffix(f"_{ours.unit.lower()}")
    for of in dict.fromkeys((key, stem)):
        names += [(f"sigma_{of}_percent", True), (f"{of}_sigma_percent", True)]
    return names


def _told_share(
    table: Table, at: int, ours: OurName | None, units_row: Mapping[str, UnitOf]
) -> bool:
    """Return whether the row of units says that errors are per cent of their values.

    Raises:
        InputError: It tells another unit than that of the values.
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


def _refuse_share_of_none(table: Table, at: int, name: str, *, is_share: bool) -> None:
    """Refuse errors in per cent of what has errors in a unit alone."""
    if is_share and _ours(name) in ADDITIVE:
        raise InputError(
            f"{table.at(table.header_line)}, column {table.header[at]}: expected a "
            f"sigma in the unit of {name}, whose errors are no share of it, got %"
        )


def _refuse_idle(
    table: Table, keys: list[str], held: Mapping[int, str], used: set[int]
) -> None:
    """Refuse a column of errors that belongs to no quantity."""
    for i, key in enumerate(keys):
        words = key.split("_")
        if "sigma" not in (words[0], words[-1]) and words[-2:] != ["sigma", "percent"]:
            continue
        if i in used or i in held:
            continue
        raise InputError(
            f"{table.at(table.header_line)}: expected sigma_ and the name of a "
            f"quantity's column, as sigma_{spelt(table.header[min(held)])}, in its "
            f"unit, or {FOR_ALL}, of quantities whose errors are a share; got "
            f"{shown(table.header[i])}"
        )


def _ours(name: str) -> str:
    """Return which of our quantities a column is."""
    found = our_name(name)
    return found.name if found else name


def _dimension(ours: OurName | None) -> str:
    return "" if ours is None else ours.dimension
