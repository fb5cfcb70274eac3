"""The method that `jblast choose` selects, and the reason."""

import math
from dataclasses import dataclass, field

from jblast.registry import LAWS
from jblast.report.messages import sentence
from jblast.report.output import PROBLEM, Answer
from jblast.report.view import Column, Lines, Table, View
from jblast.results import Document, among
from jblast.waves.choice import MAX_DISTANCE, Candidate, Choice, TakenLaw, references

ABSENT = "-"


COLUMNS = [
    Column("method", lambda one: one.method),
    Column(
        "error",
        lambda one: percent(one.error) if math.isfinite(one.error) else ABSENT,
        right=True,
    ),
    Column(
        "s/reading",
        lambda one: ABSENT if math.isnan(one.cost_s) else f"{one.cost_s:.2g}",
        right=True,
    ),
    Column("", lambda one: _remark(one)),
]


def _remark(one: Candidate) -> str:
    if not one.valid:
        return "not valid at all sensors"
    return "the reference" if one.is_reference else ""


@dataclass(frozen=True)
class ChoiceAnswer(Document):
    """The answer of `jblast choose`.

    Attributes:
        choice: The selected method.
        reason: Reason for the selection, as one sentence.
        rest: Error and cost of the method, and the compared methods.
    """

    choice: Choice = field(metadata=among("quantity", "method"))
    reason: str
    rest: Choice = field(
        metadata=among("predicted_error", "tolerance", "met", "cost_s", "candidates")
    )


def choice_answer(choice: Choice) -> Answer:
    """Return a choice with its reason and a table of all compared methods."""
    tolerance = percent(choice.tolerance) if choice.tolerance else ""
    within = f"within {tolerance}" if tolerance else "without a tolerance"
    reason, found = reason_for(choice), f"{choice.quantity} {within}"
    return Answer(
        ChoiceAnswer(choice, reason, choice),
        View(
            f"{choice.method} suffices: {found}"
            if choice.met
            else f"No method is accurate enough: {found}; best method: {choice.method}",
            [Lines("", [reason]), Table(COLUMNS, choice.candidates)],
        ),
        code=0 if choice.met else PROBLEM,
    )


def reason_for(choice: Choice) -> str:
    """Return the method with the reason for it."""
    return f"{choice.method}: {choice_reason(choice)}"


def choice_reason(choice: Choice) -> str:
    """Return the reason for the method, and notes on curve sets and height of burst."""
    found = next(c for c in choice.candidates if c.method == choice.method)
    low, high = (f"{z:.3g}" for z in choice.span)
    own = percent(choice.reference_uncertainty)
    spans = references(choice.quantity)
    reason = sentence(
        f"choose.{_kind(choice, found)}",
        z=low if low == high else f"{low} to {high}",
        range=LAWS[choice.quantity, found.method].range,
        end=spans[-1].end if spans else None,
        distance_km=MAX_DISTANCE / 1000,
        quality=f"the reference law here (uncertainty {own})"
        if found.is_reference
        else f"error up to {percent(found.error)} (uncertainty of the reference {own})",
        tolerance=percent(choice.tolerance),
        short=found.predicted_error / (choice.tolerance or math.nan),
    )
    return "; ".join([reason, *choice.notes])


def _kind(choice: Choice, found: Candidate) -> str:
    """Return the kind of the reason."""
    own = choice.reference_uncertainty
    if not references(choice.quantity):
        return "exact" if own == 0.0 else "no_reference"
    if not math.isfinite(own):
        return "beyond_reference"
    if not found.valid:
        return "not_valid"
    if choice.met or choice.tolerance == 0.0:
        return "suffices"
    return "not_verifiable" if own > choice.tolerance else "most_accurate"


def law_reason(law: TakenLaw) -> str:
    """Return the reason for a law, without its name."""
    if law.choice is None:
        return "requested"
    method, reason = law.choice.method, choice_reason(law.choice)
    if method == law.name:
        return reason
    return f"chosen before the fit; at the answer it would be {method}: {reason}"


def percent(error: float) -> str:
    """Return a relative error as text: 0.31 %, 24 %, a factor of 3.2."""
    if not math.isfinite(error):
        return "an unknown amount"
    # from 100 % on a factor is plainer: the quantities are positive
    if error >= 1.0:
        return f"a factor of {1.0 + error:.2g}"
    return f"{100.0 * error:.2g} %"
