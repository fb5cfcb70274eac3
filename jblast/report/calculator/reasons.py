"""Why the calculator answers by the law that it takes."""

from typing import TYPE_CHECKING

from jblast.sensors.calculator.disagreement import Disagreement
from jblast.sensors.calculator.recommended import Recommended

if TYPE_CHECKING:
    from jblast.fidelity import Choice


def why_recommended(recommended: Recommended) -> str:
    """Return why an answer is by its law; "" where there is no other."""
    if recommended.is_nearest:
        return "the nearest to the others of those that give it where they hold"
    return _of_choice(recommended.choice) if recommended.choice else ""


def why_taken(found: Disagreement) -> str:
    """Return why we would take one of two laws that disagree, or why neither."""
    if found.choice is None:
        return "nothing here tells which of them is nearer to nature"
    return _of_choice(found.choice)


def _of_choice(choice: "Choice") -> str:
    from jblast.report.choice.reason import choice_reason  # read with what it words

    return choice_reason(choice)
