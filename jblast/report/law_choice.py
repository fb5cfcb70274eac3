"""What a choice of method looks like on a terminal."""

import math

from jblast.fidelity import Candidate, Choice
from jblast.fidelity.explanation import percent
from jblast.report.fit.terminal import hanging

ABSENT = "-"


def choice_text(choice: Choice) -> str:
    """Return the method, the reason, and a table of all that were looked at."""
    verdict = "suffices" if choice.met else "does not suffice"
    within = (
        f"within {percent(choice.tolerance)}"
        if choice.tolerance
        else "as well as can be"
    )
    lines = [
        f"{choice.method} {verdict}: {choice.quantity} {within}",
        "",
        *hanging(choice.reason, indent=2),
        "",
        f"  {'method':24}{'error':>16}{'s a reading':>14}   ",
    ]
    lines += [_row(candidate) for candidate in choice.candidates]
    return "\n".join(line.rstrip() for line in lines) + "\n"


def _row(candidate: Candidate) -> str:
    cost = ABSENT if math.isnan(candidate.cost_s) else f"{candidate.cost_s:.2g}"
    error = percent(candidate.error) if math.isfinite(candidate.error) else ABSENT
    note = "the reference" if candidate.is_reference else ""
    if not candidate.valid:
        error, note = ABSENT, "does not hold at all places"
    return f"  {candidate.method:24}{error:>16}{cost:>14}   {note}"
