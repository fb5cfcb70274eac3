"""A planned log: its information, and the standard deviations that it leaves.

The same inverse of other information, with a row added or a number fixed, gives the
benefit of a reading and the sensitivity to other numbers.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from jblast.inference.answer import typical_steps
from jblast.inference.density import Density
from jblast.inference.posterior.fisher_information import (
    Inverse,
    information_with_each,
    inverted,
)
from jblast.inference.posterior.parameters import Parameters, Spread
from jblast.inference.posterior.posterior import Misfit, Posterior
from jblast.observations import Observations
from jblast.scene import Free, parameter_named
from jblast.waves.choice import TakenLaw

NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(40)
"""Gauss-Hermite nodes, which reach 11 sd: the standard deviation of a lognormal number
is exact to rounding up to an sd of 3 in ln."""


@dataclass(frozen=True)
class Planned:
    """A layout and its planned log.

    Attributes:
        values: Assumed values by name of `scene.PARAMETERS`.
        z: The same in the fitted coordinates.
        posterior: Layout and errors of the log; its readings are zero.
        misfit: Predictions and errors of the rows at the assumed values.
        slopes: Slopes of the predictions by the coordinates.
        density: Posterior density of the log.
        laws: The law of each quantity, with the reason for its choice.
        log: Readings without error.
    """

    values: Mapping[str, float]
    z: Float[np.ndarray, " free"]
    posterior: Posterior
    misfit: Misfit
    slopes: Float[np.ndarray, "row free"]
    density: Density
    laws: Mapping[str, TakenLaw]
    log: Observations

    @property
    def parameters(self) -> Parameters:
        """The uncertain numbers."""
        return self.posterior.parameters

    @cached_property
    def has_prior(self) -> Float[np.ndarray, " free"]:
        """1 for numbers with a prior, 0 for free ones."""
        return np.asarray(self.parameters.has_prior())

    @cached_property
    def information(self) -> Float[np.ndarray, "free free"]:
        """Fisher information of the log and the priors."""
        rows = len(self.slopes)
        return information_with_each(self.posterior, self.misfit, self.slopes, rows)[0]

    def inverse(
        self,
        known: Float[np.ndarray, "*batch free free"],
        has_prior: Float[np.ndarray, "*batch free"] | None = None,
    ) -> Inverse:
        """Return the inverse of other information, see `left`."""
        has_prior = self.has_prior if has_prior is None else has_prior
        return inverted(known, has_prior, typical_steps(self.density))

    @cached_property
    def target(self) -> int:
        """Index of the least certain mass; without one, of the least certain number.

        Numbers are compared by their sd relative to a typical step.
        """
        found, names = self.inverse(self.information), self.parameters.names
        sd = np.sqrt(np.diag(found.covariance)) / typical_steps(self.density)
        sd = np.where(found.is_open, np.inf, sd)
        masses = np.array([n.partition(".")[0] == "charge_mass_kg" for n in names])
        return int(np.argmax(np.where(masses | ~masses.any(), sd, -1.0)))

    def left(
        self,
        i: int,
        known: Float[np.ndarray, "lane free free"],
        has_prior: Float[np.ndarray, "lane free"] | None = None,
    ) -> list[Spread]:
        """Return the standard deviations of a number by other information.

        Args:
            i: Index of the number.
            known: Information, priors included.
            has_prior: 1 for numbers with a prior; by default those of the scene.
        """
        found = self.inverse(known, has_prior)
        spreads = self.spreads(i, found.covariance[:, i, i])
        open_ones = found.is_open[:, i]
        return [
            Spread() if is_open else spread
            for spread, is_open in zip(spreads, open_ones, strict=True)
        ]

    def spreads(self, i: int, variance: Float[np.ndarray, " lane"]) -> list[Spread]:
        """Return the standard deviations of a number by normals of its coordinate.

        Args:
            i: Index of the number.
            variance: Variances of its coordinate.
        """
        name, belief = self.parameters.names[i], self.parameters.beliefs[i]
        sds = np.sqrt(variance)
        log_sds = np.full_like(sds, np.nan)
        with np.errstate(over="ignore", invalid="ignore"):  # a mass nothing bounds
            x = np.asarray(belief.constrain(self.z[i] + sds[:, None] * NODES))
            if parameter_named(name).positive:
                # a normal prior reaches below zero at the outer nodes
                some = x > 0
                is_ln = isinstance(belief, Free)
                log_x = np.log(np.where(some, x, 1.0))
                log_sds = sds if is_ln else _sd(log_x, WEIGHTS * some)
            return [*map(Spread, _sd(x, WEIGHTS).tolist(), log_sds.tolist())]


def _sd(x, weights) -> Float[np.ndarray, " lane"]:
    weights = weights / np.sum(weights, axis=-1, keepdims=True)
    away = x - np.sum(weights * x, axis=-1, keepdims=True)
    return np.sqrt(np.sum(weights * np.square(away), axis=-1))
