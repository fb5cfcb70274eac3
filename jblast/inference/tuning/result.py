"""The result of tuning: numbers with intervals, null directions, explained share.

Intervals are normal in the coordinate of each number, at 90 %. A number that takes part
in a null direction has no value. One whose interval is nearly that of its prior is
marked as decided by the prior.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.identify import UNLEARNED
from jblast.inference.posterior.parameters import NORMAL_Q95, Estimate
from jblast.inference.tuning.search import Problem, Solution, identified_and_null
from jblast.inference.tuning.unknowns import Between, Unknown
from jblast.results import Note
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


class NothingHeardError(Exception):
    """No blast was found in a record."""


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
class NotIdentified:
    """A change of several parameters that does not change the record.

    Attributes:
        parameters: Component of each parameter in it, by name, in units of a large
            change of each.
    """

    parameters: Mapping[str, float]


@dataclass(frozen=True)
class Tuned:
    """Result of tuning.

    Attributes:
        kind: Kind of the record: "sound", "frames" or "events".
        numbers: Estimate of each tuned number by name.
        null_directions: Directions that the record does not identify.
        explained: Goodness of fit.
        converged: True if the search converged.
        problem: The problem.
        z: Coordinates of the result.
        sd: Standard deviation of each coordinate.
        notes: Remarks.
    """

    kind: Kind
    numbers: Mapping[str, Estimate]
    null_directions: tuple[NotIdentified, ...]
    explained: Explained
    converged: bool
    problem: Problem
    z: Float[np.ndarray, " unknown"]
    sd: Float[np.ndarray, " unknown"]
    notes: tuple[Note, ...] = ()

    @cached_property
    def scene(self) -> Scene:
        """The tuned scene; numbers that are not identified have the best value."""
        return self.problem.scene_at(jnp.asarray(self.z))

    @cached_property
    def before(self) -> Scene:
        """The scene before, or at the start of the search."""
        return self.problem.scene_at(self.problem.start)

    @property
    def is_identifiable(self) -> bool:
        """True if the record identifies all requested numbers."""
        return not self.null_directions

    @property
    def by_prior(self) -> tuple[str, ...]:
        """Numbers to whose priors the record adds nearly nothing."""
        pairs = zip(self.problem.unknowns, self.sd, strict=True)
        return tuple(one.name for one, sd in pairs if one.has_prior and sd > UNLEARNED)

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Numbers at a bound, which only logistic coordinates have."""
        pairs = zip(self.problem.unknowns, self.z, strict=True)
        return tuple(
            one.name
            for one, z in pairs
            if isinstance(one.belief, Between) and abs(z) > AT_BOUND
        )


def answer(
    problem: Problem,
    found: Solution,
    kind: Kind,
    explained: Explained,
    notes: Sequence[Note] = (),
    wider: Float[np.ndarray, " unknown"] | float = 1.0,
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
    names = [one.name for one in problem.unknowns]
    _, null, covariance = identified_and_null(found.information)
    sd = np.sqrt(np.diag(covariance)) * np.asarray(problem.steps()) * wider
    # by the squared components over all null directions: it does not depend on the
    # choice of their basis
    is_lost = np.square(null).sum(axis=0) > TAKES_PART**2
    return Tuned(
        kind=kind,
        numbers={
            one.name: Estimate() if lost else _estimate(one, *at)
            for one, lost, *at in zip(
                problem.unknowns, is_lost, found.z, sd, strict=True
            )
        },
        null_directions=tuple(
            NotIdentified(
                {
                    name: float(part)
                    for name, part in zip(names, vector, strict=True)
                    if abs(part) > TAKES_PART
                }
            )
            for vector in null
        ),
        explained=explained,
        converged=found.converged,
        problem=problem,
        z=found.z,
        sd=sd,
        notes=tuple(notes),
    )


def _estimate(one: Unknown, z: float, sd: float) -> Estimate:
    """Return a number with its interval, in its own unit."""
    # bounds are transformed from the coordinate, so they respect the limits of the
    # number
    away = np.array([0.0, -NORMAL_Q95, NORMAL_Q95, -1.0, 1.0])
    at = np.asarray(one.belief.constrain(z + sd * away))
    value, low, high, one_down, one_up = map(float, at)
    return Estimate(value, 0.5 * (one_up - one_down), q05=low, q95=high)
