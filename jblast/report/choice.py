"""The method that `jblast choose` selects, and the reason."""

import math
from dataclasses import dataclass, field

from jblast.fidelity.choose import Candidate, Choice, TakenLaw
from jblast.fidelity.errors import MAX_DISTANCE, REFERENCES
from jblast.registry import LAWS
from jblast.report.output import PROBLEM, Answer
from jblast.report.view import Column, Lines, Table, View
from jblast.results import Document, among

ABSENT = "-"
BY_HEIGHT = {
    ("free-air",): "free-air curves, by the height of burst",
    ("surface",): "the height of burst lies between the limits of the two curve sets; "
    "surface curves were taken",
    ("surface", "free-air"): "by the height of burst some readings are of a free-air "
    "burst and others lie between the curve sets; the method is valid for both sets",
}
"""Sentence on the curve sets that the height of burst selects."""


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
    """Return the reason for the method, with errors and costs of the alternatives.

    Notes on curve sets and height of burst follow.
    """
    found = next(c for c in choice.candidates if c.method == choice.method)
    parts = [_of_the_chosen(choice, found)]
    rejected = _rejected(choice, found)
    if rejected:
        parts.append(f"error of {rejected.method} up to {percent(rejected.error)}")
    dearest = _dearest(choice, found)
    if dearest:
        more = f"costs {_times(dearest.cost_s / found.cost_s)} times more"
        parts.append(
            f"{dearest.method}, the reference, {more}"
            if dearest.is_reference
            else f"{dearest.method} {more} (error {percent(dearest.error)})"
        )
    parts += [BY_HEIGHT[choice.by_height]] if choice.by_height else []
    return "; ".join([*parts, *choice.notes])


def choice_reason(choice: Choice) -> str:
    """Return the reason for the method, without its name."""
    return reason_for(choice).removeprefix(f"{choice.method}: ")


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


def _times(ratio: float) -> str:
    """Return a ratio to one digit, as 40 or 4e5."""
    # costs are timings, which vary by tens of per cent: one digit
    digit, power = f"{ratio:.0e}".split("e")
    return f"{float(f'{ratio:.0e}'):g}" if ratio < 1e3 else f"{digit}e{int(power)}"


def _of_the_chosen(choice: Choice, found: Candidate) -> str:
    low, high = (f"{z:.3g}" for z in choice.span)
    z = f"Z = {low} m/kg^(1/3)" if low == high else f"Z = {low} to {high} m/kg^(1/3)"
    where = f"inside {LAWS[choice.quantity, found.method].range}"
    name = found.method
    if choice.quantity not in REFERENCES:
        if choice.reference_uncertainty == 0.0:
            return f"{name}: exact"
        return (
            f"{name}: the default law; its error is unknown, as there is no reference, "
            "so no tolerance can be verified"
        )
    if not math.isfinite(choice.reference_uncertainty):
        end = REFERENCES[choice.quantity][-1].end
        return (
            f"{name}: {z}; the reference ends at Z = {end:g} and "
            f"{MAX_DISTANCE / 1000:g} km, so no tolerance can be verified there"
        )
    own = percent(choice.reference_uncertainty)
    if not found.valid:
        return f"{name}: {z}, not all {where}; no method is valid at all of it"
    quality = (
        f"the reference law here (uncertainty {own})"
        if found.is_reference
        else f"error up to {percent(found.error)} (uncertainty of the reference {own})"
    )
    if choice.met or choice.tolerance == 0.0:
        return f"{name}: {z} {where}; {quality}"
    tolerance = f"a tolerance of {percent(choice.tolerance)}"
    if choice.reference_uncertainty > choice.tolerance:
        return f"{name}: {z} {where}; {quality}, so {tolerance} cannot be verified"
    short = found.predicted_error / choice.tolerance
    return (
        f"{name}: {z} {where}; {quality}; it is the most accurate method, and misses "
        f"{tolerance} by a factor of {short:.2g}"
    )


def _rejected(choice: Choice, found: Candidate) -> Candidate | None:
    """Return the cheapest rejected method that costs less or as much, if any."""
    others = [
        c
        for c in choice.candidates
        if c.method != found.method
        and math.isfinite(c.error)
        and c.error > max(found.error, choice.tolerance)
    ]
    # candidates come the cheapest first
    return others[0] if others else None


def _dearest(choice: Choice, found: Candidate) -> Candidate | None:
    """Return the most expensive valid method, if it costs more than 10 times as much.

    Below a factor of 10 the cost decides nothing: all laws take microseconds.
    """
    others = [c for c in choice.candidates if math.isfinite(c.error) and c.cost_s > 0.0]
    if not others or not found.cost_s > 0.0:
        return None
    dearest = max(others, key=lambda c: c.cost_s)
    return dearest if dearest.cost_s > 10.0 * found.cost_s else None
