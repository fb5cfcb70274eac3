"""Samples as text: one sample a row, in columns of time and of pressure or volts.

The table is found by `text_table`. The lines above the samples, and text to the left of
the first ones, are the preamble of a logger, an oscilloscope or a seismograph. Units
and the time step are taken from it:

- units: in the names of columns (`time_ms`, `Time (ms)`, `CH1V`), in a row of their own
  next to them, or after a key of the preamble (`Vertical Units,V`); of two units
  (`mm/s and pa.(L)`) that of pressure belongs to the microphone;
- step: after a key of the preamble or below it (`Sample Interval,2e-5,s`,
  `Sample rate: 10 kHz`, `Increment`, `tInc = 2e-6s`). It gives the times of samples
  that are numbered or have no times, and the unit of times that have none.

Infinite numbers are samples beyond the range of the recorder. Times of day are refused:
the time of the first sample belongs into the table of stations.
"""

import math
import re
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, read_bytes, shown
from jblast.observations.records.recording import RATES, Clock, Column, Group
from jblast.observations.text_table import (
    COUNTS,
    TIME_WORDS,
    Table,
    cells_of,
    number_of,
    numbered,
    text_table,
)
from jblast.units import sample_unit, spelt

HEAD_BYTES = 2**16
"""Bytes by which the columns are recognised: a preamble and names lie within them."""
OVER_RANGE = 9.9e37
"""Number from which on a sample is beyond the range (SCPI-1999, 7.2.1.4)."""
STEP_TOLERANCE = 0.01
"""Largest relative difference of times from the stated step: steps are printed with
three digits or more."""
KEYS = {
    "step": (
        "sample_interval", "sampling_interval", "sample_period", "sampling_period",
        "sample_time", "increment", "x_increment", "xincrement", "xinc", "tinc", "dt",
        "delta_t", "delta_x", "time_step", "timestep", "time_interval", "step",
    ),
    "rate": (
        *(spelt(name) for name in RATES), "samplerate", "sampling_frequency",
        "sample_frequency", "samples_per_second", "abtastrate", "abtastfrequenz",
    ),
    "start": ("start", "t0", "x0", "xzero", "x_zero", "time_of_first_sample"),
    "before": ("pre_trigger_length", "pre_trigger", "pretrigger"),
    "time_unit": ("horizontal_units", "horizontal_unit", "x_unit", "x_units"),
    "unit": (
        "vertical_units", "vertical_unit", "y_unit", "y_units", "y_unit_label",
        "engineering_units", "engineering_unit", "eu", "unit", "units", "einheit",
    ),
}  # fmt: skip
"""Keys of a preamble by kind, in snake case."""
KIND_OF = {key: kind for kind, keys in KEYS.items() for key in keys}
RATE_UNITS = {
    "": 1.0, "hz": 1.0, "khz": 1e3, "mhz": 1e6, "sps": 1.0, "ksps": 1e3, "msps": 1e6,
    **{f"{prefix}{unit}_per_{second}": factor
       for prefix, factor in (("", 1.0), ("k", 1e3), ("m", 1e6))
       for unit in ("s", "sa", "samples", "1") for second in ("s", "sec", "second")},
}  # fmt: skip
"""Samples a second per unit of a sampling rate."""
MICROPHONES = ("mic", "air", "press", "overpress")
"""Beginnings of names of the channels of pressure among those of a seismograph."""
QUANTITY = r"([-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s].*)?"
"""A number and its unit, if any."""
THOUSANDS = r"(?<=[:=;\t])\s*[1-9]\d{0,2}(?:,\d{3})+(?![\d,])"
"""A number of a preamble with commas between thousands: 10,000 Hz."""


