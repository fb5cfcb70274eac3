"""A choice of method as `jblast choose --json` prints it, key by key."""

from dataclasses import dataclass
from typing import Any

from jblast.fidelity import Candidate, Choice
from jblast.json_values import entries
from jblast.report.choice.reason import reason_for


@dataclass(frozen=True)
class ChoiceAnswer:
    """What suffices, or what comes nearest to it.

    Attributes:
        quantity: What was asked for.
        method: The cheapest method within the tolerance; else the best there is.
        reason: Why, in one sentence.
        predicted_error: Its relative error; null if nothing is known.
        tolerance: What was asked for, relative; zero asks for the best.
        met: Whether it suffices.
        cost_s: Seconds a reading.
        candidates: All methods that were looked at, the cheapest first.
    """

    quantity: str
    method: str
    reason: str
    predicted_error: float
    tolerance: float
    met: bool
    cost_s: float
    candidates: tuple[Candidate, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON can hold of it."""
        return entries(self)


def choice_answer(choice: Choice) -> ChoiceAnswer:
    """Return a choice with its reason in words."""
    return ChoiceAnswer(
        quantity=choice.quantity,
        method=choice.method,
        reason=reason_for(choice),
        predicted_error=choice.predicted_error,
        tolerance=choice.tolerance,
        met=choice.met,
        cost_s=choice.cost_s,
        candidates=choice.candidates,
    )
