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

MOST_LINES = 40
"""Of the table; a study of more sensors and outcomes is for its report."""


@dataclass(frozen=True)
class OutcomeKnown:
    """What is known of an outcome over all samples, at one sensor if it has any.

    Attributes:
        outcome: Its name.
        sensor: Of which sensor; "" of none.
        units: Of mean and sd.
        kind: "number", or "yes_no", whose mean is a share.
        mean: Over the samples that have an answer.
        sd: Their standard deviation; null of fewer than two.
        standard_error: Of the mean; null of fewer than two.
        samples: That have an answer.
        failed: That have none.
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
    """A study, or what there is of it.

    Attributes:
        store: Its folder.
        complete: Whether all samples are there.
        reached: Whether it ended because the standard errors asked for were reached.
        samples: How many there are now.
        calculated: How many this run calculated.
        seconds: How long that took.
        outcomes: What is known of each, over all cells of the axes together.
        notes: Remarks on the calculation.
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
    """Return what there is of a study: how much, and each outcome's mean and error."""
    lines = [_state(answer)]
    rows = [("outcome", "sensor", "mean", "error", "sd", "samples", "failed")]
    rows += [_row(known) for known in answer.outcomes[:MOST_LINES]]
    if not any(row[1] for row in rows[1:]):
        rows = [(row[0], *row[2:]) for row in rows]
    numbers = range(len(rows[0]) - 5, len(rows[0]))
    lines += ["", *aligned(rows, right=tuple(numbers))]
    if len(answer.outcomes) > MOST_LINES:
        lines.append(f"and {len(answer.outcomes) - MOST_LINES} more")
    if answer.notes:
        lines += ["", *answer.notes]
    return "\n".join(lines) + "\n"


def _state(answer: StudyAnswer) -> str:
    how = ""
    if answer.calculated:
        rate = answer.calculated / answer.seconds if answer.seconds > 0 else math.inf
        how = (
            f", {answer.calculated:,} of them now, in {answer.seconds:.3g} s: "
            f"{rate:.3g} a second"
        )
    state = "complete" if answer.complete else "not complete: --resume goes on with it"
    if answer.reached:
        state = "complete, as the standard errors asked for are reached"
    return f"{answer.store}: {answer.samples:,} samples{how}; {state}"


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
    """Return the outcomes that there are, with units, and what each needs."""
    rows = [("outcome", "unit", "what it is", "needs")]
    rows += [
        (o.name, "yes or no" if o.kind == "yes_no" else o.units, o.long_name, o.needs)
        for o in outcomes
    ]
    return "\n".join(aligned(rows)) + "\n"


def study_answer(ran: Ran) -> StudyAnswer:
    """Return what a run came to."""
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
