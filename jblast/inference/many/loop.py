"""One loop over lanes: Levenberg-Marquardt, and what its results are worth."""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from jblast.inference.many.lanes import LaneResults
from jblast.inference.many.residuals.readings import Readings
from jblast.inference.many.residuals.rows import LaneRows
from jblast.inference.many.solver.levenberg_marquardt import LaneLevenbergMarquardt
from jblast.inference.many.solver.newton import newton
from jblast.inference.many.solver.normal_equations import Triangle, cholesky, inverse_of
from jblast.inference.many.solver.quadratic_model import (
    Expansion,
    expansion,
    half_square,
    triangle,
)
from jblast.inference.many.starts.multilateration import ClosedForm

MOST_STEPS = 200

Inputs = tuple[Float[Array, "unknown lane"] | None, Readings]
"""Where lanes start, or nothing where that is the closed form; and their readings."""


def with_effects(
    rows: LaneRows, z: Float[Array, "free lane"]
) -> Float[Array, "unknown lane"]:
    """Return a place by its coordinates, the shared effects at zero."""
    return jnp.concatenate([z, jnp.zeros((rows.effects, z.shape[1]), z.dtype)])


@dataclass(frozen=True)
class Loop:
    """Fits lanes of one layout.

    Attributes:
        rows: The layout.
        solver: With the loss of these rows.
        form: Where lanes start that are given no start.
        sigma: Instrument errors if all logs have the same.
    """

    rows: LaneRows
    solver: LaneLevenbergMarquardt
    form: ClosedForm | None
    sigma: Float[np.ndarray, "row 1"] | None

    def fit(self, stragglers: Float[Array, ""], lanes: Inputs) -> LaneResults:
        """Fit lanes, but for the share of them that is not waited for."""
        y, (measured, errors, bad) = lanes
        if y is None:
            # here, and not beforehand: where the readings are in a cache
            y = self._begin(measured)
        sigma = self._sigma(errors)
        bad = bad | ~jnp.isfinite(y).all(axis=0)
        y = jnp.where(jnp.isfinite(y), y, 0.0)
        floor = self._floor(measured, sigma)
        options = {"floor": floor, "skip": bad, "stragglers": stragglers}

        def residuals(y, args):
            return self.rows.miss(y, args[0], self._sigma(args[1]))

        found = optx.least_squares(
            residuals,
            self.solver,
            y,
            (measured, errors),
            options=options,
            has_aux=True,
            max_steps=MOST_STEPS,
            throw=False,
        )
        state, free = found.state, len(self.rows.parameters.names)
        true, misfit, known = self._end(found.value, state.info, measured, sigma, floor)
        # by the curvature that the solver goes by; the true one may be less than it
        converged = self.solver.at_optimum(state.info) & cholesky(true.hessian).positive
        factor = cholesky(known)
        columns = inverse_of(factor)
        covariance = jnp.stack([jnp.stack(c[:free]) for c in columns[:free]])
        return LaneResults(
            y=found.value,
            cost=true.f,
            misfit=misfit,
            covariance=jnp.where(factor.positive, covariance, jnp.nan),
            converged=converged & jnp.isfinite(true.f) & ~bad,
            tolerance=jnp.sqrt(self.solver.square_tolerance(state.info)),
            steps=state.steps,
            done=state.done | bad,
        )

    def onwards(
        self, y: Float[Array, "unknown lane"], readings: Readings
    ) -> Float[Array, "unknown lane"]:
        """Return where Newton's method leads from the ends of lanes."""
        measured, errors, bad = readings
        sigma = self._sigma(errors)
        good = ~bad & jnp.isfinite(y).all(axis=0)

        def cost(y):
            miss = self.rows.miss(y, measured, sigma)
            value, slope, _ = self.solver.loss(miss.residual)
            gradient = [jnp.sum(column * slope, axis=0) for column in miss.columns]
            return jnp.sum(value, axis=0), jnp.stack(gradient)

        first = jnp.where(good, y, 0.0)
        floor = self._floor(measured, sigma)
        f = cost(first)[0]
        slack = floor * (jnp.sqrt(2 * jnp.abs(f)) + floor)
        return jnp.where(good, newton(cost, first, slack), y)

    def _floor(self, measured, sigma) -> Float[Array, " lane"]:
        """Return what rounding adds to the length of the vector of residuals."""
        # a reading minus a prediction is as wrong as the reading's last digit
        scale = jnp.where(sigma > 0, sigma, 1.0)  # 0: the law's scatter is all there is
        eps = jnp.finfo(measured.dtype).eps
        return eps * jnp.sqrt(jnp.sum(jnp.square(measured / scale), axis=0))

    def _sigma(self, errors: Array | None) -> Array | np.ndarray:
        """Return the instrument errors, constants where all logs have the same."""
        sigma = self.sigma if errors is None else errors
        assert sigma is not None
        return sigma

    def _begin(
        self, measured: Float[Array, "row lane"]
    ) -> Float[Array, "unknown lane"]:
        """Return where lanes start in closed form."""
        assert self.form is not None
        z = self.form.start(self.rows, measured)
        return with_effects(self.rows, z)

    def _end(
        self, y, info: Expansion, measured, sigma, floor
    ) -> tuple[Expansion, Float[Array, " lane"], Triangle]:
        """Return the true cost about an end, the misfit, and what the data tell."""
        rows, loss = self.rows, self.rows.loss
        if self.solver.loss is half_square:
            # what the solver knows of the end is all there is to know
            return info, info.f, info.hessian
        miss = rows.miss(y, measured, sigma)
        true = expansion(loss.true, y, *miss, floor)
        misfit = jnp.sum(loss(miss.residual)[0][: rows.scored], axis=0)
        known = rows.miss(y, measured, sigma, sd_known=True) if rows.varies else miss
        return true, misfit, triangle(known.columns, loss.information(known.residual))
