"""What a run of a study came to, for a terminal."""

import math
from collections.abc import Iterable

from jblast.report.study.run_answer import OutcomeKnown, StudyAnswer
from jblast.report.tables import aligned
from jblast.study.outcome.family import Outcome

MOST_LINES = 40
"""Of the table; a study of more sensors and outcomes is for its report."""


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
