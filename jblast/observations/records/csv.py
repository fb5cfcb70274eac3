"""Samples as text: one sample a row, in columns of time and of pressure or volts.

The samples begin at the first run of rows with numbers in the same columns. The lines
above them, and text to the left of the first samples, are the preamble of a logger or
an oscilloscope. Names, units and the time step are taken from it:

- names: the last line above the samples with as many fields, or such a comment, as
  `numpy.savetxt` writes it;
- units: in the names (`time_ms`, `Time (ms)`, `CH1V`), in a row of their own next to
  them, or after a key of the preamble (`Vertical Units,V`);
- step: after a key of the preamble or below it (`Sample Interval,2e-5,s`,
  `Sample rate: 10 kHz`, `Increment`, `tInc = 2e-6s`). It gives the times of samples
  that are numbered or have no times, and the unit of times that have none.

Separators are commas, semicolons, tabs or blanks; with any but the first a decimal
comma is understood. Lines that begin with # are comments. Text that is not UTF-8 is
read as Windows-1252. Infinite numbers are samples beyond the range of the recorder.
Times of day are refused: the time of the first sample belongs into the table of
stations.
"""

import math
import re
from array import array
from codecs import getincrementaldecoder
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jblast.errors import InputError, shown
from jblast.observations.records.recording import (
    IGNORED,
    RATES,
    Recording,
    Scaling,
    channel_names,
    columns_of,
    even_clock,
    left_out,
    named_channels,
    plain_unit,
    pressure_factor,
    scale_of,
    time_factor,
    volts_factor,
    word_and_unit,
)
from jblast.units import spelt

SEPARATORS = (";", "\t", ",", None)
"""Separators in the order in which they are searched; None for blanks."""
MAX_HEAD_LINES = 200
"""Largest number of lines before the samples: headers of oscilloscopes have tens."""
RUN_ROWS = 5
"""Rows with numbers in the same columns that are samples: a preamble has pairs of such
rows (ranges, offsets), hardly five."""
HEAD_BYTES = 2**16
"""Bytes by which the encoding is recognised: a preamble and names lie within them."""
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
    "time_unit": ("horizontal_units", "horizontal_unit", "x_unit", "x_units"),
    "unit": (
        "vertical_units", "vertical_unit", "y_unit", "y_units", "y_unit_label",
        "engineering_units", "engineering_unit", "eu", "unit", "units", "einheit",
    ),
}  # fmt: skip
"""Keys of a preamble by kind, in snake case."""
KIND_OF = {key: kind for kind, keys in KEYS.items() for key in keys}
CONVENTIONS = {"lecroy": ("s", "V")}
"""Beginnings of preambles whose writers omit units, with those of times and values."""
RATE_UNITS = {
    "": 1.0, "hz": 1.0, "khz": 1e3, "mhz": 1e6, "s_s": 1.0, "ks_s": 1e3, "ms_s": 1e6,
    "sps": 1.0, "ksps": 1e3, "msps": 1e6, "sa_s": 1.0, "ksa_s": 1e3, "msa_s": 1e6,
    "samples_s": 1.0, "samples_sec": 1.0, "samples_per_second": 1.0, "1_s": 1.0,
}  # fmt: skip
"""Samples a second per unit of a sampling rate."""
NUMBERED = ("sequence", "index", "sample", "number", "n", "no", "nr", "point")
TIME_WORDS = ("time", "t", "x", "elapsed", "zeit", "second", "seconds")
"""First words of columns of numbered samples, and of times."""
QUANTITY = r"([-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s].*)?"
"""A number and its unit, if any."""
THOUSANDS = r"(?<=[:=;\t])\s*[1-9]\d{0,2}(?:,\d{3})+(?![\d,])"
"""A number of a preamble with commas between thousands: 10,000 Hz."""
INFINITY = "\N{INFINITY}"
"""Sign of oscilloscopes for a sample beyond the range."""


