"""The search for equations of motion in a trajectory, with more terms if in doubt.

`discover_law` does what `jblast discover` does: it looks among products of up to N
columns, integrates the equations, and where they are in doubt looks once more among
products of one column more.
"""

import contextlib
import math
import os
from collections.abc import Sequence
from typing import NamedTuple

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
from jblast.discovery.trajectory_file import TrajectoryColumns, read_trajectory
from jblast.errors import InputError, argument
from jblast.progress import stages

DEGREE = 2
DEGREES = (1, 6)
ENSEMBLES = (FEWEST_OF_INTERVAL, 10_000)
MOST_TERMS = 100
"""Candidates: more are neither found fast nor told apart."""


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
