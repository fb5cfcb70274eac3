"""The answer of a run of `jblast study`."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from jblast.report.words import aligned
from jblast.results import Document
from jblast.study.engine.store import Variable
from jblast.study.engine.tiles import Moments
from jblast.study.outcome.family import Outcome
from jblast.study.sampling.run import Ran

MAX_LINES = 30
"""Largest number of rows of the table: with its heading it fits one screen."""


@dataclass(frozen=True)
class OutcomeKnown:
    """Statistics of an outcome over all samples, at one sensor if it has any.

    Attributes:
        outcome: Name of the outcome.
        sensor: Name of the sensor; "" for none.
        units: Unit of mean and sd.
        kind: "number", or "yes_no", whose mean is a share.
        mean: Mean of the successful samples.
        sd: Their standard deviation; null for fewer than two.
        standard_error: Standard error of the mean; null for fewer than two.
        samples: Number of successful samples.
        failed: Number of failed samples.
    """

    outcome: str
    sensor: str
    units: str
    kind: str
    mean: float
    sd: float
    standard_error: float
    samples: int
    failed: int


@dataclass(frozen=True)
class StudyAnswer(Document):
    """The answer of `jblast study`: a complete or partial study.

    Attributes:
        store: Folder of the store.
        complete: Whether all samples are stored.
        reached: Whether it ended at the requested standard errors.
        samples: Number of stored samples.
        calculated: Number of samples computed in this run.
        seconds: Time of this run.
        outcomes: Statistics of each outcome, over all cells of the axes together.
        notes: Notes on the computation.
    """

    store: str
    complete: bool
    reached: bool
    samples: int
    calculated: int
    seconds: float
    outcomes: tuple[OutcomeKnown, ...]
    notes: tuple[str, ...]


def run_text(answer: StudyAnswer) -> str:
    """Return number of samples and mean of each outcome, for the terminal."""
    lines = [_state(answer)]
    rows = [("outcome", "sensor", "mean", "error", "sd", "samples", "failed")]
    rows += [_row(known) for known in answer.outcomes[:MAX_LINES]]
    if not any(row[1] for row in rows[1:]):
        rows = [(row[0], *row[2:]) for row in rows]
    numbers = range(len(rows[0]) - 5, len(rows[0]))
    lines += ["", *aligned(rows, right=tuple(numbers))]
    if len(answer.outcomes) > MAX_LINES:
        lines.append(f"and {len(answer.outcomes) - MAX_LINES} more")
    if answer.notes:
        lines += ["", *answer.notes]
    return "\n".join(lines) + "\n"


def _state(answer: StudyAnswer) -> str:
    added = ""
    if answer.calculated:
        rate = answer.calculated / answer.seconds if answer.seconds > 0 else math.inf
        added = (
            f", {answer.calculated:,} of them new, in {answer.seconds:.3g} s "
            f"({rate:.3g} a second)"
        )
    state = "complete" if answer.complete else "not complete: --resume continues it"
    if answer.reached:
        state = "complete: the requested standard errors are reached"
    return f"{answer.store}: {answer.samples:,} samples{added}; {state}"


def _row(known: OutcomeKnown) -> tuple[str, ...]:
    name = f"{known.outcome} [{known.units}]" if known.units != "1" else known.outcome
    return (
        name,
        known.sensor,
        f"{known.mean:.6g}",
        f"{known.standard_error:.2g}",
        f"{known.sd:.4g}",
        f"{known.samples:,}",
        f"{known.failed:,}",
    )


def outcomes_text(outcomes: Iterable[Outcome]) -> str:
    """Return a table of all outcomes with units and requirements."""
    rows = [("outcome", "unit", "description", "needs")]
    rows += [
        (o.name, "yes or no" if o.kind == "yes_no" else o.units, o.long_name, o.needs)
        for o in outcomes
    ]
    return "\n".join(aligned(rows)) + "\n"


def study_answer(ran: Ran) -> StudyAnswer:
    """Return the answer of a run."""
    outcomes = [v for v in ran.store.variables if v.role == "outcome"]
    return StudyAnswer(
        store=str(ran.store.path),
        complete=ran.complete,
        reached=ran.reached,
        samples=ran.samples,
        calculated=ran.new,
        seconds=ran.seconds,
        outcomes=tuple(
            known
            for variable in outcomes
            for known in _known(variable, ran.estimates.moments[variable.name])
        ),
        notes=ran.notes,
    )


def _known(variable: Variable, moments: Moments) -> list[OutcomeKnown]:
    whole = moments.whole()
    error = whole.standard_error()
    sensors = variable.sensors or ("",)
    found = []
    for n, sensor in enumerate(sensors):
        at = (0, n) if variable.sensors else (0,)
        answers = int(whole.answers[at])
        found.append(
            OutcomeKnown(
                outcome=variable.name,
                sensor=sensor,
                units=variable.units,
                kind=variable.kind,
                mean=float(whole.mean[at]) if answers else float("nan"),
                sd=float(error[at] * np.sqrt(answers)),
                standard_error=float(error[at]),
                samples=answers,
                failed=int(whole.failed[at]),
            )
        )
    return found