def open_text(path: Path, octets: int = -1) -> tuple[Group, ...]:
    """Return the columns of a text; of some rows at its beginning if `octets` is given.

    Raises:
        InputError: The text is not as described; the message names line and column.
    """
    expected = "names of columns and a sample a row"
    data = read_bytes(path, expected, octets)
    if len(data) == octets:
        # a character of UTF-16 has two bytes
        data = data[: data.rfind(b"\n") + 1 + data.startswith(b"\xff\xfe")]
    table = text_table(data, str(path), preamble=True, expected=expected)
    stated = _stated(table)
    columns = _columns(table, stated)
    _check_rows(table)
    clock, notes = stated.clock, stated.notes
    times = [at for at in table.numeric if columns[at].dimension == "time"]
    counter = None if times else _counter(table, columns, stated)
    order = times if counter is None else [counter]
    bare = [c for c in table.numeric if c not in order and not columns[c].its_unit]
    for c in bare:
        columns[c] = columns[c]._replace(unit=stated.units.get(c, ""))
    samples = [
        c
        for c, column in enumerate(columns)
        if column.dimension in ("pressure", "voltage") and c != counter
    ]
    if samples:
        found = table.numbers([*order, *samples], finite=False)
        if not np.isfinite(found[: len(order)]).all():
            table.numbers(order)
        numbers = dict(zip([*order, *samples], found, strict=True))
        if clock and not order and len(samples) > 1:
            steps = 1.0, 1.0 / clock.rate_hz
            even = (c for c in samples if c in bare and _is_even(numbers[c], steps))
            counter = next(even, None)
        stepped = None if times else clock
        if counter is not None:
            numbers[counter], is_counted = _seconds(
                table, columns[counter], numbers[counter], stated
            )
            columns[counter] = columns[counter]._replace(unit="s")
            stepped = clock if is_counted else None
        if stepped:
            notes += (f"times by the preamble: {1 / stepped.rate_hz:.9g} s per sample",)
        own = (stepped,) if stepped and counter is None else ()
        for c, values in numbers.items():
            columns[c] = _filled(table, columns[c], values)._replace(clocks=own)
    lines = table.lines
    return (Group(tuple(columns), notes, lambda n: f"line {lines[n]}"),)


def open_head(path: Path) -> tuple[Group, ...]:
    """Return the columns of a text with a few of their rows, for their names."""
    return open_text(path, HEAD_BYTES)


def _filled(
    table: Table, column: Column, numbers: Float[np.ndarray, " sample"]
) -> Column:
    """Return a column with its samples, clipped at the range of the recorder."""
    beyond = np.abs(numbers) >= OVER_RANGE
    level, notes = None, ()
    if beyond.any():
        within, signs = numbers[~beyond], np.sign(numbers[beyond])
        if not within.size:
            raise InputError(
                f"{table.at(table.first_line, column.name)}: expected samples, got no "
                "finite number; remove the column"
            )
        # a range with an offset is not symmetric: only the exceeded sides count
        level = max((sign * within).max() for sign in set(signs))
        level = float(level if level > 0 else np.abs(within).max())
        numbers[beyond] = level * signs
        notes = (f"{beyond.sum()} samples beyond the range of the recorder",)
    return column._replace(
        length=numbers.size,
        read=lambda start, stop: numbers[start:stop],
        full_scale=level,
        notes=notes,
    )


class _Stated(NamedTuple):
    """Contents of a preamble.

    Attributes:
        clock: Clock of the samples; None if there is no step in a known unit.
        time_unit: Unit of times; "" if not stated.
        units: Units of values by column.
        notes: Notes, a sentence each.
    """

    clock: Clock | None
    time_unit: str
    units: dict[int, str]
    notes: tuple[str, ...]


