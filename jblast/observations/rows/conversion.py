"""Which of our quantities each row of a log holds, and in which unit."""

import numpy as np

from jblast.errors import nearest, shown
from jblast.observations.rows.fields import Fields
from jblast.observations.rows.measured import Measured
from jblast.observations.table import SAMPLES
from jblast.observations.times.clock_times import COLUMN as VALUE_UTC
from jblast.observations.understood import (
    Converted,
    LevelConverted,
    Renamed,
    Understood,
)
from jblast.quantities import ADDITIVE, CLOCK_TIMES
from jblast.quantity_table import QUANTITIES
from jblast.units import LEVEL, SHARE, OurName, our_name, what_to_write
from jblast.units.names import dimension_of


def measured(rows: Fields, *, strict: bool) -> Measured:
    """Find which of our quantities each row holds, and refuse what is none.

    Args:
        rows: The log.
        strict: Whether quantities have to be ours to the letter.
    """
    theirs, columns = rows.text("quantity"), rows.units
    clocked = rows.texts.get(VALUE_UTC) or [""] * len(theirs)
    dated = {name for name, text in zip(theirs, clocked, strict=True) if text}
    names = {name: name for name in (*QUANTITIES, SAMPLES)}
    units: dict[str, OurName] = {}
    unknown: set[str] = set()
    for name in dict.fromkeys(theirs):
        if name in names:
            continue
        value = columns.get("value")
        found = None if strict else _meant(name, value, dated=name in dated)
        if found is None:
            unknown.add(name)
            names[name] = name
        else:
            names[name] = found.name
            units[name] = found
    if unknown:
        rows.tell(
            [name in unknown for name in theirs],
            "quantity",
            lambda row: _unknown(theirs[row], strict=strict),
        )
    quantity = tuple(names[name] for name in theirs) if units else theirs
    found = Measured(theirs, quantity, units, columns)
    _refuse_two_units(rows, found)
    _tell(found)
    return found


def _meant(name: str, value: OurName | None, *, dated: bool) -> OurName | None:
    """Return which of our quantities a name means; its unit may be the column's.

    A time of the day has its unit, too: beside one, the name of a time needs none.
    """
    found = our_name(name)
    if found is None and dated and f"{name}_s" in CLOCK_TIMES:
        return our_name(f"{name}_s")
    if found is None and value is not None:
        found = our_name(f"{name}_{value.unit}")
    return found if found is not None and found.name in QUANTITIES else None


def _refuse_two_units(rows: Fields, found: Measured) -> None:
    """Refuse values whose column and quantity are in different units, or dimensions."""
    own, sigma = found.columns.get("value"), found.columns.get("sigma")
    if own is not None:
        odd = {
            name
            for name, ours in set(zip(found.theirs, found.quantity, strict=True))
            if not _go_together(ours, found.units.get(name), own)
        }
        rows.refuse(
            rows.sound & np.array([name in odd for name in found.theirs], bool),
            "quantity",
            lambda row: (
                f"a quantity in {own.unit}, the unit of column "
                f"{rows.theirs['value']}, got {found.theirs[row]}: two units for one "
                "column"
            ),
        )
    if sigma is None:
        return
    empty = [not text for text in rows.text("sigma")]
    relative = sigma.dimension in (SHARE, LEVEL)
    odd = {
        ours
        for ours in set(found.quantity)
        if (ours in ADDITIVE if relative else dimension_of(ours) != sigma.dimension)
    }
    odd_rows = [
        ours in odd and not nothing
        for ours, nothing in zip(found.quantity, empty, strict=True)
    ]
    rows.refuse(
        rows.sound & np.array(odd_rows, bool),
        "sigma",
        lambda row: (
            f"a sigma in the unit of {found.theirs[row]}"
            + (", whose errors are no share of it" if relative else "")
            + f", got one in {sigma.unit}"
        ),
    )


def _go_together(ours: str, unit: OurName | None, column: OurName) -> bool:
    """Return whether a quantity, in a unit of its own or none, fits its column's."""
    if column.dimension == LEVEL:
        return unit is not None and unit.dimension == LEVEL
    if unit is None:
        return dimension_of(ours) == column.dimension
    return (unit.dimension, unit.factor) == (column.dimension, column.factor)


def _tell(found: Measured) -> None:
    """Note what is converted, once for each name."""
    for name, unit in found.units.items():
        rows = found.theirs.count(name)
        if unit.dimension == LEVEL:
            found.understood.append(LevelConverted(name, rows))
        elif unit.factor == 1.0:
            found.understood.append(Renamed(name, unit.name))
        elif "value" not in found.columns:
            found.understood.append(
                Converted(name, unit.name, unit.unit, unit.factor, rows)
            )


def told_columns(rows: Fields) -> list[Understood]:
    """Return what is converted by column."""
    understood: list[Understood] = []
    for name, unit in rows.units.items():
        filled = sum(1 for text in rows.texts[name] if text)
        if unit.dimension == LEVEL:
            understood.append(LevelConverted(rows.theirs[name], filled))
        elif unit.factor != 1.0:
            theirs = rows.theirs[name]
            understood.append(Converted(theirs, name, unit.unit, unit.factor, filled))
    return understood


def _unknown(quantity: str, *, strict: bool) -> str:
    """Say what to write in place of an unknown quantity."""
    said = f"unknown quantity {shown(quantity)}"
    ours = our_name(quantity) if strict else None
    if ours is not None:
        level = ours.dimension == LEVEL
        times = "" if level else f": multiply by {ours.factor:.9g}"
        return f"{said}; ours is {ours.name}{times}"
    if advice := what_to_write(quantity):
        return said + advice
    near = nearest(quantity, QUANTITIES)
    return f"{said}{near}; expected one of {', '.join(QUANTITIES)}"