def open_csv(path: Path, scaling: Scaling) -> tuple[Recording, ...]:
    """Return the recording of a text: one channel for each column of pressure.

    Columns with samples beyond the range are recordings of their own, with a full
    scale.

    Raises:
        InputError: The text is not as described; the message names line and column.
    """
    table = table_at(path)
    named = list(table.names)
    if table.numbered is not None:
        named[table.numbered] = "time_s"
    columns = columns_of(
        named, f"{path}: line {table.header}", clocked=table.step is not None
    )
    # without a column of times or numbers the clock is that of the preamble
    clock = () if columns.time is None else (columns.time,)
    wanted = (*clock, *columns.pressures)
    numbers, lines = _numbers(path, table, wanted, timed=bool(clock))
    if not clock:
        numbers = np.vstack([np.arange(numbers.shape[1], dtype=float), numbers])

    def place(sample: int) -> str:
        column = f", column {table.names[clock[0]]}" if clock else ""
        return f"{path}: line {lines[sample]}{column}"

    # in seconds first, so that messages and the rounded rate are in SI units
    times_s = columns.seconds * numbers[0]
    if table.step is not None:
        times_s = table.step.start_s + table.step.step_s * (numbers[0] - numbers[0, 0])
    start_s, rate_hz = even_clock(times_s, place)
    names = [table.names[at] for at in columns.pressures]
    scales = [
        scale_of(unit, scaling, f"{path}: column {name}")
        for name, unit in zip(names, columns.units, strict=True)
    ]
    samples = np.array([scale.factor for scale in scales])[:, None] * numbers[1:]
    beyond = np.isinf(samples)
    channels = named_channels(path.stem, [word_and_unit(name)[0] for name in names])
    aliases = channel_names(path.stem, len(samples))
    notes = (*table.notes, *left_out(columns.left_out, "columns left out"))

    def recording(of: list[int], full_scale: float | None, *more: str) -> Recording:
        held = samples if len(of) == len(samples) else samples[of]
        return Recording(
            source=str(path),
            names=tuple(channels[at] for at in of),
            labels=tuple(f"column {names[at]}" for at in of),
            rate_hz=rate_hz,
            length=held.shape[1],
            read=lambda start, stop: held[:, start:stop],
            start_s=start_s,
            full_scale=full_scale,
            notes=(*notes, *more),
            first_line=int(lines[0]),
            aliases=tuple(aliases[at] for at in of),
        )

    whole = [at for at in range(len(samples)) if not beyond[at].any()]
    found = [recording(whole, None)] if whole else []
    for at in np.flatnonzero(beyond.any(axis=1)).tolist():
        level = _range_of(samples[at], beyond[at])
        samples[at, beyond[at]] = np.copysign(level, samples[at, beyond[at]])
        note = f"{beyond[at].sum()} samples beyond the range of the recorder"
        found.append(recording([at], level, note))
    return tuple(found)


def _range_of(
    samples: Float[np.ndarray, " sample"], beyond: Bool[np.ndarray, " sample"]
) -> float:
    """Return the smallest symmetric range of a recorder with samples beyond it."""
    within = samples[~beyond]
    # a range with an offset is not symmetric: only the exceeded sides count
    sides = [sign for sign in (1.0, -1.0) if (sign * samples[beyond] > 0).any()]
    level = max((sign * within).max() for sign in sides)
    return float(level if level > 0 else np.abs(within).max())


def is_stations(path: Path) -> bool:
    """Return True if a text is a table of sensors or a log, not a record of samples."""
    try:
        names = table_at(path).names
    except InputError:
        return False
    return "sensor" in (name.strip().lower() for name in names)


class Step(NamedTuple):
    """Clock of the preamble.

    Attributes:
        start_s: Time of the first sample [s].
        step_s: Time between samples [s].
    """

    start_s: float
    step_s: float


class Table(NamedTuple):
    """Layout of a text of samples.

    Attributes:
        names: Names of the columns, with units.
        separator: Separator of the columns; None for blanks.
        decimal: Decimal mark: a point or a comma.
        header: Line of the names, or of the first sample without them.
        first: Line of the first sample.
        encoding: Encoding of the text.
        step: Clock of samples that are numbered or have no times; None for a column
            of times.
        numbered: Column of the numbers of samples; None without one.
        notes: Notes, a sentence each.
    """

    names: list[str]
    separator: str | None
    decimal: str
    header: int
    first: int
    encoding: str
    step: Step | None = None
    numbered: int | None = None
    notes: tuple[str, ...] = ()


