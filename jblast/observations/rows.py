r"""Rows of a log: checks of each column, and conversion into SI units.

A value is in the unit of its column (`value_kpa`), otherwise in the unit at the end of
the name of its quantity. A sigma is in the unit of its column (`sigma_percent`),
otherwise in that of its value. Products of value and unit are computed from the decimal
digits and rounded once. Peak levels in decibels become overpressures, and an error in
decibels becomes $\sigma_p = p \, \sigma_{dB} \ln 10 / 20$.

A fault names the line, the column, what was expected and what was found. Rows with
faults are left out where faults are gathered. A row equal to another one in all columns
is a fault. Rows without a value are skipped and reported.
"""

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float

from jblast.errors import InputError, foreign_digits, nearest, shown
from jblast.observations.clocks import (
    VALUE_UTC,
    converted_clock_times,
    take_clock_times,
)
from jblast.observations.dialects import NA_SPELT, Header, is_empty
from jblast.observations.grouping import some_rows
from jblast.observations.places import places_of
from jblast.observations.sources import Table
from jblast.observations.table import (
    DEGREES,
    NAME_COLUMNS,
    NUMBERS,
    POSITION,
    SAMPLES,
    Converted,
    EmptySkipped,
    Faults,
    LevelConverted,
    LongitudesWrapped,
    MadeLong,
    Observations,
    Renamed,
    Understood,
    row_word,
)
from jblast.quantities import ADDITIVE, CLOCK_TIMES, DIRECTIONS, QUANTITIES, TIMED
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

