r"""Coordinates that bend with the readings: in them a ridge is straight.

A place $z$ has the coordinates $w(z) = A^T J^T (y(z) - y(z_0))$: $y$ are the data in
standard deviations, $J$ their sensitivity at the optimum $z_0$, and $A A^T = (J^T
J)^{-1}$. About the optimum $z = z_0 + A w$, as by the normal approximation; where the
data bend, $z$ follows them. Draws of $w$ carried over to $z$ are those of
randomize-then-optimize (Bardsley, Solonen, Haario & Laine 2014, SIAM J. Sci. Comput.
36:A1895), of density $q(w(z)) |\det dw/dz|$.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.inference.posterior.fisher_information import (
    whitened_jacobian,
    whitened_rows,
)
from jblast.inference.posterior.posterior import Posterior
from jblast.kept_programs import kept

STEPS = 8
"""Of Newton's method; of draws up to 6 sd along a ridge 999 in 1000 arrive."""
NEWTON_TOLERANCE = 1e-4
"""Coordinates that are met to this many standard deviations are met."""


class RtoDraws(NamedTuple):
    r"""Where some coordinates are.

    Attributes:
        z: The places; of coordinates that no place was found to have, any.
        log_ratio: ln of the posterior density over $|\det dw/dz|$, -inf of those.
    """

    z: Float[Array, "place free"]
    log_ratio: Float[Array, " place"]


@kept
def rto_proposal(
    posterior: Posterior,
    center: Float[Array, " free"],
    root: Float[Array, "free free"],
    w: Float[Array, "place free"],
) -> RtoDraws:
    """Find the places that have some coordinates.

    Args:
        posterior: The posterior.
        center: Its optimum $z_0$.
        root: One standard deviation along each axis $A$, a column each.
        w: The coordinates.
    """
    here, has_prior = posterior.misfit(center), posterior.parameters.has_prior()
    slopes = whitened_jacobian(posterior, center)

    def coordinates(z):
        moved = (here.residual - posterior.misfit(z).residual)[:, None]
        data = whitened_rows(posterior, here, moved)[:, 0]
        return root.T @ (slopes.T @ jnp.concatenate([data, has_prior * (z - center)]))

    jacobian = jax.jacfwd(coordinates)

    def place(w):
        def nearer(z, _):
            return z - jnp.linalg.solve(jacobian(z), coordinates(z) - w), None

        z = jax.lax.scan(nearer, center + root @ w, length=STEPS)[0]
        missed = jnp.max(jnp.abs(coordinates(z) - w))
        ratio = posterior.log_density(z) - jnp.linalg.slogdet(jacobian(z))[1]
        met = (missed < NEWTON_TOLERANCE) & jnp.isfinite(ratio)
        return RtoDraws(jnp.where(met, z, center), jnp.where(met, ratio, -jnp.inf))

    return jax.vmap(place)(w)