def _stated(table: Table) -> _Stated:
    """Return step, start and units of a preamble."""
    lines = takewhile(lambda one: one[0] < table.first_line, numbered(table.text))
    rows = [_cells(table, line.lstrip("# \t")) for _, line in lines]
    rows += [row.cells for row in table.preamble if row.line >= table.first_line]
    # number and unit by kind of key
    numbers: dict[str, tuple[float, str]] = {}
    time_unit, units, values = "", {}, table.numeric
    for cells, below in zip(rows, [*rows[1:], []], strict=False):
        for at, cell in enumerate(cells):
            kind, unit, inline = _key(cell)
            right = [inline] if inline else cells[at + 1 :]
            filled = [text for text in right if text]
            if kind == "time_unit" and filled and _dimension(filled[0]) == "time":
                time_unit = filled[0]
            elif kind == "unit" and not at and filled:
                # within a line it is the name of a column
                several = re.split(r"\s+and\s+", filled[0])
                if len(several) > 1:
                    units = {c: _of_two(table, c, several) for c in values}
                elif not all(map(_dimension, filled)):
                    continue
                elif len(set(filled)) == 1:
                    units = dict.fromkeys(values, filled[0])
                # one unit for each column, or units below the names
                elif len(filled) == len(values):
                    units = dict(zip(values, filled, strict=True))
                else:
                    units = dict(enumerate(right, start=1))
            elif kind and kind not in numbers:
                # the unit may be a field of its own
                beside = [
                    text
                    for text in filled[1:2]
                    if _dimension(text) == "time" or spelt(text) in RATE_UNITS
                ]
                for text in (" ".join([*filled[:1], *beside]), *below[at : at + 1]):
                    if number := re.fullmatch(QUANTITY, text):
                        value = float(number[1].replace(",", "."))
                        numbers[kind] = value, number[2] or unit
                        break
    notes = tuple(
        f"text that is not UTF-8 is read as {note.numbers['encoding']}"
        for note in table.notes
        if note.kind == "encoding"
    )
    lecroy = any(cells[0].lower().startswith("lecroy") for cells in rows)
    if lecroy and not (time_unit or units):
        time_unit, units = "s", dict.fromkeys(values, "V")
        notes += ("columns without a unit are read in s and V, as LeCroy writes them",)
    before_s, step_s, start_s = (
        value * sample_unit(unit or time_unit or "s").factor
        for value, unit in (
            numbers.get(kind, (0.0, "")) for kind in ("before", "step", "start")
        )
    )
    rate, unit = numbers.get("rate", (0.0, ""))
    rates = rate * RATE_UNITS.get(spelt(unit), 0.0)
    rate_hz = 1.0 / step_s if step_s > 0 else rates
    clock = Clock(rate_hz, start_s - abs(before_s)) if rate_hz > 0 else None
    return _Stated(clock, time_unit, units, notes)


def _of_two(table: Table, column: int, units: list[str]) -> str:
    """Return the unit of pressure for a microphone, another one for other columns."""
    name = table.header[column] if column < len(table.header) else ""
    is_microphone = name.lower().startswith(MICROPHONES)
    own = (one for one in units if is_microphone == (_dimension(one) == "pressure"))
    return next(own, "")


def _cells(table: Table, line: str) -> list[str]:
    """Return the fields of a line of the preamble."""
    if table.decimal == ".":
        line = re.sub(THOUSANDS, lambda found: found[0].replace(",", ""), line)
    marks = [
        mark for mark in (table.separator, ";", "\t", ",") if mark and mark in line
    ]
    return cells_of(line, marks[0]) if marks else [line.strip().strip('"').strip()]


def _key(cell: str) -> tuple[str | None, str, str]:
    """Return the kind of a key of the preamble, its unit, and its value within a cell.

    The kind is None for other cells: `Sample rate [Hz]`, `tInc = 2e-06s`.
    """
    key, _, value = (
        part.strip() for part in re.split("([:=])", f"{cell}:", maxsplit=1)
    )
    word, unit = key, ""
    if bracketed := re.fullmatch(r"(.*?)\s*[(\[](.*)[)\]]", key):
        word, unit = bracketed[1], bracketed[2]
    return KIND_OF.get(spelt(word)), unit, value.rstrip(":").strip()