AT_LEAST = ">"
"""Mark before a value that is a lower bound."""
DATE = re.compile(r"\d{4}-\d{2}-\d{2}")
TIME_OF_DAY = re.compile(r"\d{1,2}:\d{2}")
MINUTES = re.compile(r"[NSEW]?\s*[+-]?\d+(\.\d+)?\s*([°ºd':\s]|[NSEW]$)")
"""A latitude or longitude in minutes, or with its hemisphere."""
THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:[\s'\u2019]\d{3})+(?:[.,]\d+)?")
"""Numbers with blanks or apostrophes between thousands."""
WITH_UNIT = re.compile(r"[+-]?\d[\d.,]*(?:[eE][+-]?\d+)?\s*[%A-Za-zµ°].*")


class Fields:
    """The body of a table by column, as text.

    Attributes:
        texts: Fields by column.
        lines: Line of each row.
        units: Of columns that are in another unit than ours.
        sound: True for rows without a fault so far.
        wide: For a wide table, by our column, the source column of each row.
    """

    def __init__(self, table: Table, header: Header, faults: Faults):
        self.path = table.source
        self.lines = table.lines
        self.word = row_word(table.source)
        self.faults = faults
        self.texts = dict(zip(table.header, table.columns, strict=True))
        self.theirs, self.units = header.theirs, header.units
        self.sound = np.ones(len(self.lines), bool)
        self.wide: Mapping[str, tuple[str, ...]] = {}
        if any(isinstance(found, MadeLong) for found in table.understood):
            names = self.text("quantity")
            self.wide = {"value": names, "sigma": tuple(f"sigma of {q}" for q in names)}

    def text(self, column: str) -> tuple[str, ...]:
        """Return a column of names; "" if the file has no such column."""
        return tuple(self.texts.get(column) or [""] * len(self.lines))

    def number(
        self, column: str, *, optional: bool = True
    ) -> Float[np.ndarray, " row"]:
        """Return a column of finite numbers; NaN where an optional one is empty.

        Numbers are in our unit, except in `value` and `sigma`, whose rows may have
        different units.
        """
        if column not in self.texts:
            return np.full(len(self.lines), np.nan)
        texts = self.texts[column]
        try:
            # columns without other text, the usual case, need no call per field
            numbers = np.array([float(text) if text else np.nan for text in texts])
        except ValueError:
            numbers = np.array([_number(text) for text in texts])
        odd = ~np.isfinite(numbers)
        if optional and odd.any():
            odd &= np.array([bool(text) for text in texts], bool)
        # float accepts 1_000, which is Python's notation and in data a mistake
        # and digits of other scripts, such as full-width ones
        joined = "".join(texts)
        if "_" in joined or foreign_digits(joined):
            odd |= np.array(["_" in t or foreign_digits(t) for t in texts], bool)
        self.refuse(
            odd,
            column,
            lambda row: f"a finite number, got {_with_advice(texts[row], column)}",
        )
        own = None if column in ANY else self.units.get(column)
        return numbers if own is None else in_si(numbers, own.unit)

    def refuse(
        self,
        bad: Bool[np.ndarray, " row"] | list[bool],
        column: str,
        expected: Callable[[int], str],
    ) -> None:
        """Report each bad row with the expected content of its column."""
        self.report(bad, column, lambda row: f"expected {expected(row)}")

    def report(
        self,
        bad: Bool[np.ndarray, " row"] | list[bool],
        column: str,
        message: Callable[[int], str],
    ) -> None:
        """Report each bad row with a message; it is left out."""
        if not np.any(bad):
            return
        theirs = self.theirs.get(column, column)
        for row in map(int, np.flatnonzero(bad)):
            self.sound[row] = False
            name = self.wide[column][row] if column in self.wide else theirs
            at = f", column {name}" if column else ""
            where = f"{self.path}: {self.word} {self.lines[row]}{at}"
            self.faults.add(InputError(f"{where}: {message(row)}"))


@dataclass
class Measured:
    """Quantities and units of the rows.

    Attributes:
        theirs: Quantities as written.
        quantity: Ours.
        units: Of quantities in another unit than ours, as written.
        columns: Units of columns that have one of their own.
    """

    theirs: tuple[str, ...]
    quantity: tuple[str, ...]
    units: dict[str, OurName]
    columns: Mapping[str, OurName]
    understood: list[Understood] = field(default_factory=list)

    def factors(self) -> Float[np.ndarray, " row"]:
        """Return the factors that convert values to our units; 1 for levels."""
        factors = np.ones(len(self.theirs))
        for unit, rows in self._by_unit():
            if unit is not None and unit.dimension != LEVEL:
                factors[rows] = unit.factor
        return factors

    def converts(self) -> bool:
        """Return whether anything has to be converted."""
        return bool(self.units) or bool(self.columns.keys() & {"value", "sigma"})

    def converted(
        self,
        value: Float[np.ndarray, " row"],
        sigma: Float[np.ndarray, " row"],
    ) -> tuple[Float[np.ndarray, " row"], Float[np.ndarray, " row"]]:
        """Return values and sigmas in our units.

        Args:
            value: Values as numbers; NaN for other text.
            sigma: Sigmas likewise.
        """
        if not self.converts():
            return value, sigma
        ours, errors = value.copy(), sigma.copy()
        for unit, rows in self._by_unit():
            level = unit is not None and unit.dimension == LEVEL
            if level:
                # too large a level overflows to infinity, which its row reports
                with np.errstate(over="ignore"):
                    ours[rows] = overpressure(value[rows])
            elif unit is not None:
                ours[rows] = in_si(value[rows], unit.unit)
            own = self.columns.get("sigma")
            if own is None and not level:
                errors[rows] = in_si(sigma[rows], unit.unit) if unit else sigma[rows]
            # an error in decibels is relative: ln 10 / 20 of the pressure per decibel
            elif own is None or own.dimension == LEVEL:
                errors[rows] = sigma[rows] * LN_PER_DB * ours[rows]
            elif own.dimension != SHARE:
                errors[rows] = in_si(sigma[rows], own.unit)
            elif level:
                errors[rows] = sigma[rows] * own.factor * ours[rows]
            else:
                share = in_si(ours[rows] * sigma[rows], own.unit)
                # the sign of a wrong negative sigma survives, and is refused later
                errors[rows] = np.copysign(share, sigma[rows])
        return ours, errors

    def _by_unit(self) -> Iterator[tuple[OurName | None, list[int]]]:
        """Yield each unit, None for ours, and the rows with values in it."""
        own = self.columns.get("value")
        if own is not None and own.dimension != LEVEL:
            yield own, list(range(len(self.theirs)))
            return
        rows: dict[str, list[int]] = {}
        for row, name in enumerate(self.theirs):
            rows.setdefault(name, []).append(row)
        for name, held in rows.items():
            yield self.units.get(name), held


class Rows(Fields):
    """The body of a log by column, and the checks that each column must pass."""

    def __init__(
        self,
        table: Table,
        header: Header,
        faults: Faults,
        *,
        date: str | None = None,
        zone: str | None = None,
    ):
        # before the columns are split, so that line numbers stay with their rows
        self.skipped: tuple[int, ...] = _drop_empty(table)
        super().__init__(table, header, faults)
        self.date, self.zone = date, zone
        self.comments, self.found = table.comments, table.understood

    def observations(self) -> Observations:
        """Check every column, and return a log of the rows without faults."""
        sensor = self.text("sensor")
        self.refuse(
            [not name for name in sensor], "sensor", lambda _: "a name, got nothing"
        )
        held = measured(self)
        self.texts["quantity"] = list(held.quantity)
        dated = np.zeros(len(self.lines), bool)
        if VALUE_UTC in self.texts:
            dated = np.array([bool(text) for text in self.texts[VALUE_UTC]], bool)
        self.texts.setdefault("value", [""] * len(dated))
        timing = converted_clock_times(
            self.texts.get(VALUE_UTC, []), self.date, self.zone
        )
        # fills column value, which is checked below
        epoch = take_clock_times(self, self.date, self.zone)
        kind = np.array(held.quantity)
        value, sigma, bound = self.measurements(held, dated)
        slant_range = self.number("range_m")
        position, frame = places_of(self)
        self.places(position, slant_range)
        time = self.number("time_s")
        timed = np.isin(kind, TIMED)
        self.refuse(
            timed & np.isnan(time),
            "time_s",
            lambda row: f"the time at which {held.theirs[row]} was taken, got nothing",
        )
        self.refuse(
            ~timed & ~np.isnan(time),
            "time_s",
            lambda row: (
                f"nothing, as only {', '.join(TIMED)} take a time, got "
                f"{self.texts['time_s'][row]} for {held.theirs[row]}"
            ),
        )
        named = {name: self.text(name) for name in NAME_COLUMNS}
        numbers = np.column_stack([value, sigma, position, slant_range, time, bound])
        self.duplicates(numbers, sensor, held.quantity, *named.values())
        understood = [*self.found, *converted_columns(self), *held.understood, *timing]
        if self.skipped:
            understood.append(EmptySkipped(self.skipped))
        wrapped = sum(_number(text) > 180.0 for text in self.texts.get("lon_deg", ()))
        if wrapped:
            understood.append(LongitudesWrapped(wrapped))
        whole = Observations(
            sensor=sensor,
            quantity=held.quantity,
            value=value,
            sigma=sigma,
            position=position,
            slant_range=slant_range,
            time=time,
            path=named["path"],
            shot=named["shot"],
            clock=named["clock"],
            record=named["record"] if any(named["record"]) else (),
            line=tuple(self.lines),
            source=self.path,
            comments=self.comments,
            lower_bound=bound if bound.any() else None,
            frame=frame,
            epoch=epoch,
            understood=tuple(understood),
        )
        if self.sound.all():
            return whole
        return some_rows(whole, np.flatnonzero(self.sound))

    def measurements(
        self, held: Measured, dated: Bool[np.ndarray, " row"]
    ) -> tuple[
        Float[np.ndarray, " row"], Float[np.ndarray, " row"], Bool[np.ndarray, " row"]
    ]:
        """Return values and sigmas in our units, and True for lower bounds.

        Args:
            held: Quantities and units of the rows.
            dated: Rows whose value is in seconds already, from a date and time.
        """
        kind = np.array(held.quantity)
        in_ln = ~np.isin(kind, ADDITIVE)
        sampled = take_samples(self, kind)
        bound = self.bounds(in_ln)
        raw = self.number("value", optional=False)
        value, sigma = held.converted(raw, self.number("sigma"))
        # clock times are seconds already, whatever unit the column has
        value = np.where(dated, raw, value)
        texts = self.texts["value"]
        self.refuse(
            np.isinf(value) & np.isfinite(raw),
            "value",
            lambda row: f"a number that is finite in our unit, got {texts[row]}",
        )
        self.refuse(
            in_ln & (value <= 0),
            "value",
            lambda row: f"a positive {held.theirs[row]}, got {texts[row]}",
        )
        factor = held.factors()
        # an angle beyond its bounds is most often in degrees
        for name, most in DIRECTIONS.items():
            self.refuse(
                (kind == name) & (np.abs(value) > most),
                "value",
                lambda row, most=most: (
                    f"{held.theirs[row]} within {most / factor[row]:.6g} "
                    f"{'rad ' if factor[row] == 1 else ''}either way, got {texts[row]}"
                    + ("; are these degrees?" if factor[row] == 1 else "")
                ),
            )
        self.refuse(
            sigma <= 0,
            "sigma",
            lambda row: (
                "a positive number, or nothing for the law's scatter alone, got "
                + self.texts["sigma"][row]
            ),
        )
        return np.where(sampled, np.nan, value), sigma, bound

    def bounds(self, in_ln: Bool[np.ndarray, " row"]) -> Bool[np.ndarray, " row"]:
        """Remove the marks of lower bounds, and return which rows had one."""
        texts = self.texts["value"]
        written = "".join(texts)
        if AT_LEAST not in written and "<" not in written:
            return np.zeros(len(texts), bool)
        bound = np.array([text.startswith(AT_LEAST) for text in texts], bool)
        self.refuse(
            bound & ~in_ln,
            "value",
            lambda row: (
                f"a number, as {self.texts['quantity'][row]} takes no lower bound, "
                f"got {texts[row]}"
            ),
        )
        self.refuse(
            [text.startswith(("<", ">=")) for text in texts],
            "value",
            lambda row: f"a number, or a lower bound as >0.12, got {texts[row]}",
        )
        self.texts["value"] = [text.removeprefix(AT_LEAST).strip() for text in texts]
        return bound

    def places(self, position: np.ndarray, slant_range: np.ndarray) -> None:
        """Refuse half a position, a position with a range, and a range below zero."""
        given = (~np.isnan(position)).sum(axis=1)
        for index, name in enumerate(POSITION):
            empty = np.array([not text for text in self.text(name)], bool)
            self.refuse(
                (given > 0) & np.isnan(position[:, index]) & empty,
                name,
                lambda _: f"all of {', '.join(POSITION)} or none of them, got nothing",
            )
        self.refuse(
            slant_range <= 0,
            "range_m",
            lambda row: (
                f"a positive slant range in m, got {self.texts['range_m'][row]}"
            ),
        )
        self.refuse(
            (given > 0) & ~np.isnan(slant_range),
            "range_m",
            lambda _: f"either range_m or {', '.join(POSITION)}, got both",
        )

    def duplicates(self, numbers: np.ndarray, *names: tuple[str, ...]) -> None:
        """Refuse two rows equal in every field."""
        # NaN is unequal to itself, so bytes are compared; adding 0 turns -0 into 0
        packed = [row.tobytes() for row in numbers + 0.0]
        first: dict[tuple[object, ...], int] = {}
        of = np.array(
            [
                first.setdefault(key, row)
                for row, key in enumerate(zip(packed, *names, strict=True))
            ]
        )
        self.refuse(
            self.sound & (of != np.arange(len(of))),
            "",
            lambda row: (
                "a new measurement, got a duplicate of line "
                f"{self.lines[of[row]]} in every column"
            ),
        )


def _drop_empty(table: Table) -> tuple[int, ...]:
    """Remove rows without a measurement, and return their lines.

    A time in `value_utc` is a value, too. Words for a missing value become empty.
    """
    for index, name in enumerate(table.header):
        if name in NUMBERS or name == VALUE_UTC:
            column = table.columns[index]
            if not NA_SPELT.isdisjoint(column):
                table.columns[index] = ["" if is_empty(t) else t for t in column]
    values = [
        table.columns[table.header.index(name)]
        for name in ("value", VALUE_UTC)
        if name in table.header
    ]
    if "" not in values[0]:
        return ()
    empty = {row for row, at in enumerate(zip(*values, strict=True)) if not any(at)}
    if "quantity" in table.header:
        kinds = table.columns[table.header.index("quantity")]
        empty = {row for row in empty if kinds[row] != SAMPLES}
    lines = tuple(table.lines[row] for row in sorted(empty))
    table.drop_rows(empty)
    return lines


def take_samples(rows: Fields, kind: np.ndarray) -> Bool[np.ndarray, " row"]:
    """Return True for records of samples, and set their value to 1.

    Args:
        rows: The log.
        kind: Quantity of each row.
    """
    sampled = kind == SAMPLES
    texts, files = rows.texts["value"], rows.text("record")
    rows.refuse(
        sampled & np.array([bool(text) for text in texts], bool),
        "value",
        lambda row: f"nothing, as {SAMPLES} is a file of samples, got {texts[row]}",
    )
    rows.refuse(
        sampled & np.array([not file for file in files], bool),
        "record",
        lambda _: "a file of samples, got nothing",
    )
    pairs = zip(sampled, texts, strict=True)
    rows.texts["value"] = ["1" if own else text for own, text in pairs]
    return sampled


def _with_advice(text: str, column: str) -> str:
    """Return a text that is not a number, with advice."""
    if not text:
        return "nothing"
    if DATE.match(text):
        return f"{shown(text)}, a date, into which spreadsheets convert 3.5 or 1-2"
    if TIME_OF_DAY.match(text):
        return f"{shown(text)}; a time of day belongs in column value_utc"
    if column == "sigma" and text.endswith("%"):
        return (
            f"{shown(text)}; a sigma is in the unit of its value; per cent of it "
            "belong in a column sigma_percent"
        )
    if column in DEGREES and MINUTES.match(text):
        return f"{shown(text)}; write decimal degrees, south and west below 0"
    if THOUSANDS.fullmatch(text):
        return f"{shown(text)}; write it without marks between thousands"
    if WITH_UNIT.fullmatch(text):
        return f"{shown(text)}; a unit belongs in the name of the column or quantity"
    return shown(text) + ("; write a decimal point" if "," in text else "")


def _number(text: str) -> float:
    """Return a field as a number; NaN for other text."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def measured(rows: Fields) -> Measured:
    """Identify the quantity of each row, and refuse unknown ones.

    Args:
        rows: The log.
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
        found = _meant(name, value, dated=name in dated)
        if found is None:
            unknown.add(name)
            names[name] = name
        else:
            names[name] = found.name
            units[name] = found
    if unknown:
        rows.report(
            [name in unknown for name in theirs],
            "quantity",
            lambda row: _unknown(theirs[row]),
        )
    quantity = tuple(names[name] for name in theirs) if units else theirs
    found = Measured(theirs, quantity, units, columns)
    _refuse_two_units(rows, found)
    for name, unit in units.items():
        count = theirs.count(name)
        if unit.dimension == LEVEL:
            found.understood.append(LevelConverted(name, count))
        elif unit.factor == 1.0:
            found.understood.append(Renamed(name, unit.name))
        elif "value" not in columns:
            converted = Converted(name, unit.name, unit.unit, unit.factor, count)
            found.understood.append(converted)
    return found


def _meant(name: str, value: OurName | None, *, dated: bool) -> OurName | None:
    """Return our quantity for a name, whose unit may be that of the column.

    The name of a clock time needs no unit next to a time in `value_utc`.
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
            + (", whose errors are not relative" if relative else "")
            + f", got one in {sigma.unit}"
        ),
    )


def _go_together(ours: str, unit: OurName | None, column: OurName) -> bool:
    """Return True if a quantity, with or without a unit, fits its column's unit."""
    if column.dimension == LEVEL:
        return unit is not None and unit.dimension == LEVEL
    if unit is None:
        return dimension_of(ours) == column.dimension
    return (unit.dimension, unit.factor) == (column.dimension, column.factor)


def converted_columns(rows: Fields) -> list[Understood]:
    """Return the conversions by column."""
    understood: list[Understood] = []
    for name, unit in rows.units.items():
        filled = sum(1 for text in rows.texts[name] if text)
        if unit.dimension == LEVEL:
            understood.append(LevelConverted(rows.theirs[name], filled))
        elif unit.factor != 1.0:
            theirs = rows.theirs[name]
            understood.append(Converted(theirs, name, unit.unit, unit.factor, filled))
    return understood


def _unknown(quantity: str) -> str:
    """Return the message for an unknown quantity, with advice."""
    message = f"unknown quantity {shown(quantity)}"
    if advice := what_to_write(quantity):
        return message + advice
    near = nearest(quantity, QUANTITIES)
    return f"{message}{near}; expected one of {', '.join(QUANTITIES)}"
