"""Least squares by optimistix as it comes: many logs, many starts, one compiled call.

Nobody looks at an end here but the solver itself; that is what is to be measured.
"""

import functools
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float

from jblast.inference import Posterior

SOLVERS = {
    "Gauss-Newton": optx.GaussNewton,
    "BFGS": optx.BFGS,
    "Levenberg-Marquardt": optx.LevenbergMarquardt,
}
MORE = {"Dogleg": optx.Dogleg}
"""Others, which the map of stability leaves out."""
MOST_STEPS = 256
"""The default of optimistix."""
TOLERANCE = {"float64": 1e-8, "float32": 1e-4}
"""About the square root of what each can resolve, relative and absolute."""


class StockFits(NamedTuple):
    """Where stock solvers ended.

    Attributes:
        z: Fitted coordinates.
        successful: Whether the solver reports success.
    """

    z: Float[np.ndarray, "fit free"]
    successful: Bool[np.ndarray, " fit"]


def stock_fits(
    name: str,
    posterior: Posterior,
    measured: Float[np.ndarray, "fit row"],
    starts: Float[np.ndarray, "fit free"],
    precision: str = "float64",
) -> StockFits:
    """Fit logs of one layout, each from a start of its own, with normal errors.

    Args:
        name: A key of `SOLVERS` or `MORE`.
        posterior: The layout and its laws; no effects shared, no priors.
        measured: Readings of each log, as `Posterior.measured` has them.
        starts: Fitted coordinates.
        precision: "float64" or "float32", of everything.
    """
    with jax.enable_x64(precision == "float64"):

        def cast(tree):
            return jax.tree.map(lambda x: jnp.asarray(x, precision), tree)

        each = _each(name, TOLERANCE[precision])
        z, successful = each(cast(starts), (cast(posterior), cast(measured)))
        return StockFits(np.asarray(z, float), np.asarray(successful))


@functools.cache
def _each(name: str, tolerance: float):
    """Return what fits many logs; compiled once for each layout."""
    solver = {**SOLVERS, **MORE}[name](tolerance, tolerance)

    def fit(start, args):
        asked = {"args": args, "max_steps": MOST_STEPS, "throw": False}
        if isinstance(solver, optx.AbstractLeastSquaresSolver):
            found = optx.least_squares(residuals, solver, start, **asked)
        else:
            found = optx.minimise(_half_square, solver, start, **asked)
        return found.value, found.result == optx.RESULTS.successful

    return jax.jit(jax.vmap(fit, in_axes=(0, (None, 0))))


def residuals(
    z: Float[Array, " free"], args: tuple[Posterior, Float[Array, " row"]]
) -> Float[Array, " row"]:
    """Return how readings miss the laws at a place, in standard deviations."""
    posterior, measured = args
    misfit = eqx.tree_at(lambda p: p.measured, posterior, measured).misfit(z)
    return misfit.residual / misfit.sd


def _half_square(z, args):
    return 0.5 * jnp.sum(jnp.square(residuals(z, args)))


@jax.jit
def costs(
    posterior: Posterior,
    measured: Float[Array, "fit row"],
    z: Float[Array, "fit free"],
) -> Float[Array, " fit"]:
    """Return minus ln of the likelihood of each log at a place, up to a constant."""
    return jax.vmap(lambda m, z: _half_square(z, (posterior, m)))(measured, z)
