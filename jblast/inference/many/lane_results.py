"""Where lanes end, what such an end is worth, and which of two is the better."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jblast.inference.many.residuals.rows import Rows
from jblast.sensors.observe import Noise

COST = {"gaussian": (0.5, 0.70711), "student": (0.70093, 0.98290)}
"""Mean and standard deviation of the cost of one reading: for Student-t of nu degrees
of freedom, with a = (nu + 1)/2, a (psi(a) - psi(nu/2)) and a sqrt(psi'(nu/2) -
psi'(a)), since 1/(1 + t^2/nu) is a beta variable."""
HARDLY = 6.0
"""A cost that is this many standard deviations above its mean makes an end doubtful."""


class Ends(NamedTuple):
    """Where lanes ended; see `ManyFits`. The lane is the last axis.

    Attributes:
        done: Whether a lane has ended at all, and was not left on its way.
    """

    y: Float[Array, "unknown lane"]
    cost: Float[Array, " lane"]
    misfit: Float[Array, " lane"]
    covariance: Float[Array, "free free lane"]
    converged: Bool[Array, " lane"]
    tolerance: Float[Array, " lane"]
    steps: Int[Array, " lane"]
    done: Bool[Array, " lane"]


def doubtful(
    noise: Noise, rows: int, ends: Ends, bad: Bool[Array, " lane"]
) -> Bool[Array, " lane"]:
    """Return which ends may not be the best there are."""
    mean, sd = COST[noise]
    likely = ends.misfit <= rows * mean + HARDLY * sd * np.sqrt(rows)
    return ~(bad | (ends.converged & likely))


@jax.jit
def better(a: Ends, b: Ends) -> Ends:
    """Take the lower end of each lane; of two as low, the one that converged."""
    lower = ~(a.cost <= b.cost) & jnp.isfinite(b.cost)
    # a quarter of a tolerance is the most that rounding adds to the residuals' length
    rounding = 0.25 * jnp.maximum(a.tolerance, b.tolerance)
    slack = rounding * (jnp.sqrt(2 * jnp.abs(a.cost)) + rounding)
    level = (jnp.abs(a.cost - b.cost) <= slack) & (a.converged != b.converged)
    taken = jnp.where(level, b.converged, lower)
    return jax.tree.map(lambda x, y: jnp.where(taken, y, x), a, b)


def told(rows: Rows, ends: Ends, bad: Bool[Array, " lane"]):
    """Return z, covariance, numbers by name, cost and misfit, NaN for bad logs."""
    parameters = rows.parameters
    z = ends.y[: len(parameters.names)]
    z = jnp.where(bad[None, :], jnp.nan, z)
    beliefs = zip(parameters.names, parameters.beliefs, strict=True)
    numbers = {name: b.constrain(z[k]) for k, (name, b) in enumerate(beliefs)}
    covariance = jnp.where(bad[None, None, :], jnp.nan, ends.covariance)
    costs = (jnp.where(bad, jnp.nan, c) for c in (ends.cost, ends.misfit))
    return z.T, jnp.moveaxis(covariance, 2, 0), numbers, *costs
