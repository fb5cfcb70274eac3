r"""Rows of a log: rules for each column, and conversion into SI units.

A value is in the unit of its column (`value_kpa`) or of the column `unit`, otherwise in
the unit at the end of the name of its quantity. A sigma is in the unit of its column
(`sigma_percent`), or a share with its % sign, otherwise in the unit of its value. Peak
levels in decibels become overpressures, and an error in decibels becomes $\sigma_p = p
\, \sigma_{dB} \ln 10 / 20$.

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
from jblast.observations.names import UNIT, Header, advised
from jblast.observations.positions import positions
from jblast.observations.rules import Rows, Rule
from jblast.observations.table import (
    NAME_COLUMNS,
    POSITION,
    SAMPLES,
    Observations,
    row_word,
    rows_by,
    some_rows,
)
from jblast.observations.text_table import Table
from jblast.quantities import ADDITIVE, DIRECTIONS, QUANTITIES, TIMED
from jblast.results import Note, conversion
from jblast.units import ANY, LEVEL, LN_PER_DB, SHARE, OurName, in_si, our_name

AT_LEAST = ">"
"""Mark before a value that is a lower bound."""
PER_CENT = OurName("sigma", 0.01, SHARE, "percent")
"""Unit of a sigma that ends in %."""
NONE = OurName("", 1.0, "", "")
"""Unit of samples and of unknown quantities."""


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
    held = dict(zip(table.header, table.columns, strict=True))
    nothing = [""] * len(table.lines)
    measured = [held.get(name, nothing) for name in ("value", VALUE_UTC, "quantity")]
    skipped = {
        row: table.lines[row]
        for row, (value, utc, kind) in enumerate(zip(*measured, strict=True))
        if not (value or utc or kind == SAMPLES)
    }
    if skipped:
        word = row_word(table.source) + ("" if len(skipped) == 1 else "s")
        lines = list(map(str, skipped.values()))
        note = conversion("empty_skipped", rows=len(lines), words=word, lines=lines)
        table.notes.append(note)
        where = table.at(table.lines[0])
        table.drop_rows(skipped)
        if not table.lines:
            raise InputError(f"{where}: expected a value in some row, got none")
    rows = Rows(table, header)
    meanings = _meanings(rows)
    theirs, units = [of for of, _ in meanings], [unit for _, unit in meanings]
    quantity = [unit.name or name for name, unit in meanings]
    own = rows.units.get("value")
    # a level is the quantity's own unit
    row_units = [own] * len(units) if own and own.dimension != LEVEL else units
    is_share = [len(text) > 1 and text.endswith("%") for text in rows.text("sigma")]
    error = rows.units.get("sigma")
    errors = [
        PER_CENT if share else error or unit
        for share, unit in zip(is_share, row_units, strict=True)
    ]
    kind, in_ln = np.array(quantity), ~np.isin(quantity, ADDITIVE)
    sampled, timed = kind == SAMPLES, np.isin(quantity, TIMED)
    seconds, epoch, found = clock_times(rows, kind, date, zone)
    texts = rows.text("value")
    bound = np.array([text.startswith(AT_LEAST) for text in texts], bool)
    has_value, unknown = rows.given("value"), ~np.isin(quantity, (*QUANTITIES, SAMPLES))
    odd_bound = [x == ">" or x.startswith(("<", ">=")) for x in texts]
    no_bound, no_value = (
        "a number, as {quantity} takes no lower bound",
        f"nothing, as {SAMPLES} is a file of samples",
    )

    def advice(row: int) -> str:
        name = theirs[row]
        return f"unknown quantity {shown(name)}{advised(name, tuple(QUANTITIES))}"

    rows.refuse(
        [
            Rule("sensor", ~rows.given("sensor"), "a name"),
            Rule("quantity", unknown, advice),
            *_unit_rules(rows, theirs, units, errors),
            Rule("value", sampled & has_value, no_value),
            Rule("record", sampled & ~rows.given("record"), "a file of samples"),
            Rule("value", bound & ~in_ln, no_bound),
            Rule("value", odd_bound, "a number, or a lower bound as >0.12"),
        ]
    )
    rows.texts["value"] = [text.removeprefix(AT_LEAST).strip() for text in texts]
    rows.texts["sigma"] = [
        text.removesuffix("%") if share else text
        for text, share in zip(rows.text("sigma"), is_share, strict=True)
    ]
    raw, raw_sigma = rows.number("value"), rows.number("sigma")
    value = np.where(rows.given(VALUE_UTC), seconds, _in_si(raw, row_units))
    sigma = _in_si(raw_sigma, errors, value)
    position, slant_range = positions(rows), rows.number("range_m")
    missing = np.isnan(position.enu)
    parts = missing & ~missing.all(axis=1, keepdims=True)
    twice = ~missing.all(axis=1) & ~np.isnan(slant_range)
    time, axes = rows.number("time_s"), ", ".join(POSITION)
    untimed = timed & np.isnan(time)
    only = ", ".join(TIMED)
    no_time = f"nothing, as only {only} take a time, got {{got}} for {{quantity}}"
    most = np.array([DIRECTIONS.get(name, np.inf) for name in quantity])

    def turn(row: int) -> str:
        unit = row_units[row]
        return (
            f"expected {theirs[row]} within {most[row] / unit.factor:.6g} {unit.unit} "
            f"either way, got {rows.text('value')[row]}"
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
                Rule(name, part & ~rows.given(name), f"all of {axes} or none of them")
                for name, part in zip(POSITION, parts.T, strict=True)
                if position.frame is None
            ),
            Rule("range_m", slant_range <= 0, "a positive slant range in m"),
            Rule("range_m", twice, f"either range_m or {axes}, got both"),
            Rule("time_s", untimed, "the time at which {quantity} was taken"),
            Rule("time_s", ~timed & ~np.isnan(time), no_time),
        ]
    )
    columns = ("sensor", *NAME_COLUMNS)
    named: dict[str, Any] = {name: tuple(rows.text(name)) for name in columns}
    numbers = np.column_stack([value, sigma, position.enu, slant_range, time, bound])
    _refuse_duplicates(rows, numbers, quantity, *named.values())
    if not any(named["record"]):
        named["record"] = ()
    conversions = _conversions(rows, theirs, units, sum(is_share))
    whole = Observations(
        **named,
        quantity=tuple(quantity),
        value=value,
        sigma=sigma,
        position=position.enu,
        slant_range=slant_range,
        time=time,
        line=tuple(table.lines),
        source=table.source,
        comments=table.comments,
        lower_bound=bound if bound.any() else None,
        frame=position.frame,
        epoch=epoch,
        understood=(*table.notes, *conversions, *found, *position.notes),
    )
    return whole if rows.sound.all() else some_rows(whole, np.flatnonzero(rows.sound))


def _meanings(rows: Rows) -> list[tuple[str, OurName]]:
    """Return the quantity of each row as written, and our name with its unit.

    The unit may be in the column `unit`. A quantity may have none next to a column of
    values with one, and a clock time next to a time in `value_utc`.
    """
    own = rows.units.get("value")

    def meaning(name: str, unit: str, utc: bool) -> tuple[str, OurName]:
        ours, stated = our_name(name), our_name(f"value_{unit}")
        if unit and not (ours and stated and ours[1:3] == stated[1:3]):
            name = f"{name}_{unit}"
        ends = ["", *(["_s"] if utc else []), *([f"_{own.unit}"] if own else [])]
        found = [our_name(f"{name}{end}") for end in ends]
        return name, next((of for of in found if of and of.name in QUANTITIES), NONE)

    names = rows.text("quantity"), rows.text(UNIT), rows.given(VALUE_UTC).tolist()
    keys = list(zip(*names, strict=True))
    found = {key: meaning(*key) for key in dict.fromkeys(keys)}
    return [found[key] for key in keys]


def _unit_rules(
    rows: Rows,
    theirs: Sequence[str],
    units: Sequence[OurName],
    errors: Sequence[OurName],
) -> list[Rule]:
    """Return rules that values and sigmas are in the units of their columns."""
    own = rows.units.get("value", NONE)

    def fits(name: str, unit: OurName) -> bool:
        # our own name goes with any unit of its dimension; a level has no factor
        same = name == unit.name or own.dimension == LEVEL or unit.factor == own.factor
        return not unit.name or (unit.dimension == own.dimension and same)

    def goes_with(unit: OurName, error: OurName) -> bool:
        if error.dimension in (SHARE, LEVEL):
            return unit.name not in ADDITIVE
        dimension = "pressure" if unit.dimension == LEVEL else unit.dimension
        return not unit.name or error.dimension == dimension

    def sigma(row: int) -> str:
        unit, got = units[row], errors[row].unit
        also = ", whose errors are not relative" if unit.name in ADDITIVE else ""
        return f"expected a sigma in the unit of {unit.name}{also}, got one in {got}"

    odd = [not fits(*pair) for pair in zip(theirs, units, strict=True)]
    error_odd = [not goes_with(*pair) for pair in zip(units, errors, strict=True)]
    of = f"a quantity in {own.unit}, the unit of column {rows.theirs.get('value')}"
    two = f"{of}, got {{got}}: two units for one column"
    return [
        *([Rule("quantity", odd, two)] if own.name else []),
        Rule("sigma", rows.given("sigma") & np.array(error_odd), sigma),
    ]


def _in_si(
    raw: Float[np.ndarray, " row"],
    units: Sequence[OurName],
    value: Float[np.ndarray, " row"] | None = None,
) -> Float[np.ndarray, " row"]:
    """Return numbers in our units; of errors, with the values that they belong to."""
    found = raw.copy()
    for unit in dict.fromkeys(units):
        if unit.factor == 1.0:
            continue
        rows = np.array([own == unit for own in units])
        if value is not None and unit.dimension == LEVEL:
            # an error in decibels is relative: ln 10 / 20 of the pressure per decibel
            found[rows] = raw[rows] * LN_PER_DB * value[rows]
        else:
            whole = 1.0 if unit.dimension != SHARE or value is None else value[rows]
            found[rows] = in_si(whole * raw[rows], unit.unit)
    return found


def _refuse_duplicates(rows: Rows, numbers: np.ndarray, *names: Sequence[str]) -> None:
    """Refuse two rows equal in every field."""
    # NaN is unequal to itself, so bytes are compared; adding 0 turns -0 into 0
    packed = [row.tobytes() for row in numbers + 0.0]
    alike = rows_by(zip(packed, *names, strict=True), rows.sound).values()
    first = {row: rows.lines[its[0]] for its in alike for row in its[1:]}
    word, again = row_word(rows.table.source), np.isin(range(len(packed)), [*first])

    def message(row: int) -> str:
        return f"expected a new measurement, got a duplicate of {word} {first[row]}"

    rows.refuse([Rule("", again, message)])


def _conversions(
    rows: Rows, theirs: Sequence[str], units: Sequence[OurName], shares: int
) -> list[Note]:
    """Return a note on each column and quantity in another unit or name."""
    found = converted_columns(rows)
    if shares:
        found.append(conversion("share", theirs="sigma in %", rows=shares))
    for name, unit in dict(zip(theirs, units, strict=True)).items():
        if unit.name in ("", name):
            continue
        if unit.factor == 1.0:
            found.append(conversion("renamed", theirs=name, ours=unit.name))
        elif "value" not in rows.units or unit.dimension == LEVEL:
            found.append(_converted(name, unit.name, unit, theirs.count(name)))
    return found


def converted_columns(rows: Rows) -> list[Note]:
    """Return a note on each column in another unit."""
    return [
        _converted(
            rows.theirs[name],
            "SI" if name in ANY else name,
            unit,
            int(rows.given(name).sum()),
            level="level_error" if name == "sigma" else "level",
        )
        for name, unit in rows.units.items()
        if unit.factor != 1.0
    ]


def _converted(
    theirs: str, ours: str, unit: OurName, rows: int, level: str = "level"
) -> Note:
    kinds = {LEVEL: level, SHARE: "share"}
    if kind := kinds.get(unit.dimension):
        return conversion(kind, theirs=theirs, rows=rows)
    numbers = {"theirs": theirs, "ours": ours, "factor": unit.factor, "rows": rows}
    return conversion("converted", **numbers)