def _numbers(
    path: Path, table: Table, wanted: tuple[int, ...], *, timed: bool
) -> tuple[Float[np.ndarray, "column sample"], array]:
    """Return columns as numbers, infinite beyond the range, and the line of each row.

    Raises:
        InputError: A cell is not a number, or a time is not finite.
    """
    # an array of integers: a list of them takes four times the memory
    lines = array("q")

    def rows() -> Iterator[str]:
        for number, line in lines_of(path, table.encoding):
            if number >= table.first:
                lines.append(number)
                if not line.isascii():
                    line = line.replace(INFINITY, "inf")
                yield line.replace(",", ".") if table.decimal == "," else line

    try:
        # NumPy's parser is much faster than float of each field; errors are located
        # afterwards
        numbers = np.loadtxt(
            rows(),
            delimiter=table.separator,
            comments=None,
            usecols=wanted,
            ndmin=2,
        ).T
    except ValueError:
        raise _bad_cell(path, table, wanted, timed=timed) from None
    numbers = np.ascontiguousarray(numbers)
    samples = numbers[1:] if timed else numbers
    beyond = np.abs(samples) >= OVER_RANGE
    samples[beyond] = np.copysign(np.inf, samples[beyond])
    bad = np.isnan(numbers).any() or (timed and np.isinf(numbers[0]).any())
    if bad or not np.isfinite(samples).any(axis=1).all():
        raise _bad_cell(path, table, wanted, timed=timed)
    return numbers, lines


def _bad_cell(
    path: Path, table: Table, wanted: tuple[int, ...], *, timed: bool
) -> InputError:
    """Return the error that names the first cell without a number, or infinite time."""
    # a column without any number is probably not one of samples: a different advice
    filled: set[int] = set()
    for number, line in lines_of(path, table.encoding):
        if number >= table.first:
            cells = cells_of(line, table.separator)
            there = [at for at in wanted if at < len(cells)]
            filled.update(
                at
                for at in there
                if abs(_number(cells[at], table.decimal)) < OVER_RANGE
            )
    for at in wanted:
        if at not in filled:
            return InputError(
                f"{path}: line {table.first}, column {table.names[at]}: expected "
                "samples, got no finite number; remove the column"
            )
    for number, line in lines_of(path, table.encoding):
        if number < table.first:
            continue
        cells = cells_of(line, table.separator)
        if len(cells) <= max(wanted):
            return InputError(
                f"{path}: line {number}: expected {len(table.names)} fields as in the "
                f"header, got {len(cells)}"
            )
        for at in wanted:
            number_there = _number(cells[at], table.decimal)
            is_time = timed and at == wanted[0]
            if math.isnan(number_there) or (is_time and math.isinf(number_there)):
                got = shown(cells[at]) if cells[at] else "nothing"
                return InputError(
                    f"{path}: line {number}, column {table.names[at]}: expected a "
                    f"number, got {got}"
                )
    return InputError(f"{path}: expected numbers below line {table.header}")


class _Head(NamedTuple):
    """First lines of a text.

    Attributes:
        rows: Number and text of the lines that are not comments.
        comments: Those of the comments above the samples, without their sign.
        separator: Separator of the samples.
        at: Number of the first row of samples.
        columns: Columns with numbers.
    """

    rows: list[tuple[int, str]]
    comments: list[tuple[int, str]]
    separator: str | None
    at: int
    columns: tuple[int, ...]

    def cells(self, row: int) -> list[str]:
        """Return the fields of a row."""
        return cells_of(self.rows[row][1], self.separator)

    def values(self, column: int) -> Float[np.ndarray, " row"]:
        """Return the numbers in a column of the rows of samples."""
        rows = (self.cells(row) for row in range(self.at, len(self.rows)))
        mark = "." if self.separator == "," else ","
        found = [_number(cells[column], mark) for cells in rows if column < len(cells)]
        return np.array([number for number in found if math.isfinite(number)])


