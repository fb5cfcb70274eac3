"""The calculator's answer as `jblast calc --json` prints it, key by key."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from jblast.json_values import ABSENT, AMONG, entries
from jblast.report.calculator.inputs import Inputs, Numbers, inputs
from jblast.report.calculator.reasons import why_recommended, why_taken
from jblast.sensors.calculator.disagreement import Disagreement
from jblast.sensors.calculator.forward import Calculated, Calculation
from jblast.sensors.calculator.inverse import Roots
from jblast.sensors.calculator.question import Question
from jblast.sensors.calculator.recommended import Recommended


@dataclass(frozen=True)
class LawValue:
    """What a law says; a list by row where there are several rows.

    Attributes:
        value: In the unit of the quantity.
        valid: Whether the law holds there.
    """

    value: Numbers
    valid: bool | tuple[bool, ...]


@dataclass(frozen=True)
class LawEntry:
    """What a law says of one quantity.

    Attributes:
        value: In the unit of the quantity, by row.
        valid: Whether the law holds there, by row.
        range: Where it holds, in words.
        other_burst: What it says by the other curve set; absent where of no use.
    """

    value: Numbers
    valid: bool | tuple[bool, ...]
    range: str
    other_burst: LawValue | None = field(default=None, metadata=ABSENT)


@dataclass(frozen=True)
class Root:
    """A range or a mass at which a law takes the value.

    Attributes:
        value: In SI.
        valid: Whether the law holds there, outside the charge.
    """

    value: float
    valid: bool


@dataclass(frozen=True)
class RootEntry:
    """Where a law takes the value.

    Attributes:
        value: The first range or mass at which it holds, else the first; null if none.
        valid: Whether it holds there.
        roots: All of them, ascending.
        range: Where the law holds, in words.
    """

    value: float | None
    valid: bool
    roots: tuple[Root, ...]
    range: str


@dataclass(frozen=True)
class RecommendedEntry:
    """The answer to one question.

    Attributes:
        recommended: What it is.
        reason: Why this law; "" where there is no other.
    """

    recommended: Recommended = field(metadata=AMONG)
    reason: str


@dataclass(frozen=True)
class DisagreementEntry:
    """Two laws of one quantity that hold at a place and contradict each other there.

    Attributes:
        found: Which, and by how much.
        taken: The law that we would take there; "" if nothing tells.
        reason: Why.
    """

    found: Disagreement = field(metadata=AMONG)
    taken: str
    reason: str


@dataclass(frozen=True)
class CalculatorAnswer:
    """Every quantity that was asked for, by every law.

    Attributes:
        inputs: What was given and what was taken for granted.
        quantities: By quantity and law.
        recommended: The answer, where one question was asked; else absent.
        disagreements: Where laws that hold disagree.
    """

    inputs: Inputs
    quantities: Mapping[str, Mapping[str, LawEntry]]
    recommended: RecommendedEntry | None = field(metadata=ABSENT)
    disagreements: tuple[DisagreementEntry, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON can hold of it."""
        return entries(self)


@dataclass(frozen=True)
class InverseAnswer:
    """The range or the mass at which a quantity takes a value.

    Attributes:
        inputs: What was given and what was taken for granted.
        recommended: The answer.
        quantities: What was asked for, a range or a mass, by law.
    """

    inputs: Inputs
    recommended: RecommendedEntry
    quantities: Mapping[str, Mapping[str, RootEntry]]

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON can hold of it."""
        return entries(self)


def calculator_answer(
    question: Question,
    answer: Calculation,
    other: Calculation | None = None,
    apart: Sequence[Disagreement] = (),
    recommended: Recommended | None = None,
) -> CalculatorAnswer:
    """Put together what laws say of some rows.

    Args:
        question: What was asked.
        answer: What the laws say.
        other: What those of two curve sets say by the other set, if that is of use.
        apart: Where laws that hold disagree.
        recommended: The answer, where one question was asked.
    """

    def entry(quantity: str, name: str, of_law: Calculated) -> LawEntry:
        here, beside = _value(of_law), None
        if other is not None and of_law.two_sets:
            beside = _value(other[quantity][name])
        return LawEntry(here.value, here.valid, of_law.range, beside)

    quantities = {
        quantity: {name: entry(quantity, name, one) for name, one in by_law.items()}
        for quantity, by_law in answer.items()
    }
    return CalculatorAnswer(
        inputs=inputs(question),
        quantities=quantities,
        recommended=_recommended(recommended) if recommended else None,
        disagreements=tuple(map(_disagreement, apart)),
    )


def inverse_answer(
    question: Question, answer: Mapping[str, Roots], recommended: Recommended
) -> InverseAnswer:
    """Put together where laws take a value."""
    asked = inputs(question)
    by_law = {name: _root_entry(found) for name, found in answer.items()}
    return InverseAnswer(asked, _recommended(recommended), {asked.asked or "": by_law})


def _recommended(recommended: Recommended) -> RecommendedEntry:
    return RecommendedEntry(recommended, why_recommended(recommended))


def _disagreement(found: Disagreement) -> DisagreementEntry:
    taken = found.choice.method if found.choice else ""
    return DisagreementEntry(found, taken, why_taken(found))


def _root_entry(found: Roots) -> RootEntry:
    value, valid = found.best() or (None, False)
    pairs = zip(found.value, found.valid, strict=True)
    roots = tuple(Root(float(v), bool(ok)) for v, ok in pairs)
    return RootEntry(value, valid, roots, found.law.range)


def _value(of_law: Calculated) -> LawValue:
    if len(of_law.value) == 1:
        return LawValue(float(of_law.value[0]), bool(of_law.valid[0]))
    return LawValue(
        tuple(map(float, of_law.value)), tuple(bool(ok) for ok in of_law.valid)
    )
