"""What each term of the objective costs, at every size of its residual."""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.posterior.error_density import log_noise, noise_slopes
from jblast.inference.posterior.fisher_information import information_of_row
from jblast.sensors.simulate import Noise

LEAST_CURVATURE = 0.1
"""A wild reading's cost bends downwards; a step counts it as this much of its weight,
which bends upwards."""


@dataclass(frozen=True)
class TermLoss:
    """Minus ln density of each term of `many.residuals.rows.Miss`, up to a constant.

    Attributes:
        noise: Distribution of the independent errors.
        rows: How many terms are readings.
        scored: How many are readings, effects or numbers with a prior; those after
            them are ln of the rows' scales.
    """

    noise: Noise
    rows: int
    scored: int

    def __call__(
        self, residual: Float[Array, "term lane"]
    ) -> tuple[Array, Array, Array]:
        """Return the cost, its slope and a curvature that is positive."""
        return self._loss(residual, LEAST_CURVATURE)

    def true(self, residual: Float[Array, "term lane"]) -> tuple[Array, Array, Array]:
        """Return the same, with the curvature that wild readings really have."""
        return self._loss(residual, None)

    def information(self, residual: Float[Array, "term lane"]) -> np.ndarray:
        """Return the expected curvature of each term."""
        of_rows = np.full(self.rows, information_of_row(self.noise))
        rest = np.ones(residual.shape[0] - self.rows)
        return np.concatenate([of_rows, rest]).astype(residual.dtype)[:, None]

    def _loss(self, residual, least):
        n, m = self.rows, self.scored
        u, normal, scale = residual[:n], residual[n:m], residual[m:]
        slope, curvature = noise_slopes(u, self.noise)
        if self.noise == "student" and least is not None:
            weight = slope / jnp.where(u == 0, 1.0, u)
            curvature = jnp.maximum(curvature, least * weight)
        value = log_noise(jnp.zeros((), u.dtype), self.noise) - log_noise(u, self.noise)
        one, zero = jnp.ones_like(normal), jnp.zeros_like(scale)
        return (
            jnp.concatenate([value, 0.5 * jnp.square(normal), scale]),
            jnp.concatenate([slope, normal, zero + 1]),
            jnp.concatenate([curvature, one, zero]),
        )