def table_at(path: Path) -> Table:
    """Return the layout of a text by its first lines.

    Raises:
        InputError: The file is not text, or has neither names above its numbers nor a
            preamble that states their step or unit.
    """
    encoding, notes = _encoding(path)
    head = _head(path, encoding)
    decimal = _decimal(path, head)
    preamble = _preamble(head, decimal)
    stated = _stated(preamble, head)
    for beginning, (of_times, of_values) in CONVENTIONS.items():
        unstated = not (stated.time_unit or stated.alone or stated.units)
        if unstated and any(row[0].lower().startswith(beginning) for row in preamble):
            stated = stated._replace(time_unit=of_times, alone=of_values)
            notes += (f"columns without a unit are read in {of_times} and {of_values}",)
    names, header = _names(path, head, stated)
    step, numbered = stated.step(), None
    timed = any(time_factor(word_and_unit(names[c])[1]) for c in head.columns)
    clock = None if timed else _clock(head, names, stated, step)
    if clock is not None and (step or stated.time_unit):
        times = head.values(clock)
        apart = float(np.median(np.diff(times))) if times.size > 1 else math.nan
        if step and apart == 1.0:
            numbered = clock
        else:
            if step and not stated.time_unit:
                _check_apart(
                    apart, step, f"{path}: line {header}, column {names[clock]}"
                )
            names[clock], timed = f"{names[clock]} ({stated.time_unit or 's'})", True
    step = None if timed else step
    if step is not None:
        notes += (f"times by the preamble: {step.step_s:.9g} s per sample",)
    for at in head.columns:
        if at != clock and names[at] and not word_and_unit(names[at])[1]:
            unit = stated.units.get(at, stated.alone)
            names[at] = f"{names[at]} ({unit})" if unit else names[at]
    return Table(
        names,
        head.separator,
        decimal,
        header,
        head.rows[head.at][0],
        encoding,
        step,
        numbered,
        notes,
    )


def _encoding(path: Path) -> tuple[str, tuple[str, ...]]:
    """Return the encoding of a text by its first bytes, with notes.

    Raises:
        InputError: The file is not text.
    """
    with path.open("rb") as file:
        start = file.read(HEAD_BYTES)
    # spreadsheets write UTF-16, and UTF-8 with a mark
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16", ()
    if b"\0" in start:
        raise InputError(
            f"{path}: expected text with columns of time and pressure, got a binary "
            "file"
        )
    try:
        getincrementaldecoder("utf-8")().decode(start)
    except UnicodeDecodeError:
        return "cp1252", ("text that is not UTF-8 is read as Windows-1252",)
    return "utf-8-sig", ()


def _head(path: Path, encoding: str) -> _Head:
    """Return the first lines of a text, and the first row of samples.

    Raises:
        InputError: There are fewer than two lines.
    """
    rows: list[tuple[int, str]] = []
    comments: list[tuple[int, str]] = []
    for number, line in islice(
        lines_of(path, encoding, comments=True), MAX_HEAD_LINES + RUN_ROWS
    ):
        comment = line.lstrip().startswith("#")
        (comments if comment else rows).append((number, line))
    found = _run(rows, 2) or _run(rows, 1)
    if len(rows) < 2 and (found is None or not comments):
        raise InputError(
            f"{path}: expected names of columns and a sample a row, got "
            + ("one line" if rows else "none")
        )
    if found is None:
        # names, and a first row without a number
        separator = next(s for s in SEPARATORS if s is None or s in rows[0][1])
        width = len(cells_of(rows[1][1], separator))
        found = separator, 1, tuple(range(width))
    first = rows[found[1]][0]
    above = [(n, line.lstrip("# \t")) for n, line in comments if n < first]
    return _Head(rows, above, *found)


