"""What a choice of method looks like on a terminal."""

import math

from jblast.fidelity import Candidate, Choice
from jblast.report.choice.reason import percent, reason_for
from jblast.report.lines import hanging
from jblast.report.tables import aligned

ABSENT = "-"
WIDTHS = (26, 14, 12)
"""Of the columns, where no method is named at greater length."""


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
        *hanging(reason_for(choice), indent=2),
        "",
    ]
    rows = [("  method", "error", "s a reading", "")]
    rows += [_row(candidate) for candidate in choice.candidates]
    lines += aligned(rows, right=(1, 2), least=WIDTHS)
    return "\n".join(line.rstrip() for line in lines) + "\n"


def _row(candidate: Candidate) -> tuple[str, str, str, str]:
    cost = ABSENT if math.isnan(candidate.cost_s) else f"{candidate.cost_s:.2g}"
    error = percent(candidate.error) if math.isfinite(candidate.error) else ABSENT
    note = "the reference" if candidate.is_reference else ""
    if not candidate.valid:
        error, note = ABSENT, "does not hold at all places"
    return f"  {candidate.method}", error, cost, f" {note}"
