"""What a fit returns: what was found, and what a figure of it needs."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from jblast.inference.fitting.goodness_of_fit import POOR, p_value
from jblast.inference.fitting.summary import Summary
from jblast.inference.posterior.finding import Finding
from jblast.observations import Observations
from jblast.scene import Scene


@dataclass(frozen=True)
class Band:
    """What the posterior says of one quantity along a line away from the charge.

    Attributes:
        quantity: A key of `observations.QUANTITIES`.
        shot: Of which of the scene's charges.
        axis: "range_m", or "time_s" for `TIMED` quantities.
        x: Where, increasing.
        q05: 5 % quantile over the posterior, laws taken as exact; clock times are on
            the common clock.
        answer: The law at the answer, as `Fit.predicted`.
        q95: 95 % quantile.
        valid: Where the law holds at the answer.
    """

    quantity: str
    shot: int
    axis: str
    x: Float[np.ndarray, " point"]
    q05: Float[np.ndarray, " point"]
    answer: Float[np.ndarray, " point"]
    q95: Float[np.ndarray, " point"]
    valid: Bool[np.ndarray, " point"]


@dataclass(frozen=True)
class Fit:
    """The answer to one log.

    Attributes:
        summary: What was found.
        observations: The log.
        scene: The scene at the maximum of the posterior.
        predicted: The law's value at each row, in the row's unit.
        distance: Slant range of each row at the answer [m].
        residual: (measured - predicted - shared effects) / sd of each row; of a lower
            bound the least error that keeps it: 0 where the law says more.
        sd: Independent standard deviation of each row: seconds for times, else in ln.
        shared: The shared effects at each row, same unit as `sd`.
        draws: Posterior draws of every parameter that the data determine.
        shot: Which of the scene's charges each row is of.
        bands: One for each quantity observed, and charge.
        weighted: Whether draws of the normal approximation were weighted.
        posterior_reason: Why intervals come from the normal approximation, or a walk.
        ensemble: The walk the draws are from, where there was one.
        density: The posterior.
        exit_code: 0 answered, 4 computed with a doubt: not converged, not
            identifiable, nothing that was asked for identified, a poor fit, a law that
            holds for no row or not for those a requested number rests on, or a log
            that one clock or sensor spoils.
    """

    summary: Summary
    observations: Observations
    scene: Scene
    predicted: Float[np.ndarray, " row"]
    distance: Float[np.ndarray, " row"]
    residual: Float[np.ndarray, " row"]
    sd: Float[np.ndarray, " row"]
    shared: Float[np.ndarray, " row"]
    shot: tuple[int, ...]
    draws: Mapping[str, Float[np.ndarray, " draw"]] = field(default_factory=dict)
    bands: tuple[Band, ...] = ()
    posterior_reason: Finding | None = None
    weighted: bool = False
    ensemble: Any = None
    density: Any = None

    @property
    def origin_time(self) -> Float[np.ndarray, " row"]:
        """When the charge of each row exploded, on the common clock [s]."""
        times = np.array([float(charge.time_s) for charge in self.scene.charges])
        return times[list(self.shot)]

    @property
    def exit_code(self) -> int:
        """Return the exit code of the contract: 0 answered, 4 computed with a doubt."""
        found = self.summary
        answered = found.converged and found.identifiable
        answered = answered and not found.identifies_nothing
        doubt = self.is_poor or self.is_outside or self.summary.explained_by
        return 0 if answered and not doubt else 4

    @property
    def is_poor(self) -> bool:
        """Whether the log disagrees with its laws by more than its errors allow."""
        p = p_value(self.summary.chi2, self.summary.dof)
        return p is not None and p < POOR

    @property
    def is_outside(self) -> bool:
        """Whether the laws hold for no row, or a number rests on rows outside."""
        return self.summary.law_valid_rows == 0 or bool(self.summary.extrapolated)

    def to_dict(self) -> dict[str, Any]:
        """Return what was found as JSON can hold it."""
        return self.summary.to_dict()