def _run(
    rows: list[tuple[int, str]], least: int
) -> tuple[str | None, int, tuple[int, ...]] | None:
    """Return separator, first row and columns of the first run of numbers.

    Args:
        rows: Lines with their numbers.
        least: Number of columns: of one column all later rows are samples.
    """
    found = []
    for order, separator in enumerate(SEPARATORS):
        cells = [cells_of(line, separator) for _, line in rows]
        mark = "." if separator == "," else ","
        numeric = [
            frozenset(c for c, cell in enumerate(row) if not _is_text(cell, mark))
            for row in cells
        ]
        for at in range(len(rows)):
            ahead = numeric[at : at + RUN_ROWS] if least > 1 else numeric[at:]
            columns = frozenset.intersection(*ahead)
            if len(columns) < least:
                continue
            # a faulty cell does not move the first row: it is reported later
            while at and _may_be_samples(
                cells[at - 1], cells[at], numeric, at, columns
            ):
                at -= 1
            # the right separator leaves the fewest fields of text
            others = sum(bool(cell) and _is_text(cell, mark) for cell in cells[at])
            fewest = (at, others, -len(cells[at]), order)
            found.append((fewest, separator, tuple(sorted(columns))))
            break
    if not found:
        return None
    fewest, separator, columns = min(found, key=lambda one: one[0])
    return separator, fewest[0], columns


def _may_be_samples(
    above: list[str],
    row: list[str],
    numeric: list[frozenset[int]],
    at: int,
    columns: frozenset[int],
) -> bool:
    """Return True if the row above a row of samples has numbers and no words there."""
    some = columns & numeric[at - 1]
    words = any(
        re.search("[A-Za-z]", above[c]) for c in columns - some if c < len(above)
    )
    return bool(some) and len(above) == len(row) and not words


def _preamble(head: _Head, decimal: str) -> list[list[str]]:
    """Return the fields of the lines above the samples, and of those left of them."""
    fields = []
    for _, line in [*head.rows[: head.at], *head.comments]:
        if decimal == ".":
            line = re.sub(THOUSANDS, lambda found: found[0].replace(",", ""), line)
        separators = [s for s in (head.separator, ";", "\t", ",") if s and s in line]
        fields.append(cells_of(line, separators[0]) if separators else [line.strip()])
    if head.columns[0]:
        left = [
            head.cells(row)[: head.columns[0]] for row in range(head.at, len(head.rows))
        ]
        fields += left
    return fields


class _Stated(NamedTuple):
    """Contents of a preamble.

    Attributes:
        numbers: Number and unit by kind of key: step, rate, start.
        time_unit: Unit of times; "" if not stated.
        units: Units of values by column.
        alone: Unit of all values; "" if not stated.
    """

    numbers: dict[str, tuple[float, str]]
    time_unit: str
    units: dict[int, str]
    alone: str

    def step(self) -> Step | None:
        """Return the clock; None if there is no step in a known unit."""
        start, unit = self.numbers.get("start", (0.0, ""))
        start_s = start * (time_factor(unit or self.time_unit or "s") or 0.0)
        step, unit = self.numbers.get("step", (0.0, ""))
        step_s = step * (time_factor(unit or self.time_unit or "s") or 0.0)
        if step_s <= 0 and "rate" in self.numbers:
            rate, unit = self.numbers["rate"]
            rate_hz = rate * RATE_UNITS.get(plain_unit(unit), 0.0)
            step_s = 1.0 / rate_hz if rate_hz > 0 else 0.0
        return Step(start_s, step_s) if step_s > 0 else None


def _stated(preamble: list[list[str]], head: _Head) -> _Stated:
    """Return step, start and units of a preamble."""
    stated = _Stated({}, "", {}, "")
    for cells, below in zip(preamble, [*preamble[1:], []], strict=False):
        for at, cell in enumerate(cells):
            kind, unit, inline = _key(cell)
            right = [inline] if inline else cells[at + 1 :]
            filled = [text for text in right if text]
            if kind == "time_unit":
                if filled and time_factor(filled[0]):
                    stated = stated._replace(time_unit=filled[0])
            elif kind == "unit":
                # within a line it is the name of a column
                if at or not (filled and all(map(_is_unit, filled))):
                    continue
                # one unit for each column, or units below the names
                columns, units = range(1, 1 + len(right)), right
                if len(filled) == len(head.columns) > 1:
                    columns, units = head.columns, filled
                of = {c: one for c, one in zip(columns, units, strict=True) if one}
                alone = filled[0] if len(set(filled)) == 1 else ""
                stated = stated._replace(units=of, alone=alone)
            elif kind and kind not in stated.numbers:
                # the unit may be a field of its own
                beside = " ".join([*filled[:1], *filter(_is_clock_unit, filled[1:2])])
                for text in (beside, *below[at : at + 1]):
                    if number := re.fullmatch(QUANTITY, text):
                        value = float(number[1].replace(",", "."))
                        stated.numbers[kind] = value, number[2] or unit
                        break
    return stated


