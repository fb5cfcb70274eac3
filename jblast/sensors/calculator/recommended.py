"""The law that one question is answered with: what `auto` takes there, and how sure."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import jax
import numpy as np

from jblast.json_values import ABSENT, HIDDEN
from jblast.registry import LAWS, names_for, total_scatter
from jblast.sensors.calculator.combined import COMBINATIONS
from jblast.sensors.calculator.forward import Calculated, evaluate
from jblast.sensors.calculator.inverse import Roots
from jblast.sensors.calculator.question import Question, path_of_rows

if TYPE_CHECKING:  # what is stored of methods is read where one answer is wanted
    from jblast.fidelity import Choice

STEP = 1e-3
"""In ln of a range or a mass: differences over it are a law's slope."""


@dataclass(frozen=True)
class Recommended:
    """One answer to one question.

    Attributes:
        quantity: What was asked for: a quantity, `range_m` or `charge_mass_kg`.
        law: By which law; "" where none gives it.
        value: In SI.
        valid: Whether the law holds there.
        scatter: One standard deviation of nature about it, in ln of what was asked for;
            NaN where it is not known.
        choice: By which it was taken; None where there is no other law, and where none
            was chosen.
        is_nearest: Whether the chosen law does not give the value: then it is the
            nearest to the others of those that give it where they hold.
        solutions: Of a range or a mass: every one at which the law takes the value
            within its range, ascending; `value` is one of them. Absent of a quantity.
    """

    quantity: str
    law: str
    value: float
    valid: bool
    scatter: float
    choice: "Choice | None" = field(default=None, metadata=HIDDEN)
    is_nearest: bool = field(default=False, metadata=HIDDEN)
    solutions: tuple[float, ...] | None = field(default=None, metadata=ABSENT)


def choice_at(question: Question, quantity: str) -> "Choice":
    """Return what `auto` chooses of a quantity at a question's one row.

    The best there is: nothing is said of how near is near enough.
    """
    from jblast.fidelity import choose_for
    from jblast.fidelity.conditions import jitted_conditions

    path = path_of_rows(question, quantity)
    if path.burst is None:
        burst = "free-air" if bool(np.asarray(path.free_air)[0]) else "surface"
        path = path.at_burst(burst)
    conditions = jax.tree.map(np.asarray, jitted_conditions(quantity, path))
    return choose_for(quantity, [conditions], 0.0)


def recommended_value(
    question: Question, quantity: str, by_law: Mapping[str, Calculated]
) -> Recommended:
    """Return the answer to a question of one range, one mass and one quantity.

    Args:
        question: What was asked.
        quantity: Which.
        by_law: What the laws say of it.
    """
    law, choice = _of(question, quantity, tuple(by_law))
    found = by_law[law]
    return Recommended(
        quantity=quantity,
        law=law,
        value=float(found.value[0]),
        valid=bool(found.valid[0]),
        scatter=law_scatter(question, quantity, law),
        choice=choice,
    )


def recommended_root(question: Question, by_law: Mapping[str, Roots]) -> Recommended:
    """Return the range or mass at which a quantity takes its value.

    The law is chosen where most laws that hold say that it is; one that does not give
    the value there gives way to the first that does.

    Args:
        question: Of a quantity, its target, and one range or one mass.
        by_law: From `inverse.roots`.
    """
    asked = "range_m" if question.charge_mass else "charge_mass_kg"
    best = {name: found.best() for name, found in by_law.items()}
    best = {name: root for name, root in best.items() if root is not None}
    holding = {name: value for name, (value, valid) in best.items() if valid}
    if not holding:
        return Recommended(asked, "", math.nan, False, math.nan, solutions=())
    middle = math.exp(float(np.median(np.log(list(holding.values())))))
    law, choice = _of(_at(question, middle), question.quantity, tuple(by_law))
    is_nearest = law not in holding
    if is_nearest:
        law = min(holding, key=lambda name: abs(math.log(holding[name] / middle)))
    value = holding[law]
    scatter = law_scatter(_at(question, value), question.quantity, law)
    slope = _slope(question, value, law)
    return Recommended(
        quantity=asked,
        law=law,
        value=value,
        valid=True,
        scatter=scatter / abs(slope) if slope else math.nan,
        solutions=tuple(map(float, by_law[law].value[by_law[law].valid])),
        choice=None if is_nearest else choice,
        is_nearest=is_nearest,
    )


def law_scatter(question: Question, quantity: str, law: str) -> float:
    """Return one standard deviation of nature about a law, in ln, at a question's row.

    NaN of what is combined of several laws.
    """
    if (quantity, law) not in LAWS:
        return math.nan
    sd = total_scatter(LAWS[quantity, law], path_of_rows(question, quantity))
    return float(np.ravel(np.asarray(sd))[0])


def _of(
    question: Question, quantity: str, names: tuple[str, ...]
) -> "tuple[str, Choice | None]":
    """Return which of some laws is taken, and what it was chosen by."""
    if len(names) == 1:
        return names[0], None
    parts = COMBINATIONS[quantity].parts if quantity in COMBINATIONS else (quantity,)
    for part in parts:
        if names_for(part):
            choice = choice_at(question, part)
            if choice.method in names:
                return choice.method, choice
    return names[0], None


def _at(question: Question, value: float) -> Question:
    """Return a question with the range or the mass that it asks for put in."""
    if question.charge_mass:
        return replace(question, slant_range=(value,))
    return replace(question, charge_mass=(value,))


def _slope(question: Question, value: float, law: str) -> float:
    """Return the slope of ln quantity against ln of what is asked for."""
    values = value * np.exp([-STEP, STEP])
    if question.charge_mass:
        ranges, masses = values, np.full(2, question.charge_mass[0])
    else:
        ranges, masses = np.full(2, question.slant_range[0]), values
    found, _ = evaluate(question.scene, ranges, masses, (LAWS[question.quantity, law],))
    low, high = np.log(found[0])
    return float((high - low) / (2.0 * STEP))
