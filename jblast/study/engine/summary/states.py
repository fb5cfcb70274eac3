"""States of a study's outcomes: of each variant, cell and sensor, and as arrays.

A state is that of `statistics`, of samples without weights: moments and a sketch of
quantiles of a number, counts of yes and no. States of parts of a study, merged in the
order of the samples, are the state of the whole, whoever calculated which part.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.study.engine.variable import Variable
from jblast.study.statistics import ACCUMULATORS
from jblast.study.statistics.moments import Moments
from jblast.study.statistics.number import NumberState
from jblast.study.statistics.quantile_sketch import BINS, QuantileSketch
from jblast.study.statistics.share import ShareState

State = Any
States = Mapping[str, State]
"""By outcome a state, its arrays of variant and cell together, then of sensors."""

NUMBERS = ("finite", "infinite", "lost", "mean", "squares", "minimum", "maximum")
SHARES = ("known", "yes", "lost")
MOST_COUNTS = 1 << 26
"""Bins of all sketches of a study, half a gigabyte."""


class Anchor(NamedTuple):
    """What a number is counted from, so that no digit of its spread is lost.

    Attributes:
        shift: A value among its own, about which sums are taken.
        origin: What the bins of its sketch are counted from.
    """

    shift: Float[np.ndarray, "..."]
    origin: Float[np.ndarray, "..."]


Anchors = Mapping[str, Anchor]


def outcomes_of(variables: Sequence[Variable]) -> list[Variable]:
    """Return the columns that are answers."""
    return [v for v in variables if v.role == "outcome"]


def shape_of(variable: Variable, groups: int) -> tuple[int, ...]:
    """Return the shape of an outcome's state: variants and cells, sensors if any."""
    return variable.shape(groups)


def counts_in(variables: Sequence[Variable], groups: int) -> int:
    """Return how many bins a state has."""
    numbers = [v for v in outcomes_of(variables) if v.kind == "number"]
    return BINS * sum(int(np.prod(shape_of(v, groups))) for v in numbers)


def empty_states(
    variables: Sequence[Variable], groups: int, anchors: Anchors
) -> dict[str, State]:
    """Return the states of no samples."""
    found = {}
    for v in outcomes_of(variables):
        origin = anchors[v.name].origin if v.kind == "number" else 0.0
        found[v.name] = ACCUMULATORS[v.kind].empty(shape_of(v, groups), origin)
    return found


def merged_states(
    variables: Sequence[Variable], a: States, b: States
) -> dict[str, State]:
    """Merge states; `a` stands before `b` in the order of the samples.

    Raises:
        ValueError: Their sketches are counted from different origins.
    """
    return {
        v.name: ACCUMULATORS[v.kind].merge(a[v.name], b[v.name])
        for v in outcomes_of(variables)
    }


def moments_from(array: Float[np.ndarray, "... 7"]) -> Moments:
    """Return moments from the numbers that stand for them, `NUMBERS`."""
    finite, infinite, lost, mean, squares, low, high = np.moveaxis(array, -1, 0)
    whole = [x.astype(np.int64) for x in (finite, infinite, lost)]
    one = finite.astype(float), mean, squares
    return Moments._make([*whole, *one, *one, low, high])


def packed(variable: Variable, state: State) -> dict[str, np.ndarray]:
    """Return a state as arrays, by what they are called beside the outcome's name."""
    if variable.kind == "yes_no":
        return {"share": np.stack([state.known, state.yes, state.lost], -1)}
    m = state.moments
    parts = m.finite, m.infinite, m.lost, m.mean, m.squares, m.minimum, m.maximum
    numbers = np.stack([np.asarray(x, float) for x in parts], -1)
    return {"moments": numbers, "counts": np.asarray(state.sketch.counts, np.int64)}


def unpacked(
    variable: Variable, arrays: Mapping[str, np.ndarray], anchors: Anchors
) -> State:
    """Return the state that arrays stand for."""
    if variable.kind == "yes_no":
        return share_from(*np.moveaxis(arrays["share"], -1, 0))
    sketch = QuantileSketch(arrays["counts"], anchors[variable.name].origin)
    return NumberState(moments_from(arrays["moments"]), sketch)


def share_from(known: np.ndarray, yes: np.ndarray, lost: np.ndarray) -> ShareState:
    """Return the state of yes and no without weights."""
    weight, hit = known.astype(float), yes.astype(float)
    return ShareState(known, yes, lost, weight, weight, hit, hit)
