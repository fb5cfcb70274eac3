"""The search for equations of motion in a trajectory, with more terms if in doubt.

`discover_law` does what `jblast discover` does: it looks among products of up to N
columns, integrates the equations, and where they are in doubt looks once more among
products of one column more. A trajectory is a CSV file with a time column and one
column a state (`read_trajectory`).
"""

import contextlib
import csv
import math
import os
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.discovery.discover import (
    FEWEST_OF_INTERVAL,
    MEMBERS,
    THRESHOLD,
    Discovery,
    Replay,
    discover,
    replay,
)
from jblast.discovery.sparse_regression import polynomial
from jblast.errors import InputError, argument, nearest, read_text, shown
from jblast.progress import stages

TIME = "time_s"
MAX_VALUE = 1e100
"""Largest value: its square must still be a finite number."""
MIN_ROWS = 20
"""Smallest number of rows: with fewer, noise is not separable from the motion."""
DEGREE = 2
"""Default: many equations of motion have products of two columns."""
DEGREES = (1, 6)
"""Least and most columns of a product."""
ENSEMBLES = (FEWEST_OF_INTERVAL, 10_000)
"""Fewest and most members; the most is declared."""
MOST_TERMS = 100
"""Candidates: more are neither found fast nor told apart."""


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


class LawSearch(NamedTuple):
    """Equations of motion found in a trajectory.

    Attributes:
        data: The trajectory.
        found: The equations.
        again: The equations integrated from the first row.
        further: The same among products of one column more; None where that was not
            tried.
        certain: Whether nothing contradicts any of the equations.
        threshold: Least share of a derivative for a term to stay.
        members: Of the ensemble.
        seed: Of its noise.
    """

    data: TrajectoryColumns
    found: Discovery
    again: Replay
    further: tuple[Discovery, Replay] | None
    certain: bool
    threshold: float
    members: int
    seed: int


def discover_law(
    trajectory: str | os.PathLike[str] | TrajectoryColumns,
    *,
    states: Sequence[str] = (),
    inputs: Sequence[str] = (),
    held: bool = False,
    degree: int = DEGREE,
    drag: bool = False,
    threshold: float = THRESHOLD,
    members: int = MEMBERS,
    seed: int = 0,
) -> LawSearch:
    """Find the equations of motion in a trajectory.

    Args:
        trajectory: CSV file with `time_s` and columns of numbers, or its columns.
        states: Columns to find equations for; default: all but the inputs.
        inputs: Columns that drive them, taken as exact.
        held: Whether inputs keep their value until the next row, as commands do; else
            they are linear between rows.
        degree: Most columns of a product among the candidates.
        drag: Whether |x| x of each column x is a candidate.
        threshold: Least share of a derivative's root mean square for a term to stay.
        members: Records with new noise, for the uncertainty of a term.
        seed: Of that noise.

    Returns:
        The equations, their integration, and whether they are certain.

    Raises:
        InputError: The file cannot be read, a column is not there, or there are too
            many candidates.

    Example:
        `jblast.discover_law("orbit.csv", states=["x_m", "v_m_s"]).certain`
    """
    check_search(degree=degree, members=members)
    begin = stages({"reading": 4.0, "finding": 5.0, "one degree more": 5.0})
    begin("reading")
    data = trajectory
    if not isinstance(data, TrajectoryColumns):
        data = read_trajectory(data, states, inputs)
    columns = len(data.names)
    terms = _terms(columns, degree, drag)
    if terms > MOST_TERMS:
        raise InputError(
            f"{columns} columns to degree {degree}: expected at most {MOST_TERMS} "
            f"candidates, got {terms}; name fewer by {argument('states')} and "
            f"{argument('inputs')}, or lower {argument('degree')}"
        )

    def find(degree: int) -> tuple[Discovery, Replay]:
        candidates, outside = (
            polynomial(data.names, n, signed_squares=drag) for n in (degree, degree + 1)
        )
        found = discover(
            data.time_s,
            data.states,
            data.inputs,
            names=data.names,
            candidates=candidates,
            outside=outside,
            held=held,
            threshold=threshold,
            members=members,
            seed=seed,
        )
        return found, replay(found, data.time_s, data.states, data.inputs, held=held)

    begin("finding")
    found, again = find(degree)
    sure, further = certain(found, again), None
    few = _terms(columns, degree + 1, drag) <= MOST_TERMS
    # more candidates do not distinguish exchangeable terms
    if not sure and few and not any(found.exchangeable):
        begin("one degree more")
        with contextlib.suppress(InputError):  # a term that overflows is none to try
            further = find(degree + 1)
    return LawSearch(data, found, again, further, sure, threshold, members, seed)


def certain(found: Discovery, again: Replay) -> bool:
    """Return whether nothing contradicts any equation.

    Each has a term, no exchangeable ones, holds over segments that its coefficients
    were not fitted to, leaves nothing but noise, and reproduces its column.
    """
    return all(
        bool(found.terms(state))
        and not found.exchangeable[state]
        and judged.law
        and judged.whole
        and again.reproduced[state]
        for state, judged in enumerate(found.judged)
    )


def check_search(*, degree: int = DEGREE, members: int = MEMBERS) -> None:
    """Refuse numbers outside their ranges.

    Raises:
        InputError: As said.
    """
    for name, value, (least, most), why in (
        ("degree", degree, DEGREES, ""),
        ("members", members, ENSEMBLES, "; fewer have no 5 % and 95 % quantiles"),
    ):
        if not least <= value <= most:
            raise InputError(
                f"{argument(name)}: expected a whole number from {least} to {most}, "
                f"got {value}{why}"
            )


def _terms(columns: int, degree: int, drag: bool) -> int:
    """Return the number of candidates."""
    return math.comb(columns + degree, degree) + columns * drag


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