def _is_clock_unit(text: str) -> bool:
    """Return True for a unit of time or of a sampling rate."""
    return bool(time_factor(text) or RATE_UNITS.get(plain_unit(text)))


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


def _is_entry(cells: list[str]) -> bool:
    """Return True for a line of a preamble: a key and its values."""
    kind, _, inline = _key(cells[0])
    values = [inline] if inline else [cell for cell in cells[1:] if cell]
    if kind in ("unit", "time_unit"):
        return bool(values) and all(map(_is_unit, values))
    return bool(kind and values and re.fullmatch(QUANTITY, values[0]))


def _names(path: Path, head: _Head, stated: _Stated) -> tuple[list[str], int]:
    """Return the names of all columns, with units of a row of units, and their line.

    Raises:
        InputError: There are none, or not one per column.
    """
    first, row = head.rows[head.at]
    cells = head.cells(head.at)
    widths = (len(cells), len(_trimmed(cells)))
    # the last lines with letters: names, and a row of units above or below them
    above = [at for at in range(head.at) if re.search(r"[^\W\d_]", head.rows[at][1])]
    near = {}
    for at in above[-2:]:
        line = head.cells(at)
        # keys above no field of a sample are of the preamble, not names
        fields = _trimmed(
            [
                "" if _key(cell)[0] and not any(cells[c : c + 1]) else cell
                for c, cell in enumerate(line)
            ]
        )
        while len(fields) > max(widths) and fields[-1].lower() in IGNORED:
            fields = fields[:-1]
        if not _is_entry(line) and len(fields) in widths:
            near[at] = fields
        elif _is_units_row(line[: widths[1]]):
            near[at] = line[: widths[1]]
    units = [at for at in near if len(near) > 1 and _is_units_row(near[at])]
    named = [at for at in near if at not in units]
    if named and not units and named[-1] != above[-1]:
        named = []
    if named:
        names, header = near[named[-1]], head.rows[named[-1]][0]
        if len(named) > 1 and any(not _is_text(name, ",") for name in names[1:]):
            raise InputError(
                f"{path}: line {header}: expected numbers as in line {first}, got "
                f"{shown(head.rows[named[-1]][1].strip())}"
            )
    else:
        names, header = [], first
        for number, text in head.comments[-1:]:
            if len(cells_of(text, head.separator)) in widths:
                names, header = cells_of(text, head.separator), number
    described = stated.step() or stated.time_unit or stated.alone
    if not names and described:
        names = [str(c + 1) if c in head.columns else "" for c in range(len(cells))]
    elif all(not _is_text(name, ".") for name in names if name):
        got = head.rows[above[-1] if above else head.at]
        fields = _trimmed(cells_of(got[1], head.separator))
        if above and len(fields) > 1:
            raise InputError(
                f"{path}: line {first}: expected {len(fields)} fields as in the "
                f"header, got {len(cells)}: {shown(row.strip())}"
            )
        raise InputError(
            f"{path}: line {got[0]}: expected names of columns, as "
            f"time_s,pressure_pa, got {shown(got[1].strip())}"
        )
    names = [*names, *[""] * (max(*widths, max(head.columns) + 1) - len(names))]
    for at in units:
        where = f"{path}: line {head.rows[at][0]}"
        own = [unit.strip("()[] ") for unit in near[at]]
        own += [""] * (len(names) - len(own))
        names = [_with_unit(*pair, where) for pair in zip(names, own, strict=False)]
    return names, header


def _trimmed(cells: Sequence[str]) -> list[str]:
    """Return fields without the empty ones at the end."""
    count = max((n for n, cell in enumerate(cells, start=1) if cell), default=0)
    return list(cells[:count])


