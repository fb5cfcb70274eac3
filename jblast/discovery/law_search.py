"""Search for the equations of motion of a trajectory, with more terms if necessary.

`discover_law` is the library function of `jblast discover`. It searches products of up
to N columns, integrates the equations, and if a test fails searches products of one
more column. A trajectory is text with a time column and one column a state
(`read_trajectory`).
"""

import contextlib
import math
import os
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.discovery.equations import (
    FEWEST_OF_INTERVAL,
    MEMBERS,
    THRESHOLD,
    Discovery,
    discover,
)
from jblast.discovery.sparse_regression import polynomial
from jblast.errors import InputError, argument, nearest, read_bytes, require, shown
from jblast.observations.text_table import Table, text_table
from jblast.progress import stages
from jblast.units import our_name

TIME = "time_s"
RUN = "run"
"""Column of the numbers of runs."""
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
        runs: First row of each run; times increase from run to run.
    """

    time_s: Float[np.ndarray, " row"]
    states: Float[np.ndarray, "row state"]
    inputs: Float[np.ndarray, "row input"]
    names: tuple[str, ...]
    runs: tuple[int, ...] = (0,)


class LawSearch(NamedTuple):
    """Equations of motion found in a trajectory.

    Attributes:
        data: Trajectory.
        found: Equations.
        further: The same with products of one more column; None if not searched.
        threshold: Smallest share of a derivative that a term must contribute.
        members: Number of members of the ensemble.
        seed: Seed of its noise.
    """

    data: TrajectoryColumns
    found: Discovery
    further: Discovery | None
    threshold: float
    members: int
    seed: int

    @property
    def certain(self) -> bool:
        """True if all equations pass their tests."""
        return self.found.certain


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
        Equations, their integration, and their tests.

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
    got = (
        f"{terms}; name fewer by {argument('states')} and {argument('inputs')}, or "
        f"lower {argument('degree')}"
    )
    where = f"{columns} columns to degree {degree}"
    require(terms <= MAX_TERMS, where, f"at most {MAX_TERMS} candidates", got)

    def find(degree: int) -> Discovery:
        candidates, outside = (
            # The terms of one more degree test the residuals of the search.
            polynomial(data.names, n, signed_squares=drag)
            for n in (degree, degree + 1)
        )
        return discover(
            data.time_s,
            data.states,
            data.inputs,
            names=data.names,
            candidates=candidates,
            outside=outside,
            held=held,
            runs=data.runs,
            threshold=threshold,
            members=members,
            seed=seed,
        )

    begin("finding")
    found, further = find(degree), None
    few = _terms(columns, degree + 1, drag) <= MAX_TERMS
    # more candidates do not distinguish exchangeable terms, and describe no jump
    if not found.certain and few and not any(found.exchangeable) and not found.jumps:
        begin("one degree more")
        with contextlib.suppress(InputError):  # a term overflows: no search
            further = find(degree + 1)
    return LawSearch(data, found, further, threshold, members, seed)


def check_search(*, degree: int = DEGREE, members: int = MEMBERS) -> None:
    """Check the numbers of a search.

    Raises:
        InputError: A number is outside its range.
    """
    for name, value, (least, most), why in (
        ("degree", degree, DEGREES, ""),
        ("members", members, ENSEMBLES, "; fewer have no 5 % and 95 % quantiles"),
    ):
        words = f"a whole number from {least} to {most}"
        require(least <= value <= most, argument(name), words, f"{value}{why}")


def _terms(columns: int, degree: int, drag: bool) -> int:
    """Return the number of candidates."""
    # Monomials up to a degree: combinations with repetition, the constant included.
    return math.comb(columns + degree, degree) + columns * drag


def read_trajectory(
    path: str | os.PathLike[str],
    states: Sequence[str] = (),
    inputs: Sequence[str] = (),
) -> TrajectoryColumns:
    """Read a trajectory from text with a header that has `time_s`.

    Times may be in another unit (`time_ms`). A column `run` numbers several runs, each
    with its own times. Encodings, separators, decimal commas, comments and rows of
    units are those of logs.

    Args:
        path: CSV file.
        states: Columns to find equations for; empty for all except the inputs.
        inputs: Driving columns.

    Raises:
        InputError: The file has another form, a column is missing or constant, the
            times do not increase, or there are fewer than 20 rows.
    """
    expected = f"a CSV file of a trajectory: a header with {TIME} and numbers below it"
    table = text_table(
        read_bytes(path, expected), str(path), preamble=True, expected=expected
    )
    table.names(f"{TIME},x_m")
    where = table.at(table.header_line)
    clock, seconds = _clock(table)
    header = [TIME if at == clock else name for at, name in enumerate(table.header)]
    chosen = _chosen(where, header, states, inputs)
    names = (*chosen[0], *chosen[1])
    several = [RUN] if RUN in header and RUN not in names else []
    wanted = [header.index(name) for name in (TIME, *names, *several)]
    values = table.numbers(wanted)
    # rows of one run need not be adjacent
    runs = values[-1] if several else np.zeros(values.shape[1])
    order = np.argsort(runs, kind="stable")
    values = values[: 1 + len(names), order]
    lines = np.array(table.lines)[order].tolist()
    firsts = np.flatnonzero(np.diff(runs[order], prepend=np.nan) != 0.0)
    fewest = int(np.diff(firsts, append=len(lines)).min())
    words = f"at least {MIN_ROWS} rows after the header"
    words += ", in each run" if several else ""
    require(fewest >= MIN_ROWS, path, words, fewest)
    for column, row in np.argwhere(np.abs(values) >= MAX_VALUE).tolist():
        where = table.at(lines[row], header[wanted[column]])
        words = "a number between -1e100 and 1e100"
        require(False, where, words, f"{values[column, row]:g}")
    time = seconds * values[0]
    # the spline and the windows need increasing times
    steps = np.diff(time)
    for row in (np.flatnonzero(steps <= 0.0) + 1).tolist():
        where = table.at(lines[row], table.header[clock])
        got = f"{values[0, row]:g} after {values[0, row - 1]:g}"
        require(row in firsts, where, "times that rise", got)
    leave = f"leave it out by {argument('states')} or {argument('inputs')}"
    for name, column in zip(names, values[1:], strict=True):
        # a constant column equals the constant term
        varies = np.ptp(column) > 0.0
        got = f"{column[0]:g} in every row; {leave}"
        require(varies, f"{path}: column {name}", "values that change", got)
    steps[firsts[1:] - 1] = np.median(steps)
    count = len(chosen[0])
    return TrajectoryColumns(
        # From 0, so that times since 1970 do not cost digits in the spline. A run
        # begins a step after the end of the one before.
        np.concatenate([[0.0], np.cumsum(steps)]),
        values[1 : 1 + count].T,
        values[1 + count :].T,
        names,
        tuple(firsts.tolist()),
    )


def _clock(table: Table) -> tuple[int, float]:
    """Return the column of times, and its unit in seconds.

    Raises:
        InputError: There is none, or a column has no name, or one of another.
    """
    where, header = table.at(table.header_line), table.header
    found = {}
    for at, (name, unit) in enumerate(zip(header, table.units, strict=True)):
        require(name, where, "a name for each column", "an empty")
        once = header.count(name) == 1
        require(once, where, f"column {shown(name)} once", "it twice")
        ours = our_name(f"{name}_{unit}" if unit else name)
        if ours is not None and ours.name == TIME:
            found[at] = ours.factor
    got = ", ".join(header[at] for at in found)
    got = got or ", ".join(header) + nearest(TIME, header)
    require(len(found) == 1, where, f"one column {TIME}", got)
    return found.popitem()


def _chosen(
    where: str, header: Sequence[str], states: Sequence[str], inputs: Sequence[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the states and the inputs."""
    for option, names in (
        (argument("states"), states),
        (argument("inputs"), inputs),
    ):
        for name in names:
            require(name != TIME, option, f"another column than {TIME}")
            if name not in header:
                raise InputError(
                    f"{where}: missing column {shown(name)}, which {option} names; got "
                    f"{', '.join(header)}{nearest(name, header)}"
                )
            once = [*states, *inputs].count(name) == 1
            words = "each column once among states and inputs"
            require(once, option, words, f"{name} twice")
    left = [name for name in header if name not in (TIME, RUN, *inputs)]
    chosen = tuple(states) or tuple(left)
    require(chosen, where, f"a column that is no input beside {TIME}", "none")
    return chosen, tuple(inputs)
