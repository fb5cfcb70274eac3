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

from jblast.inference.posterior.parameters import NORMAL_Q95
from jblast.inference.tuning.search import Problem, Solution, identified_and_null
from jblast.inference.tuning.unknowns import Between, Unknown, tuned_value
from jblast.scene import Scene

Kind = Literal["sound", "frames", "events"]
POOR = 1e-3
"""Probability of the residual below which a record is poorly explained: one in a
thousand by chance, as for a poor fit."""
TO_MEDIAN = 0.6745
"""Median magnitude of a standard normal number: it turns a median into a standard
deviation that outliers do not change."""
TAKES_PART = 0.2
"""Smallest component of a number in a null direction for a report: 4 % of its
square."""
AT_BOUND = 6.0
"""Logistic coordinate beyond which a number is at its bound: within 0.25 % of the
interval."""
NEARLY_PRIOR = 0.95
"""Ratio of a number's sd to that of its prior above which the prior decides: the record
contains less than a tenth of the information."""
NoteKind = Literal[
    "reading",
    "noise_added",
    "blast_outside",
    "law_invalid",
    "thinned",
]


class NothingHeardError(Exception):
    """No blast was found in a record."""


@dataclass(frozen=True)
class TunedNumber:
    """A tuned number.

    Attributes:
        value: The most probable value; null if the record does not identify it.
        sd: Standard deviation, in its unit.
        q05: 5 % quantile.
        q95: 95 % quantile.
        before: Value in the scene, or start of the search.
        fitted: Value in the tuned scene, identified or not.
        prior_decides: True if the record adds nearly nothing to the prior.
        at_bound: True if the result is at a bound.
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
    """Goodness of fit of a record.

    Attributes:
        chi2: Sum of squares of the residuals, each over its variance.
        dof: Expected value of `chi2`.
        tests: Probability of a larger statistic, by name of the test.
        error: For pictures the rms residual in steps of 8 bits, for events the typical
            residual in thresholds; null for sound.
        error_allowed: Limit of `error`.
    """

    chi2: float
    dof: int
    tests: Mapping[str, float]
    error: float | None = None
    error_allowed: float | None = None

    @property
    def is_poor(self) -> bool:
        """True if one of the tests fails, or the error exceeds its limit."""
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
        parameters: Component of each number, in large changes.
    """

    parameters: Mapping[str, float]


class Note(NamedTuple):
    """A remark on the result.

    Attributes:
        kind: Subject of the remark.
        about: Its numbers and names.
    """

    kind: NoteKind
    about: Mapping[str, Any]


@dataclass(frozen=True)
class Tuned:
    """Result of tuning.

    Attributes:
        kind: Kind of the record: "sound", "frames" or "events".
        numbers: The tuned numbers by name.
        null_directions: Directions that the record does not identify.
        explained: Goodness of fit.
        converged: True if the search converged.
        scene: The tuned scene.
        before: The scene before, or at the start of the search.
        problem: The problem.
        z: Coordinates of the result.
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
        """True if the record identifies all requested numbers."""
        return not self.null_directions


def answer(
    problem: Problem,
    found: Solution,
    kind: Kind,
    explained: Explained,
    notes: Sequence[Note] = (),
    wider: Float[np.ndarray, " unknown"] | None = None,
) -> Tuned:
    """Return the result: numbers with intervals, and null directions.

    Args:
        problem: The problem.
        found: End of the search.
        kind: Kind of the record.
        explained: Goodness of fit.
        notes: Remarks.
        wider: Factor of standard deviations over those of independent residuals.
    """
    unknowns, z = problem.unknowns, found.z
    total = found.record_information + found.prior_information
    _, null, covariance = identified_and_null(total)
    steps = np.asarray(problem.steps())
    # by the squared components over all null directions: it does not depend on the
    # choice of their basis
    in_null = (np.square(null).sum(axis=0) > TAKES_PART**2) if len(null) else None
    before = problem.scene_at(problem.start)
    index = problem.evidence.index
    numbers = {}
    for number, one in enumerate(unknowns):
        sd = float(np.sqrt(max(covariance[number, number], 0.0)) * steps[number])
        if wider is not None:
            sd *= float(wider[number])
        is_identified = in_null is None or not in_null[number]
        numbers[one.name] = _number(
            one,
            float(z[number]),
            sd,
            is_identified,
            tuned_value(before, index, one.name),
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
    one: Unknown,
    z: float,
    sd: float,
    is_identified: bool,
    before: Float[Array, ""] | None,
) -> TunedNumber:
    """Return a number with its interval, in its own unit."""
    # bounds are transformed from the coordinate, so they respect the limits of the
    # number
    value, low, high, one_up, one_down = (
        float(one.belief.constrain(jnp.asarray(z + away * sd)))
        for away in (0.0, -NORMAL_Q95, NORMAL_Q95, 1.0, -1.0)
    )
    # only a logistic coordinate has bounds
    at_bound = isinstance(one.belief, Between) and abs(z) > AT_BOUND
    return TunedNumber(
        value=value if is_identified else None,
        sd=0.5 * (one_up - one_down) if is_identified else None,
        q05=low if is_identified else None,
        q95=high if is_identified else None,
        before=float(np.asarray(before)),
        fitted=value,
        prior_decides=bool(one.has_prior and sd > NEARLY_PRIOR),
        at_bound=at_bound,
    )
