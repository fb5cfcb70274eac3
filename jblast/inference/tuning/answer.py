"""From where a search ended to an answer: numbers, intervals, what is not told."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.tuning.notes import Note
from jblast.inference.tuning.result import (
    Explained,
    Kind,
    NullDirection,
    Tuned,
    TunedNumber,
)
from jblast.inference.tuning.search.solve import (
    Problem,
    Solution,
    parts_told,
)
from jblast.inference.tuning.unknowns import Between, Unknown, tuned_value

QUANTILE_90 = 1.6448536269514722
"""Of the standard normal distribution at 95 %."""
TAKES_PART = 0.2
"""Share of a direction from which on a number is said to be in it."""
FAR_OUT = 6.0
"""Logistic coordinate at which a number is at its bound."""
NEARLY_PRIOR = 0.95
"""Of the sd believed: what is left of it where a record adds nothing."""


def answer(
    problem: Problem,
    found: Solution,
    kind: Kind,
    explained: Explained,
    notes: Sequence[Note] = (),
    wider: Float[np.ndarray, " unknown"] | None = None,
) -> Tuned:
    """Return the answer: numbers with intervals, and what is not told.

    Args:
        problem: What was solved.
        found: Where the search ended.
        kind: Of the record.
        explained: How well the record is explained there.
        notes: What to know.
        wider: By which standard deviations are wider than independent residuals say.
    """
    unknowns, z = problem.unknowns, found.z
    total = found.record_information + found.prior_information
    _, null, covariance = parts_told(total)
    steps = np.asarray(problem.steps())
    untold = (np.square(null).sum(axis=0) > TAKES_PART**2) if len(null) else None
    before = problem.scene_at(problem.start)
    index = problem.evidence.index
    numbers = {}
    for number, one in enumerate(unknowns):
        sd = float(np.sqrt(max(covariance[number, number], 0.0)) * steps[number])
        if wider is not None:
            sd *= float(wider[number])
        is_told = untold is None or not untold[number]
        numbers[one.name] = _number(
            one, float(z[number]), sd, is_told, tuned_value(before, index, one.name)
        )
    directions = tuple(
        NullDirection(
            {
                one.name: float(part)
                for one, part in zip(unknowns, vector, strict=True)
                if abs(part) > TAKES_PART
            }
        )
        for vector in null
    )
    return Tuned(
        kind=kind,
        numbers=numbers,
        null_directions=directions,
        explained=explained,
        converged=found.converged,
        scene=problem.scene_at(jnp.asarray(z)),
        before=before,
        problem=problem,
        z=z,
        notes=tuple(notes),
    )


def _number(
    one: Unknown, z: float, sd: float, is_told: bool, before: Float[Array, ""] | None
) -> TunedNumber:
    """Return a number with its interval, in its own unit."""
    value, low, high, one_up, one_down = (
        float(one.belief.constrain(jnp.asarray(z + away * sd)))
        for away in (0.0, -QUANTILE_90, QUANTILE_90, 1.0, -1.0)
    )
    at_bound = isinstance(one.belief, Between) and abs(z) > FAR_OUT
    return TunedNumber(
        value=value if is_told else None,
        sd=0.5 * (one_up - one_down) if is_told else None,
        q05=low if is_told else None,
        q95=high if is_told else None,
        before=float(np.asarray(before)),
        fitted=value,
        prior_decides=bool(one.has_prior and sd > NEARLY_PRIOR),
        at_bound=at_bound,
    )
