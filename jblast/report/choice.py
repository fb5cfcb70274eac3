"""The method that `jblast choose` selects, and the reason."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from jblast.fidelity.choose import Candidate, Choice, TakenLaw
from jblast.fidelity.errors import MAX_DISTANCE, REFERENCES, SOLVER
from jblast.registry import LAWS
from jblast.report.words import aligned, hanging
from jblast.results import Answer, among

ABSENT = "-"
WIDTHS = (26, 14, 12)
"""Of the columns, where no method is named at greater length."""
BY_HEIGHT = {
    ("free-air",): "the height leaves the free-air curves",
    ("surface",): "the charge stands between the limits of the curves, of which the "
    "surface ones were taken",
    ("surface", "free-air"): "by its height the charge bursts as in free air for some "
    "sensors and numbers, for the others neither set holds: it does for both sets",
}
"""What is said of the curve sets that heights leave."""


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


@dataclass(frozen=True)
class ChoiceAnswer(Answer):
    """The answer of `jblast choose`.

    Attributes:
        choice: The method.
        reason: Why, in one sentence.
        rest: Its error and cost, and the methods compared.
    """

    choice: Choice = field(metadata=among("quantity", "method"))
    reason: str
    rest: Choice = field(
        metadata=among("predicted_error", "tolerance", "met", "cost_s", "candidates")
    )


def choice_answer(choice: Choice) -> ChoiceAnswer:
    """Return a choice with its reason in words."""
    return ChoiceAnswer(choice, reason_for(choice), choice)


def reason_for(choice: Choice) -> str:
    """Return why the method was chosen, and what the others would have cost.

    Then what heights leave of the curve sets, or what contradicts them.
    """
    found = next(c for c in choice.candidates if c.method == choice.method)
    parts = [_of_the_chosen(choice, found)]
    rejected = _rejected(choice, found)
    if rejected:
        parts.append(
            f"{rejected.method} would be off by up to {percent(rejected.error)}"
        )
    dearest = _dearest(choice, found)
    if dearest:
        more = f"costs {_times(dearest.cost_s / found.cost_s)} times more"
        parts.append(
            f"{dearest.method}, the reference, {more}"
            if dearest.is_reference
            else f"{named(dearest.method)} {more} for {percent(dearest.error)}"
        )
    parts += [BY_HEIGHT[choice.by_height]] if choice.by_height else []
    return "; ".join([*parts, *choice.notes])


def choice_reason(choice: Choice) -> str:
    """Return why the method was chosen, without its name."""
    return reason_for(choice).removeprefix(f"{choice.method}: ")


def law_reason(law: TakenLaw) -> str:
    """Return why a law was taken, without its name."""
    if law.choice is None:
        return "as asked for"
    method, reason = law.choice.method, choice_reason(law.choice)
    if method == law.name:
        return reason
    return (
        f"chosen before the answer was known, at which it would be {method}: {reason}"
    )


def law_reasons(laws: Mapping[str, TakenLaw]) -> dict[str, str]:
    """Return why the law of each quantity was taken."""
    return {quantity: law_reason(law) for quantity, law in laws.items()}


def percent(error: float) -> str:
    """Return a relative error in words: 0.31 %, 24 %, a factor of 3.2."""
    if not math.isfinite(error):
        return "an unknown amount"
    if error >= 1.0:
        return f"a factor of {1.0 + error:.2g}"
    return f"{100.0 * error:.2g} %"


def _times(ratio: float) -> str:
    """Return a ratio to one digit, as 40 or 4e5."""
    digit, power = f"{ratio:.0e}".split("e")
    return f"{float(f'{ratio:.0e}'):g}" if ratio < 1e3 else f"{digit}e{int(power)}"


def named(method: str) -> str:
    """Return a method's name as a sentence has it."""
    return "the Euler solver" if method == SOLVER else method


def _of_the_chosen(choice: Choice, found: Candidate) -> str:
    low, high = (f"{z:.3g}" for z in choice.span)
    z = f"Z = {low} m/kg^(1/3)" if low == high else f"Z = {low} to {high} m/kg^(1/3)"
    law = LAWS.get((choice.quantity, found.method))
    where = f"inside {law.range}" if law else "inside the run"
    name = named(found.method)
    if choice.quantity not in REFERENCES:
        if choice.reference_uncertainty == 0.0:
            return f"{name}: exact"
        return (
            f"{name}: the law taken unless told otherwise; nothing was measured to "
            "hold it against, so no tolerance is supportable"
        )
    if not math.isfinite(choice.reference_uncertainty):
        end = REFERENCES[choice.quantity][-1].end
        return (
            f"{name}: {z}; the reference ends at Z = {end:g} and "
            f"{MAX_DISTANCE / 1000:g} km, so no tolerance is supportable there"
        )
    own = percent(choice.reference_uncertainty)
    if not found.valid:
        return f"{name}: {z}, not all {where}; no method holds at all of it"
    quality = (
        f"the reference there, itself good to {own}"
        if found.is_reference
        else f"off by up to {percent(found.error)} (the reference is good to {own})"
    )
    if choice.met or choice.tolerance == 0.0:
        return f"{name}: {z} {where}, {quality}"
    asked = f"a tolerance of {percent(choice.tolerance)}"
    if choice.reference_uncertainty > choice.tolerance:
        return f"{name}: {z} {where}; {asked} is not supportable: it is {quality}"
    short = found.predicted_error / choice.tolerance
    return (
        f"{name}: {z} {where}, the best there is, but {quality}: {asked} is missed by "
        f"a factor of {short:.2g}"
    )


def _rejected(choice: Choice, found: Candidate) -> Candidate | None:
    """Return the cheapest method passed over though it is cheaper, or costs alike."""
    others = [
        c
        for c in choice.candidates
        if c.method not in (found.method, SOLVER)
        and math.isfinite(c.error)
        and c.error > max(found.error, choice.tolerance)
    ]
    return others[0] if others else None


def _dearest(choice: Choice, found: Candidate) -> Candidate | None:
    """Return the method that would have cost most and holds, if it costs 10 times."""
    others = [c for c in choice.candidates if math.isfinite(c.error) and c.cost_s > 0.0]
    if not others or not found.cost_s > 0.0:
        return None
    dearest = max(others, key=lambda c: c.cost_s)
    return dearest if dearest.cost_s > 10.0 * found.cost_s else None
