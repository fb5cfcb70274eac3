"""What was tuned, by how much, and how well the record is explained."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from jblast.inference.tuning.notes import Note
from jblast.inference.tuning.search.solve import Problem
from jblast.scene import Scene


class NothingHeardError(Exception):
    """A record holds nothing of what is looked for."""


Kind = Literal["sound", "frames", "events"]


@dataclass(frozen=True)
class TunedNumber:
    """A number that was looked for.

    Attributes:
        value: The most probable one; None where the record does not tell it.
        sd: Its standard deviation, in its unit.
        q05: It is less with 5 %.
        q95: It is less with 95 %.
        before: What the scene said, or where the search began.
        fitted: What the tuned scene holds, told or not.
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
            typical one in thresholds; None of sound.
        error_allowed: More counts as poorly explained.
    """

    chi2: float
    dof: int
    tests: Mapping[str, float]
    error: float | None = None
    error_allowed: float | None = None

    @property
    def is_poor(self) -> bool:
        """Whether one of the tests says so, or the error is more than allowed."""
        too_large = (
            self.error is not None
            and self.error_allowed is not None
            and self.error > self.error_allowed
        )
        return too_large or any(p < POOR for p in self.tests.values())


POOR = 1e-3
"""Probability of what is left, below which a record counts as poorly explained."""


@dataclass(frozen=True)
class NullDirection:
    """A change of several numbers that leaves the record as it is.

    Attributes:
        parameters: How much each takes part, in large changes of it.
    """

    parameters: Mapping[str, float]


@dataclass(frozen=True)
class Tuned:
    """An answer.

    Attributes:
        kind: Of the record: "sound", "frames" or "events".
        numbers: What was looked for, by name.
        null_directions: What the record does not tell.
        explained: How well the record is explained.
        converged: Whether the search ended of itself.
        scene: With what was found.
        before: As it was, or where the search began.
        problem: What was solved.
        z: Coordinates of what was found.
        notes: What to know.
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
        """Whether the record tells all that was looked for."""
        return not self.null_directions
