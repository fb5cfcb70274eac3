"""Search for the equations of motion of a trajectory, with more terms if necessary.

`discover_law` is the library function of `jblast discover`. It searches products of up
to N columns, integrates the equations, and if a test fails searches products of one
more column. A trajectory is a CSV file with a time column and one
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
from jblast.errors import (
    InputError,
    argument,
    foreign_digits,
    nearest,
    read_text,
    shown,
)
from jblast.progress import stages

TIME = "time_s"
MAX_VALUE = 1e100
"""Largest value: its square and cube must still be finite numbers."""
MIN_ROWS = 20
"""Smallest number of rows: with fewer, noise cannot be separated from the motion."""
DEGREE = 2
"""Default degree: many equations of motion have products of two columns."""
DEGREES = (1, 6)
"""Smallest and largest number of columns in a product."""
ENSEMBLES = (FEWEST_OF_INTERVAL, 10_000)
"""Smallest and largest ensemble; the largest is declared."""
MAX_TERMS = 100
"""Largest number of candidates: more are slow to search, and nearly collinear."""


class TrajectoryColumns(NamedTuple):
    """Columns of a trajectory file.

    Attributes:
        time_s: Times of the rows since the first row [s].
        states: States, for which equations are searched.
        inputs: Driving inputs.
        names: Names of the states, then of the inputs.
    """

    time_s: Float[np.ndarray, " row"]
    states: Float[np.ndarray, "row state"]
    inputs: Float[np.ndarray, "row input"]
    names: tuple[str, ...]


class LawSearch(NamedTuple):
    """Equations of motion found in a trajectory.

    Attributes:
        data: Trajectory.
        found: Equations.
        again: Equations integrated from the first row.
        further: The same with products of one more column; None if not searched.
        certain: Whether all equations pass their tests.
        threshold: Smallest share of a derivative that a term must contribute.
        members: Number of members of the ensemble.
        seed: Seed of its noise.
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
        trajectory: CSV file with `time_s` and numeric columns, or its columns.
        states: Columns to find equations for; default: all but the inputs.
        inputs: Driving columns, without errors.
        held: Whether inputs are constant until the next row, as commands are; else they
            are linear between rows.
        degree: Largest number of columns in a product.
        drag: Whether |x| x of each column x is a candidate.
        threshold: Smallest share of a derivative's root mean square of a term.
        members: Number of records with new noise, for the uncertainty of the terms.
        seed: Seed of the noise.

    Returns:
        Equations, their integration, and whether they pass their tests.

    Raises:
        InputError: The file cannot be read, a column is missing, or there are too many
            candidates.

    Example:
        `jblast.discover_law("orbit.csv", states=["x_m", "v_m_s"]).certain`
    """
    check_search(degree=degree, members=members)
    begin = stages({"reading": 4.0, "finding": 5.0, "one degree more": 5.0})
    begin("reading")
    data = trajectory
    # Columns in memory, as from a simulation, are not checked again.
    if not isinstance(data, TrajectoryColumns):
        data = read_trajectory(data, states, inputs)
    columns = len(data.names)
    terms = _terms(columns, degree, drag)
    if terms > MAX_TERMS:
        raise InputError(
            f"{columns} columns to degree {degree}: expected at most {MAX_TERMS} "
            f"candidates, got {terms}; name fewer by {argument('states')} and "
            f"{argument('inputs')}, or lower {argument('degree')}"
        )

    def find(degree: int) -> tuple[Discovery, Replay]:
        candidates, outside = (
            # The terms of one more degree test the residuals of the search.
            polynomial(data.names, n, signed_squares=drag)
            for n in (degree, degree + 1)
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
    few = _terms(columns, degree + 1, drag) <= MAX_TERMS
    # more candidates do not distinguish exchangeable terms
    if not sure and few and not any(found.exchangeable):
        begin("one degree more")
        with contextlib.suppress(InputError):  # a term overflows: no search
            further = find(degree + 1)
    return LawSearch(data, found, again, further, sure, threshold, members, seed)


def certain(found: Discovery, again: Replay) -> bool:
    """Return whether all equations pass their tests.

    Each has terms and no exchangeable ones, predicts held-out segments, has residuals
    no larger than noise, and reproduces its column.
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
    """Check the numbers of a search.

    Raises:
        InputError: A number is outside its range.
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
    # Monomials up to a degree: combinations with repetition, the constant included.
    return math.comb(columns + degree, degree) + columns * drag


def read_trajectory(
    path: str | os.PathLike[str],
    states: Sequence[str] = (),
    inputs: Sequence[str] = (),
) -> TrajectoryColumns:
    """Read a trajectory from a CSV file with a header that has `time_s`.

    Lines that begin with # are comments.

    Args:
        path: CSV file.
        states: Columns to find equations for; empty for all except the inputs.
        inputs: Driving columns.

    Raises:
        InputError: The file has another form, a column is missing or constant, the
            times do not increase, or there are fewer than 20 rows.
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
    # the spline and the windows need increasing times
    late = np.flatnonzero(np.diff(time) <= 0.0)
    if len(late):
        row = late[0] + 1
        raise InputError(
            f"{path}: line {lines[row]}: column {TIME}: expected times that rise, got "
            f"{time[row]:g} after {time[row - 1]:g}"
        )
    for place, name in enumerate((*chosen[0], *chosen[1]), start=1):
        # a constant column equals the constant term
        if np.ptp(values[:, place]) == 0.0:
            raise InputError(
                f"{path}: column {name}: expected values that change, got "
                f"{values[0, place]:g} in every row; leave it out by "
                f"{argument('states')} or {argument('inputs')}"
            )
    split = 1 + len(chosen[0])
    names = (*chosen[0], *chosen[1])
    return TrajectoryColumns(
        # From 0, so that times since 1970 do not cost digits in the spline.
        time - time[0],
        values[:, 1:split],
        values[:, split:],
        names,
    )


def _check_header(where: str, header: Sequence[str]) -> None:
    # As exported with a decimal comma: the numbers would be split as well.
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
            # The negation also rejects NaN, as in an empty field of a logger.
            if not abs(value) < MAX_VALUE or foreign_digits(fields[place]):
                raise InputError(
                    f"{path}: line {line}: column {names[column]}: expected a number "
                    "between -1e100 and 1e100, got "
                    f"{shown(fields[place].strip())}"
                )
            values[row, column] = value
    return values