def _dimension(unit: str) -> str:
    return sample_unit(unit).dimension


def _columns(table: Table, stated: _Stated) -> list[Column]:
    """Return the columns, still without samples.

    Raises:
        InputError: They have neither names nor a step or unit in the preamble.
    """
    width = 1 + max(table.numeric)
    kind, _, inline = _key(table.header[0] if table.header else "")
    values = [inline] if inline else [cell for cell in table.header[1:] if cell]
    if kind and values and (_dimension(values[0]) or re.fullmatch(QUANTITY, values[0])):
        # an entry of the preamble
        table.header = []
    if not table.header and (stated.clock or stated.time_unit or stated.units):
        table.header = [""] * width
    names = table.names("time_s,pressure_pa")
    names, units = (
        [*held, *[""] * (max(width, len(names)) - len(held))]
        for held in (names, table.units)
    )
    # numbers of rows have no unit
    return [
        Column(name, "" if spelt(unit) in COUNTS else unit)
        for name, unit in zip(names, units, strict=False)
    ]


def _check_rows(table: Table) -> None:
    """Raise an error for a row of numbers and other text below the names."""
    for row in table.preamble:
        below = table.header_line < row.line < table.first_line
        if row.is_comment or not below or row.line == table.units_line:
            continue
        cells = [row.cells[at] for at in table.numeric if at < len(row.cells)]
        bad = [math.isnan(number_of(cell, table.decimal)) for cell in cells]
        if any(bad) and not all(bad):
            raise InputError(
                f"{table.at(row.line)}: expected numbers as in line "
                f"{table.first_line}, got {shown(','.join(row.cells))}"
            )


def _counter(table: Table, columns: list[Column], stated: _Stated) -> int | None:
    """Return the column of times or numbers without a unit, by its name."""
    if stated.clock is None and not stated.time_unit:
        return None
    for at in table.numeric:
        word = spelt(columns[at].word)
        if {word, word.split("_")[0]} & {*COUNTS, *TIME_WORDS, "second", "seconds"}:
            return at
    if stated.clock is None and len(table.numeric) > 1:
        return table.numeric[0]
    return None


def _is_even(numbers: Float[np.ndarray, " sample"], steps: tuple[float, ...]) -> bool:
    """Return True for numbers that increase by one of some steps."""
    apart = np.diff(numbers)
    return bool(
        apart.size
        and (apart > 0).all()
        and np.isclose(np.median(apart), steps, rtol=STEP_TOLERANCE, atol=0.0).any()
    )


def _seconds(
    table: Table, column: Column, numbers: Float[np.ndarray, " sample"], stated: _Stated
) -> tuple[Float[np.ndarray, " sample"], bool]:
    """Return the times of a column without a unit, and whether it counts samples.

    Raises:
        InputError: They are not apart by the stated step.
    """
    clock = stated.clock
    apart = float(np.median(np.diff(numbers))) if numbers.size > 1 else math.nan
    if clock is not None and apart == 1.0:
        return clock.start_s + (numbers - numbers[0]) / clock.rate_hz, True
    step_s = apart if clock is None or stated.time_unit else 1.0 / clock.rate_hz
    if abs(apart - step_s) > STEP_TOLERANCE * step_s:
        raise InputError(
            f"{table.at(table.header_line, column.name)}: expected times {step_s:.6g} "
            f"s apart, as the preamble states, got {apart:.6g}; add a unit to the name "
            "of the column"
        )
    return numbers * sample_unit(stated.time_unit or "s").factor, False


def is_stations(path: Path) -> bool:
    """Return True if a text is a table of sensors or a log, not a record of samples."""
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        lines = (file.readline(HEAD_BYTES) for _ in range(200))
        header = next((x for x in lines if x.strip() and not x.startswith("#")), "")
    return any(
        spelt(cell) in ("sensor", "gauge") for cell in re.split("[,;\t]", header)
    )
