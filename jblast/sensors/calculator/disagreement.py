"""Where laws that hold say different things, further apart than their scatter."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float

from jblast.json_values import HIDDEN
from jblast.registry import LAWS, total_scatter
from jblast.sensors.calculator.forward import Calculated, Calculation
from jblast.sensors.calculator.question import Question, path_of_rows
from jblast.sensors.calculator.recommended import choice_at
from jblast.waves.paths import Path

if TYPE_CHECKING:
    from jblast.fidelity import Choice

BEYOND = 1.645
"""Standard deviations of the difference of two laws: 90 % of their scatter lies within.
"""


@dataclass(frozen=True)
class Disagreement:
    """Two laws of one quantity that hold at a place and contradict each other there.

    Attributes:
        quantity: Of which.
        low: Law of the smaller value, where they are furthest apart.
        high: Law of the larger one.
        ratio: Larger over smaller value there.
        expected: Ratio that their scatter leaves, in 90 % of blasts.
        range_m: Range there.
        mass_kg: Mass there.
        rows: At how many rows any two laws disagree.
        choice: What we would take there; None if nothing tells.
    """

    quantity: str
    low: str
    high: str
    ratio: float
    expected: float
    range_m: float
    mass_kg: float
    rows: int
    choice: "Choice | None" = field(metadata=HIDDEN)


def disagreements(question: Question, answer: Calculation) -> list[Disagreement]:
    """Return the quantities of a calculation of which laws that hold disagree."""
    paths: dict[float, Path] = {}  # pressures and impulses may have a TNT mass each
    found = []
    for name, by_law in answer.items():
        laws = [law for law in by_law if (name, law) in LAWS]
        laws = [law for law in laws if by_law[law].valid.any()]
        if len(laws) < 2:
            continue
        factor = float(question.scene.charge.tnt_factor_for(name))
        if factor not in paths:
            paths[factor] = path_of_rows(question, name)
        found.append(_of(question, paths[factor], name, by_law, laws))
    return [one for one in found if one is not None]


def _of(
    question: Question,
    path: Path,
    quantity: str,
    by_law: Mapping[str, Calculated],
    names: list[str],
) -> Disagreement | None:
    """Return where some laws of a quantity are furthest apart, if they disagree."""
    scatter = {name: _scatter(quantity, name, path) for name in names}
    apart = {
        pair: _sds_apart([by_law[n] for n in pair], [scatter[n] for n in pair])
        for pair in combinations(names, 2)
    }
    sds = np.array(list(apart.values()))
    if not sds.max() > BEYOND:
        return None
    which, row = np.unravel_index(int(sds.argmax()), sds.shape)
    pair = list(apart)[which]
    low, high = sorted(pair, key=lambda name: by_law[name].value[row])
    ratio = float(by_law[high].value[row] / by_law[low].value[row])
    ranges, masses = question.rows()
    return Disagreement(
        quantity=quantity,
        low=low,
        high=high,
        ratio=ratio,
        expected=math.exp(BEYOND * math.hypot(*(scatter[n][row] for n in pair))),
        range_m=float(ranges[row]),
        mass_kg=float(masses[row]),
        rows=int((sds > BEYOND).any(axis=0).sum()),
        choice=_choice(question, quantity, int(row)),
    )


def _scatter(quantity: str, name: str, path: Path) -> Float[np.ndarray, " row"]:
    """Return one standard deviation of nature about a law, in ln, of each row."""
    sd = np.asarray(total_scatter(LAWS[quantity, name], path))
    return np.broadcast_to(sd, path.slant_range.shape)


def _sds_apart(
    pair: list[Calculated], scatter: list[Float[np.ndarray, " row"]]
) -> Float[np.ndarray, " row"]:
    """Return how far apart two laws are, in standard deviations; 0 where one ends."""
    one, other = pair
    both: Bool[np.ndarray, " row"] = one.valid & other.valid
    both &= (one.value > 0.0) & (other.value > 0.0)
    off = np.log(np.where(both, one.value, 1.0) / np.where(both, other.value, 1.0))
    sd = np.hypot(*scatter)
    return np.where(sd > 0.0, np.abs(off) / np.where(sd > 0.0, sd, 1.0), 0.0)


def _choice(question: Question, quantity: str, row: int) -> "Choice | None":
    """Return what `jblast choose` would take at a row for the best there is."""
    from jblast.fidelity.reference import REFERENCES  # read only where laws disagree

    if quantity not in REFERENCES:
        return None
    ranges, masses = question.rows()
    here = replace(
        question,
        slant_range=(float(ranges[row]),),
        charge_mass=(float(masses[row]),),
    )
    return choice_at(here, quantity)