def _is_units_row(cells: Sequence[str]) -> bool:
    """Return True if a row consists of units: a known one, and no names."""
    bare = [cell.strip("()[] ") for cell in cells]
    names = (x for x in bare if spelt(x) in TIME_WORDS or word_and_unit(x)[0] != x)
    return any(map(_is_unit, bare)) and all(map(_is_unit, names))


def _is_unit(text: str) -> bool:
    """Return True for a unit of time, pressure or voltage."""
    factors = (time_factor, pressure_factor, volts_factor)
    return any(factor(text) is not None for factor in factors)


def _with_unit(name: str, unit: str, where: str) -> str:
    """Return a name with its unit from a row of units.

    Raises:
        InputError: The name contains another unit.
    """
    own = word_and_unit(name)[1]
    if not unit or spelt(unit) in NUMBERED or plain_unit(own) == plain_unit(unit):
        return name
    if not _is_unit(own):
        return f"{name} ({unit})"
    raise InputError(
        f"{where}, column {name}: expected one unit per column, got {own} in its name "
        f"and {unit} in the row of units"
    )


def _clock(
    head: _Head, names: list[str], stated: _Stated, step: Step | None
) -> int | None:
    """Return the column of times or numbers: by its name, or by its values."""
    for at in head.columns:
        word = spelt(word_and_unit(names[at])[0])
        if {word, word.split("_")[0]} & {*NUMBERED, *TIME_WORDS}:
            return at
    several = len(head.columns) > 1
    if several and step is not None:
        for at in head.columns:
            steps = np.diff(head.values(at))
            if not _is_unit(word_and_unit(names[at])[1]) and any(
                steps.size and np.allclose(steps, of, rtol=STEP_TOLERANCE, atol=0.0)
                for of in (1.0, step.step_s)
            ):
                return at
    return head.columns[0] if several and stated.time_unit and step is None else None


def _check_apart(apart: float, step: Step, where: str) -> None:
    """Raise an error for times without a unit that are not apart by the stated step."""
    if abs(apart - step.step_s) > STEP_TOLERANCE * step.step_s:
        raise InputError(
            f"{where}: expected times {step.step_s:.6g} s apart, as the preamble "
            f"states, got {apart:.6g}; add a unit to the name of the column"
        )


def _decimal(path: Path, head: _Head) -> str:
    """Return the decimal mark of the samples.

    Raises:
        InputError: There are two.
    """
    if head.separator == ",":
        return "."
    marks: set[str] = set()
    for row in range(head.at, len(head.rows)):
        cells = head.cells(row)
        held = "".join(cells[c] for c in head.columns if c < len(cells))
        marks |= {mark for mark in ".," if mark in held}
        if len(marks) > 1:
            number, line = head.rows[row]
            raise InputError(
                f"{path}: line {number}: expected a decimal point or a decimal comma, "
                f"got both: {shown(line.strip())}"
            )
    return marks.pop() if marks else "."


def lines_of(
    path: Path, encoding: str, *, comments: bool = False
) -> Iterator[tuple[int, str]]:
    """Yield the lines that are not empty, numbered from 1, without comments or with."""
    # a faulty byte makes a cell that is no number, and is reported with its line
    with path.open(encoding=encoding, errors="replace", newline=None) as file:
        for number, line in enumerate(file, start=1):
            # a blank in front may separate columns
            text = line.lstrip()
            if text and (comments or text[0] != "#"):
                yield number, line


def cells_of(line: str, separator: str | None) -> list[str]:
    """Return the fields of a line, without quotes.

    Args:
        line: The line.
        separator: Separator of the fields; None for blanks.
    """
    return [cell.strip().strip('"').strip() for cell in line.split(separator)]


def _number(text: str, decimal: str) -> float:
    """Return a field as a number; NaN for other text.

    Args:
        text: The field.
        decimal: Decimal mark: a point or a comma.
    """
    text = text.replace(INFINITY, "inf")
    try:
        return float(text.replace(",", ".") if decimal == "," else text)
    except ValueError:
        return math.nan


def _is_text(text: str, decimal: str) -> bool:
    """Return True if a field is neither a number nor a missing number (nan)."""
    return math.isnan(_number(text, decimal)) and text.lower() != "nan"
