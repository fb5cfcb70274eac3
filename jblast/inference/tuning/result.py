"""The result of tuning: numbers with intervals, null directions, explained share.

Intervals are normal in the coordinate of each number, at 90 %. A number that takes part
in a null direction has no value. One whose interval is nearly that of its prior is
marked as decided by the prior.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.mode.laplace import NORMAL_Q95
from jblast.inference.tuning.search import Problem, Solution, parts_told
from jblast.inference.tuning.unknowns import Between, Unknown, tuned_value
from jblast.scene import Scene

Kind = Literal["sound", "frames", "events"]
POOR = 1e-3
"""Probability of what is left, below which a record counts as poorly explained."""
TO_MEDIAN = 0.6745
"""Median magnitude of a standard normal number."""
TAKES_PART = 0.2
"""Share of a direction from which on a number counts as part of it."""
FAR_OUT = 6.0
"""Logistic coordinate at which a number is at its bound."""
NEARLY_PRIOR = 0.95
"""Of the sd believed: what is left of it where a record adds nothing."""
NoteKind = Literal[
    "reading",
    "noise_added",
    "blast_outside",
    "law_invalid",
    "thinned",
]


class NothingHeardError(Exception):
    """A record holds nothing of what is looked for."""


@dataclass(frozen=True)
class TunedNumber:
    """A number that was looked for.

    Attributes:
        value: The most probable one; null where the record does not identify it.
        sd: Its standard deviation, in its unit.
        q05: It is less with 5 %.
        q95: It is less with 95 %.
        before: Its value in the scene, or where the search began.
        fitted: Its value in the tuned scene, identified or not.
        prior_decides: Whether the record adds next to nothing to what was believed.
        at_bound: Whether it ended where its bounds leave no more room.
    """

    value: float | None
    sd: float | None
    q05: float | None
    q95: float | None
    before: float
    fitted: float
    prior_decides: bool
    at_bound: bool


@dataclass(frozen=True)
class Explained:
    """How well a record is explained.

    Attributes:
        chi2: Sum of squares of what is left, each over its variance.
        dof: Expected of it.
        tests: Probability of so much, by what was looked at.
        error: Of pictures, rms of what is left in steps of 8 bits; of events, the
            typical one in thresholds; null of sound.
        error_allowed: More counts as poorly explained.
    """

    chi2: float
    dof: int
    tests: Mapping[str, float]
    error: float | None = None
    error_allowed: float | None = None

    @property
    def is_poor(self) -> bool:
        """Whether one of the tests fails, or the error is more than allowed."""
        too_large = (
            self.error is not None
            and self.error_allowed is not None
            and self.error > self.error_allowed
        )
        return too_large or any(p < POOR for p in self.tests.values())


@dataclass(frozen=True)
class NullDirection:
    """A change of several numbers that leaves the record as it is.

    Attributes:
        parameters: How much each takes part, in large changes of it.
    """

    parameters: Mapping[str, float]


class Note(NamedTuple):
    """A remark on the result.

    Attributes:
        kind: What it is about.
        about: Its numbers and names.
    """

    kind: NoteKind
    about: Mapping[str, Any]


@dataclass(frozen=True)
class Tuned:
    """An answer.

    Attributes:
        kind: Of the record: "sound", "frames" or "events".
        numbers: What was looked for, by name.
        null_directions: Directions that the record does not identify.
        explained: How well the record is explained.
        converged: Whether the search ended of itself.
        scene: With what was found.
        before: As it was, or where the search began.
        problem: What was solved.
        z: Coordinates of what was found.
        notes: Remarks.
    """

    kind: Kind
    numbers: Mapping[str, TunedNumber]
    null_directions: tuple[NullDirection, ...]
    explained: Explained
    converged: bool
    scene: Scene
    before: Scene
    problem: Problem
    z: Float[np.ndarray, " unknown"]
    notes: tuple[Note, ...] = ()

    @property
    def is_identifiable(self) -> bool:
        """Whether the record identifies all requested numbers."""
        return not self.null_directions


def answer(
    problem: Problem,
    found: Solution,
    kind: Kind,
    explained: Explained,
    notes: Sequence[Note] = (),
    wider: Float[np.ndarray, " unknown"] | None = None,
) -> Tuned:
    """Return the answer: numbers with intervals, and null directions.

    Args:
        problem: What was solved.
        found: Where the search ended.
        kind: Of the record.
        explained: How well the record is explained there.
        notes: Remarks.
        wider: Factor of standard deviations over those of independent residuals.
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
        for away in (0.0, -NORMAL_Q95, NORMAL_Q95, 1.0, -1.0)
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
