"""The most probable scenes: every optimum of the posterior worth telling.

Three stages, all batched over starts. Least squares with the shared effects as
unknowns (Levenberg-Marquardt, normal errors) reaches the right basin from far away;
the same with the Student-t cost ignores wild readings; BFGS, in coordinates whitened by
the Fisher information, then climbs the posterior itself, in which the effects are
integrated out.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jax import lax
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from jblast.inference.fisher import NULL, information, unit_diagonal
from jblast.inference.posterior import Posterior
from jblast.inference.starts import scales, starts
from jblast.sensors.observe import STUDENT_FREEDOM

STARTS = 64
FINALISTS = 8
SAME = 0.1
"""Ends closer than this many standard deviations are one optimum."""
SEPARATE = 1.0
"""Optima further apart than this many standard deviations are two answers."""
NORMAL = 1e8
"""So many degrees of freedom make a Student-t normal."""
DECREMENT = 1e-6
"""Converged: one more Newton step would gain less than this in ln-density."""


class Optima(NamedTuple):
    """Places where searches ended, the most probable first.

    Attributes:
        z: Coordinates.
        log_density: ln of the posterior density there; -inf for a repeated end.
        converged: Whether the search arrived.
    """

    z: Float[Array, "optimum free"]
    log_density: Float[Array, " optimum"]
    converged: Bool[Array, " optimum"]


@eqx.filter_jit
def optima(key: PRNGKeyArray, posterior: Posterior) -> Optima:
    """Search a posterior from `STARTS` places and climb from the best few ends."""
    scale = scales(posterior)
    first = starts(key, posterior, STARTS) / scale
    effects = jnp.zeros((STARTS, posterior.misfit(first[0] * scale).loading.shape[1]))

    freedoms = (NORMAL, STUDENT_FREEDOM)[: 1 + (posterior.noise == "student")]

    def approach(y: Float[Array, " unknown"]) -> Float[Array, " free"]:
        def with_freedom(y, freedom):
            solution = optx.least_squares(
                lambda y, freedom: _residuals(posterior, scale, y, freedom),
                optx.LevenbergMarquardt(rtol=1e-6, atol=1e-6),
                y,
                freedom,
                max_steps=100,
                throw=False,
            )
            return solution.value, None

        return lax.scan(with_freedom, y, jnp.array(freedoms))[0][: scale.size] * scale

    ends = jax.vmap(approach)(jnp.concatenate([first, effects], axis=1))
    finalists, repeated = _distinct(posterior, ends)
    climbed = jax.vmap(lambda z: _climb(posterior, z))(finalists)
    density = jax.vmap(posterior.log_density)(climbed)
    density = jnp.where(jnp.isnan(density) | repeated, -jnp.inf, density)
    order = jnp.argsort(-density)
    arrived = jax.vmap(lambda z: _decrement(posterior, z) < DECREMENT)(climbed)
    return Optima(climbed[order], density[order], arrived[order])


def _residuals(posterior: Posterior, scale, y, freedom):
    """Residuals of least squares, whose unknowns include the shared effects.

    Half the square of each is minus the Student-t log-density of that many degrees of
    freedom.
    """
    z, effects = y[: scale.size] * scale, y[scale.size :]
    misfit = posterior.misfit(z)
    u = (misfit.residual - misfit.loading @ effects) / misfit.sd
    away = jnp.abs(u) > 1e-6
    tail = (freedom + 1) * jnp.log1p(jnp.square(jnp.where(away, u, 1.0)) / freedom)
    near = u * jnp.sqrt((freedom + 1) / freedom)
    u = jnp.where(away, jnp.sign(u) * jnp.sqrt(tail), near)
    return u, effects, z * posterior.parameters.has_prior()


def _distinct(posterior: Posterior, ends):
    """Pick the best ends that differ by more than `SAME` standard deviations."""
    density = jax.vmap(posterior.log_density)(ends)
    density = jnp.where(jnp.isnan(density), -jnp.inf, density)

    def pick(left, _):
        best = jnp.argmax(left)
        away = ends - ends[best]
        distance = jnp.einsum(
            "ni,ij,nj->n", away, information(posterior, ends[best]), away
        )
        gone = ~(distance > SAME**2)
        return jnp.where(gone, -jnp.inf, left), (ends[best], left[best] == -jnp.inf)

    _, (finalists, repeated) = lax.scan(pick, density, length=FINALISTS)
    return finalists, repeated


def _climb(posterior: Posterior, z):
    """Climb the posterior from one place, in coordinates in which it is round."""
    size, values, vectors = unit_diagonal(information(posterior, z))
    width = jnp.where(
        values > NULL, 1 / jnp.sqrt(jnp.where(values > NULL, values, 1)), 1
    )
    out = vectors * width / size[:, None]
    found = optx.minimise(
        lambda w, _: -posterior.log_density(z + out @ w),
        optx.BFGS(rtol=1e-10, atol=1e-10),
        jnp.zeros_like(z),
        max_steps=200,
        throw=False,
    )
    return z + out @ found.value


def _decrement(posterior: Posterior, z):
    """Return what one more Newton step would gain in ln-density."""
    size, values, vectors = unit_diagonal(information(posterior, z))
    slope = vectors.T @ (jax.grad(posterior.log_density)(z) / size)
    known = values > NULL
    return 0.5 * jnp.sum(jnp.where(known, slope**2 / jnp.where(known, values, 1), 0))
