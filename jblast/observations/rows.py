r"""Rows of a log: rules for each column, and conversion into SI units.

A value is in the unit of its column (`value_kpa`) or of the column `unit`, otherwise in
the unit at the end of the name of its quantity. A sigma is in the unit of its column
(`sigma_percent`), otherwise in that of its value. Peak levels in decibels become
overpressures, and an error in decibels becomes $\sigma_p = p \, \sigma_{dB} \ln 10 /
20$.

A rule has the rows that violate it and the expected content. Its faults name the line,
the column, what was expected and what was found. Rows with faults are left out where
faults are gathered. A row equal to another one in all columns is a fault. Rows without
a value are skipped and reported.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, shown
from jblast.observations.instants import VALUE_UTC, clock_times
from jblast.observations.names import UNIT, Header, similar
from jblast.observations.positions import positions
from jblast.observations.rules import Rows, Rule
from jblast.observations.table import (
    NAME_COLUMNS,
    NUMBERS,
    POSITION,
    SAMPLES,
    Observations,
    row_word,
    some_rows,
)
from jblast.observations.text_table import NA_WORDS, Table, has_letters, is_text
from jblast.quantities import ADDITIVE, DIRECTIONS, QUANTITIES, TIMED
from jblast.results import Note, assumption
from jblast.units import (
    ANY,
    LEVEL,
    LN_PER_DB,
    SHARE,
    OurName,
    dimension_of,
    in_si,
    our_name,
    overpressure,
    what_to_write,
)

POSITIVE_SIGMA = "a positive number, or nothing for the law's scatter alone"
AT_LEAST = ">"
"""Mark before a value that is a lower bound."""


def observations_of(
    table: Table, header: Header, date: str | None = None, zone: str | None = None
) -> Observations:
    """Check every column, and return a log of the rows without faults.

    Args:
        table: A table with our names; rows without a value are removed.
        header: Names and units of its columns.
        date: The day of clock times without one.
        zone: Their zone.

    Raises:
        InputError: No row has a value.
    """
    if skipped := _drop_empty(table):
        table.notes.append(
            assumption(
                "empty_skipped",
                rows=len(skipped),
                words=row_word(table.source) + ("" if len(skipped) == 1 else "s"),
                lines=list(map(str, skipped)),
            )
        )
    if not table.lines:
        n = len(skipped)
        raise InputError(
            f"{table.at(skipped[0])}: expected a value in some row, got "
            + (f"{n} rows without a value" if n > 1 else "a row without a value, alone")
        )
    rows = Rows(table, header)
    theirs = _with_units(rows)
    units = _units_of(rows, theirs)
    quantity = [unit.name if unit else name for name, unit in zip(theirs, units)]  # noqa: B905 (equal)
    own = rows.units.get("value")
    # a level is the quantity's own unit
    row_units = [own] * len(units) if own and own.dimension != LEVEL else units
    kind, in_ln = np.array(quantity), ~np.isin(quantity, ADDITIVE)
    sampled, timed = kind == SAMPLES, np.isin(quantity, TIMED)
    seconds, epoch, found = clock_times(rows, kind, date, zone)
    dated = rows.given(VALUE_UTC)
    bound = np.array([text.startswith(AT_LEAST) for text in rows.text("value")], bool)
    odd_bound = [text.startswith(("<", ">=")) for text in rows.text("value")]
    known = np.isin(quantity, (*QUANTITIES, SAMPLES))
    no_value = f"nothing, as {SAMPLES} is a file of samples"
    rows.refuse(
        [
            Rule("sensor", ~rows.given("sensor"), "a name"),
            Rule(
                "quantity",
                ~known,
                lambda row: _unknown(theirs[row], rows.text("value")[row]),
            ),
            *_unit_rules(rows, quantity, units),
            Rule("value", sampled & rows.given("value"), no_value),
            Rule("record", sampled & ~rows.given("record"), "a file of samples"),
            Rule(
                "value", bound & ~in_ln, "a number, as {quantity} takes no lower bound"
            ),
            Rule("value", odd_bound, "a number, or a lower bound as >0.12"),
        ]
    )
    stripped = [text.removeprefix(AT_LEAST).strip() for text in rows.text("value")]
    filled = zip(sampled | dated, stripped, strict=True)
    rows.texts["value"] = ["1" if other else text for other, text in filled]
    raw = rows.number("value", optional=False)
    value, sigma = _converted(
        raw, rows.number("sigma"), row_units, rows.units.get("sigma")
    )
    rows.texts["value"] = stripped
    value = np.where(dated, seconds, np.where(sampled, np.nan, value))
    position, slant_range = positions(rows), rows.number("range_m")
    placed = (~np.isnan(position.enu)).sum(axis=1)
    time, axes = rows.number("time_s"), ", ".join(POSITION)
    most = np.array([DIRECTIONS.get(name, np.inf) for name in quantity])
    factors = [unit.factor if unit else 1.0 for unit in row_units]

    def turn(row: int) -> str:
        ours = factors[row] == 1
        return (
            f"expected {theirs[row]} within {most[row] / factors[row]:.6g} "
            f"{'rad ' if ours else ''}either way, got {rows.texts['value'][row]}"
            # an angle beyond its bounds is most often in degrees
            + ("; are these degrees?" if ours else "")
        )

    rows.refuse(
        [
            Rule("value", np.isinf(value) & np.isfinite(raw), "a number finite in SI"),
            Rule("value", in_ln & (value <= 0), "a positive {quantity}"),
            Rule("value", np.abs(value) > most, turn),
            Rule(
                "sigma", sigma <= 0, "a positive number, or nothing for scatter alone"
            ),
            *(
                Rule(
                    name,
                    (placed > 0) & np.isnan(axis) & ~rows.given(name),
                    f"all of {axes} or none of them",
                )
                for name, axis in zip(POSITION, position.enu.T, strict=True)
                if position.frame is None
            ),
            Rule("range_m", slant_range <= 0, "a positive slant range in m"),
            Rule(
                "range_m",
                (placed > 0) & ~np.isnan(slant_range),
                f"either range_m or {axes}, got both",
            ),
            Rule(
                "time_s",
                timed & np.isnan(time),
                "the time at which {quantity} was taken",
            ),
            Rule(
                "time_s",
                ~timed & ~np.isnan(time),
                f"nothing, as only {', '.join(TIMED)} take a time, got {{got}} for "
                "{quantity}",
            ),
        ]
    )
    named = {name: tuple(rows.text(name)) for name in NAME_COLUMNS}
    numbers = np.column_stack([value, sigma, position.enu, slant_range, time, bound])
    _refuse_duplicates(rows, numbers, rows.text("sensor"), quantity, *named.values())
    notes = [*table.notes, *_conversions(rows, theirs, units), *found, *position.notes]
    whole = Observations(
        sensor=tuple(rows.text("sensor")),
        quantity=tuple(quantity),
        value=value,
        sigma=sigma,
        position=position.enu,
        slant_range=slant_range,
        time=time,
        path=named["path"],
        shot=named["shot"],
        clock=named["clock"],
        record=named["record"] if any(named["record"]) else (),
        line=tuple(table.lines),
        source=table.source,
        comments=table.comments,
        lower_bound=bound if bound.any() else None,
        frame=position.frame,
        epoch=epoch,
        understood=tuple(notes),
    )
    return whole if rows.sound.all() else some_rows(whole, np.flatnonzero(rows.sound))


def _drop_empty(table: Table) -> list[int]:
    """Remove rows without a measurement, and return their lines.

    A time in `value_utc` is a value, too. Words for a missing value become empty.
    """
    for index, name in enumerate(table.header):
        if name in (*NUMBERS, VALUE_UTC):
            column = table.columns[index]
            table.columns[index] = ["" if t.lower() in NA_WORDS else t for t in column]
    columns = dict(zip(table.header, table.columns, strict=True))
    nothing = [""] * len(table.lines)
    values, dates = (columns.get(name, nothing) for name in ("value", VALUE_UTC))
    empty = {
        row
        for row, kind in enumerate(columns.get("quantity", nothing))
        if not (values[row] or dates[row] or kind == SAMPLES)
    }
    lines = [table.lines[row] for row in sorted(empty)]
    table.drop_rows(empty)
    return lines


def _with_units(rows: Rows) -> list[str]:
    """Return the quantities as written, with their units of the column `unit`."""

    def whole(name: str, unit: str) -> str:
        own, stated = our_name(name), our_name(f"value_{unit}")
        same = own and stated and own[1:3] == stated[1:3]
        return name if same or not unit else f"{name}_{unit}"

    pairs = list(zip(rows.text("quantity"), rows.text(UNIT), strict=True))
    names = {pair: whole(*pair) for pair in dict.fromkeys(pairs)}
    return [names[pair] for pair in pairs]


def _units_of(rows: Rows, theirs: Sequence[str]) -> list[OurName | None]:
    """Return our quantity and the unit of each row; None for our own names.

    A quantity may have no unit next to a column of values with one, and a clock time
    next to a time in `value_utc`.
    """
    own, known = rows.units.get("value"), {*QUANTITIES, SAMPLES}

    def meant(name: str, *, dated: bool) -> OurName | None:
        if name in known:
            return None
        found = our_name(name)
        if found is None and dated:
            found = our_name(f"{name}_s")
        if found is None and own is not None:
            found = our_name(f"{name}_{own.unit}")
        return found if found is not None and found.name in QUANTITIES else None

    pairs = list(zip(theirs, map(bool, rows.text(VALUE_UTC)), strict=True))
    units = {pair: meant(pair[0], dated=pair[1]) for pair in dict.fromkeys(pairs)}
    return [units[pair] for pair in pairs]


def _unit_rules(
    rows: Rows, quantity: Sequence[str], units: Sequence[OurName | None]
) -> list[Rule]:
    """Return rules that values and sigmas are in the units of their columns."""
    rules = []
    known = np.isin(quantity, (*QUANTITIES, SAMPLES))
    if (own := rows.units.get("value")) is not None:

        def fits(name: str, unit: OurName | None) -> bool:
            if own.dimension == LEVEL:
                return unit is not None and unit.dimension == LEVEL
            if unit is None:
                return dimension_of(name) == own.dimension
            return (unit.dimension, unit.factor) == (own.dimension, own.factor)

        odd = [not fits(*pair) for pair in zip(quantity, units, strict=True)]
        whose = f"a quantity in {own.unit}, the unit of column {rows.theirs['value']}"
        message = f"{whose}, got {{got}}: two units for one column"
        rules.append(Rule("quantity", known & odd, message))
    if (sigma := rows.units.get("sigma")) is not None:
        relative = sigma.dimension in (SHARE, LEVEL)
        odd = [
            name in ADDITIVE if relative else dimension_of(name) != sigma.dimension
            for name in quantity
        ]
        also = ", whose errors are not relative" if relative else ""
        message = f"a sigma in the unit of {{quantity}}{also}, got one in {sigma.unit}"
        rules.append(Rule("sigma", known & rows.given("sigma") & odd, message))
    return rules


def _converted(
    raw: Float[np.ndarray, " row"],
    raw_sigma: Float[np.ndarray, " row"],
    units: Sequence[OurName | None],
    error: OurName | None,
) -> tuple[Float[np.ndarray, " row"], Float[np.ndarray, " row"]]:
    """Return values and sigmas in our units.

    Args:
        raw: Values as numbers.
        raw_sigma: Sigmas as numbers.
        units: Unit of each row; None for ours.
        error: Unit of the column of sigmas, if it has one of its own.
    """
    value, sigma = raw.copy(), raw_sigma.copy()
    for unit in dict.fromkeys(units):
        rows = np.array([own == unit for own in units])
        level = unit is not None and unit.dimension == LEVEL
        if level:
            # too large a level overflows to infinity, which its row reports
            with np.errstate(over="ignore"):
                value[rows] = overpressure(raw[rows])
        elif unit is not None:
            value[rows] = in_si(raw[rows], unit.unit)
        of = error or unit
        if of is None:
            continue
        if of.dimension == LEVEL:
            # an error in decibels is relative: ln 10 / 20 of the pressure per decibel
            sigma[rows] = raw_sigma[rows] * LN_PER_DB * value[rows]
        elif of.dimension == SHARE:
            sigma[rows] = in_si(value[rows] * raw_sigma[rows], of.unit)
        else:
            sigma[rows] = in_si(raw_sigma[rows], of.unit)
    return value, sigma


def _refuse_duplicates(rows: Rows, numbers: np.ndarray, *names: Sequence[str]) -> None:
    """Refuse two rows equal in every field."""
    # NaN is unequal to itself, so bytes are compared; adding 0 turns -0 into 0
    packed = [row.tobytes() for row in numbers + 0.0]
    first: dict[tuple[Any, ...], int] = {}
    keys = enumerate(zip(packed, *names, strict=True))
    of = np.array([first.setdefault(key, row) for row, key in keys])
    word = row_word(rows.table.source)

    def message(row: int) -> str:
        line = rows.lines[int(of[row])]
        return f"expected a new measurement, got a duplicate of {word} {line}"

    rows.refuse([Rule("", rows.sound & (of != np.arange(len(of))), message)])


def _conversions(
    rows: Rows, theirs: Sequence[str], units: Sequence[OurName | None]
) -> list[Note]:
    """Return a note on each column and quantity in another unit or name."""
    found = converted_columns(rows)
    for name, unit in dict(zip(theirs, units, strict=True)).items():
        if unit is None:
            continue
        count = theirs.count(name)
        if unit.dimension == LEVEL:
            found.append(assumption("level", theirs=name, rows=count))
        elif unit.factor == 1.0:
            found.append(assumption("renamed", theirs=name, ours=unit.name))
        elif "value" not in rows.units:
            note = assumption(
                "converted", theirs=name, ours=unit.name, factor=unit.factor, rows=count
            )
            found.append(note)
    return found


def converted_columns(rows: Rows) -> list[Note]:
    """Return a note on each column in another unit."""
    found = []
    for name, unit in rows.units.items():
        theirs, filled = rows.theirs[name], int(rows.given(name).sum())
        ours = "SI" if name in ANY else name
        if unit.dimension == LEVEL:
            kind = "level" if name == "value" else "level_error"
            found.append(assumption(kind, theirs=theirs, rows=filled))
        elif unit.dimension == SHARE:
            found.append(assumption("share", theirs=theirs, rows=filled))
        elif unit.factor != 1.0:
            note = assumption(
                "converted", theirs=theirs, ours=ours, factor=unit.factor, rows=filled
            )
            found.append(note)
    return found


def _unknown(quantity: str, value: str) -> str:
    """Return the message for an unknown quantity, with advice."""
    if has_letters(value) and is_text(value):
        return (
            f"unknown quantity {shown(quantity)} with the value {shown(value)}; is "
            "this a second header? Keep one table per file"
        )
    known = f"; expected one of {', '.join(QUANTITIES)}"
    advice = what_to_write(quantity) or similar(quantity, tuple(QUANTITIES)) + known
    return f"unknown quantity {shown(quantity)}{advice}"
