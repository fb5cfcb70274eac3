"""Samples as text: a row a sample, a column of time and one or more of pressure.

Separators are commas, semicolons, tabs or blanks; with any but the first a decimal
comma is understood. Lines that begin with # are comments, of which the last may hold
the names, as `numpy.savetxt` writes it. Units stand in the names of columns
(`time_ms,pressure_kpa`; `Time (ms),A (mV)`) or in a row of their own below.
"""

from array import array
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, shown
from jblast.observations.records.formats.columns import SampleColumns, columns_of
from jblast.observations.records.formats.even_clock import even_clock
from jblast.observations.records.formats.head import (
    Table,
    cells_of,
    is_number,
    lines_of,
    table_at,
)
from jblast.observations.records.formats.scale import Scaling, scale_of
from jblast.observations.records.recording import Recording, channel_names


def open_csv(path: Path, scaling: Scaling) -> tuple[Recording, ...]:
    """Return what a text of samples holds: a channel for each column of pressure.

    Raises:
        InputError: It is no such text; the message names line and column.
    """
    table = table_at(path)
    columns = columns_of(table.names, f"{path}: line {table.header}")
    wanted = (columns.time, *columns.pressures)
    numbers, lines = _numbers(path, table, wanted)

    def place(sample: int) -> str:
        return f"{path}: line {lines[sample]}, column {table.names[columns.time]}"

    start_s, rate_hz = even_clock(columns.seconds * numbers[0], place)
    scales = [
        scale_of(unit, scaling, f"{path}: column {table.names[at]}")
        for at, unit in zip(columns.pressures, columns.units, strict=True)
    ]
    factors = np.array([scale.factor for scale in scales])
    samples = factors[:, None] * numbers[1:]
    recording = Recording(
        source=str(path),
        names=channel_names(path.stem, len(samples)),
        labels=tuple(f"column {table.names[at]}" for at in columns.pressures),
        rate_hz=rate_hz,
        length=samples.shape[1],
        read=lambda start, stop: samples[:, start:stop],
        start_s=start_s,
        notes=_notes(columns),
        first_line=int(lines[0]),
    )
    return (recording,)


def is_stations(path: Path) -> bool:
    """Return whether a text is a table of sensors or a log: no record of samples."""
    try:
        names = table_at(path).names
    except InputError:
        return False
    return "sensor" in (name.strip().lower() for name in names)


def _notes(columns: SampleColumns) -> tuple[str, ...]:
    if not columns.left_out:
        return ()
    return (f"columns left out, not pressure: {', '.join(columns.left_out)}",)


def _numbers(
    path: Path, table: Table, wanted: tuple[int, ...]
) -> tuple[Float[np.ndarray, "column sample"], array]:
    """Return columns as numbers, and the line of each row.

    Raises:
        InputError: A cell is none.
    """
    lines = array("q")

    def rows() -> Iterator[str]:
        for number, line in lines_of(path, table.encoding):
            if number >= table.first:
                lines.append(number)
                yield line.replace(",", ".") if table.decimal == "," else line

    try:
        numbers = np.loadtxt(
            rows(),
            delimiter=table.separator,
            comments=None,
            usecols=wanted,
            ndmin=2,
        )
    except ValueError:
        raise _bad_cell(path, table, wanted) from None
    if not np.isfinite(numbers).all():
        raise _bad_cell(path, table, wanted)
    return np.ascontiguousarray(numbers.T), lines


def _bad_cell(path: Path, table: Table, wanted: tuple[int, ...]) -> InputError:
    """Return the error that names the first cell that is no finite number."""
    filled: set[int] = set()
    for number, line in lines_of(path, table.encoding):
        if number >= table.first:
            cells = cells_of(line, table.separator)
            there = [at for at in wanted if at < len(cells)]
            filled.update(at for at in there if is_number(cells[at], table.decimal))
    for at in wanted:
        if at not in filled:
            return InputError(
                f"{path}: line {table.first}, column {table.names[at]}: expected "
                "samples, got no number in it; take the column out"
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
            if not is_number(cells[at], table.decimal):
                got = shown(cells[at]) if cells[at] else "nothing"
                return InputError(
                    f"{path}: line {number}, column {table.names[at]}: expected a "
                    f"number, got {got}"
                )
    return InputError(f"{path}: expected numbers below line {table.header}")
