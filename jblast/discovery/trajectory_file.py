"""The reader of a trajectory: a CSV file with a time column and one column a state."""

import csv
import math
import os
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, argument, nearest, read_text, shown

TIME = "time_s"
MAX_VALUE = 1e100
"""Largest value: its square must still be a finite number."""
MIN_ROWS = 20
"""Smallest number of rows: with fewer, noise is not separable from the motion."""


class TrajectoryColumns(NamedTuple):
    """Columns of a file.

    Attributes:
        time_s: Of the rows, from the first row on [s].
        states: What equations are for.
        inputs: What drives them.
        names: Of the states, then of the inputs.
    """

    time_s: Float[np.ndarray, " row"]
    states: Float[np.ndarray, "row state"]
    inputs: Float[np.ndarray, "row input"]
    names: tuple[str, ...]


def read_trajectory(
    path: str | os.PathLike[str],
    states: Sequence[str] = (),
    inputs: Sequence[str] = (),
) -> TrajectoryColumns:
    """Read a trajectory: a header, `time_s` among its names, and numbers.

    Lines that begin with # are comments.

    Args:
        path: The file.
        states: Columns that equations are for; none: all that are no inputs.
        inputs: Columns that drive them.

    Raises:
        InputError: The file is not as described, a column is missing or does not
            change, the times do not rise, there are fewer than 20 rows.
    """
    text = read_text(path, "a CSV file of a trajectory")
    numbered = [
        (number, line)
        for number, line in enumerate(text.split("\n"), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not numbered:
        raise InputError(
            f"{path}: line 1: the file is empty; expected a header with {TIME} and the "
            "columns of a trajectory"
        )
    head, header_line = numbered[0]
    header = [name.strip() for name in next(csv.reader([header_line]))]
    where = f"{path}: line {head}"
    _check_header(where, header)
    chosen = _chosen(where, header, states, inputs)
    lines = [number for number, _ in numbered[1:]]
    if len(lines) < MIN_ROWS:
        raise InputError(
            f"{path}: expected at least {MIN_ROWS} rows after the header, got "
            f"{len(lines)}"
        )
    values = _numbers(str(path), header, numbered[1:], (TIME, *chosen[0], *chosen[1]))
    time = values[:, 0]
    late = np.flatnonzero(np.diff(time) <= 0.0)
    if len(late):
        row = late[0] + 1
        raise InputError(
            f"{path}: line {lines[row]}: column {TIME}: expected times that rise, got "
            f"{time[row]:g} after {time[row - 1]:g}"
        )
    for place, name in enumerate((*chosen[0], *chosen[1]), start=1):
        if np.ptp(values[:, place]) == 0.0:
            raise InputError(
                f"{path}: column {name}: expected values that change, got "
                f"{values[0, place]:g} in every row; leave it out by "
                f"{argument('states')} or {argument('inputs')}"
            )
    split = 1 + len(chosen[0])
    names = (*chosen[0], *chosen[1])
    return TrajectoryColumns(
        time - time[0], values[:, 1:split], values[:, split:], names
    )


def _check_header(where: str, header: Sequence[str]) -> None:
    if len(header) == 1 and ";" in header[0]:
        raise InputError(
            f"{where}: expected columns separated by commas, got semicolons; save the "
            "file with commas (and decimal points)"
        )
    for name in header:
        if not name:
            raise InputError(f"{where}: expected a name for each column, got an empty")
        if header.count(name) > 1:
            raise InputError(
                f"{where}: expected column {shown(name)} once, got it twice"
            )
    if TIME not in header:
        raise InputError(
            f"{where}: missing column {TIME}; got {', '.join(header)}"
            f"{nearest(TIME, header)}"
        )


def _chosen(
    where: str, header: Sequence[str], states: Sequence[str], inputs: Sequence[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the states and the inputs."""
    for option, names in (
        (argument("states"), states),
        (argument("inputs"), inputs),
    ):
        for name in names:
            if name == TIME:
                raise InputError(f"{option}: expected another column than {TIME}")
            if name not in header:
                raise InputError(
                    f"{where}: missing column {shown(name)}, which {option} names; got "
                    f"{', '.join(header)}{nearest(name, header)}"
                )
            if [*states, *inputs].count(name) > 1:
                raise InputError(
                    f"{option}: expected each column once among states and inputs, got "
                    f"{name} twice"
                )
    left = [name for name in header if name not in (TIME, *inputs)]
    chosen = tuple(states) or tuple(left)
    if not chosen:
        raise InputError(
            f"{where}: expected a column that is no input beside {TIME}, got none"
        )
    return chosen, tuple(inputs)


def _numbers(
    path: str,
    header: Sequence[str],
    rows: Sequence[tuple[int, str]],
    names: Sequence[str],
) -> Float[np.ndarray, "row column"]:
    """Return the numbers of some columns."""
    places = [header.index(name) for name in names]
    values = np.empty((len(rows), len(names)))
    for row, (line, text) in enumerate(rows):
        fields = next(csv.reader([text]))
        if len(fields) != len(header):
            raise InputError(
                f"{path}: line {line}: expected {len(header)} fields as in the header, "
                f"got {len(fields)}"
            )
        for column, place in enumerate(places):
            try:
                value = float(fields[place])
            except ValueError:
                value = math.nan
            if not abs(value) < MAX_VALUE:
                raise InputError(
                    f"{path}: line {line}: column {names[column]}: expected a number "
                    "between -1e100 and 1e100, got "
                    f"{shown(fields[place].strip())}"
                )
            values[row, column] = value
    return values
