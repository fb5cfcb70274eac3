r"""A mixture of normals: where a posterior is known to lie before anybody has walked.

A walker may leave for a place drawn from it, wherever it stands. That step leads from
mode to mode as soon as the search has found both, and where the posterior is nearly
normal it is nearly an independent draw.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


class Mixture(eqx.Module):
    r"""A mixture of normals $q(w) = \sum_k s_k N(w; c_k, A_k A_k^T)$.

    Attributes:
        center: Means $c_k$.
        root: One standard deviation along each axis $A_k$, a column each.
        inverse: $A_k^{-1}$.
        share: How much of the mixture each is $s_k$; they add to 1.
        log_height: Each one's part of ln q at its mean, up to a constant.
    """

    center: Float[Array, "normal free"]
    root: Float[Array, "normal free free"]
    inverse: Float[Array, "normal free free"]
    share: Float[Array, " normal"]
    log_height: Float[Array, " normal"]

    def log_density(self, w: Float[Array, " free"]) -> Float[Array, ""]:
        """Return ln of the density at a place, up to a constant."""
        u = jnp.einsum("kij,kj->ki", self.inverse, w[None, :] - self.center)
        return jax.nn.logsumexp(self.log_height - 0.5 * jnp.sum(u**2, axis=1))


def mixture_of(
    center: Float[np.ndarray, "normal free"],
    root: Float[np.ndarray, "normal free free"],
    share: Float[np.ndarray, " normal"],
) -> Mixture:
    """Mix normals; shares count beside each other."""
    share = share / share.sum()
    log_height = np.log(share) - np.linalg.slogdet(root)[1]
    # inverted once: LAPACK in every step costs more than a step
    arrays = center, root, np.linalg.inv(root), share, log_height
    return Mixture(*map(jnp.asarray, arrays))


@jax.jit
def independence_move(
    mixture: Mixture,
    w: Float[Array, "walker free"],
    rank: Float[Array, " walker"],
    unit: Float[Array, "walker free"],
) -> tuple[Float[Array, "walker free"], Float[Array, " walker"]]:
    r"""Propose a place for each walker that owes nothing to where it stands.

    Args:
        mixture: Drawn from.
        w: Where the walkers stand.
        rank: Uniform between 0 and 1: selects the normal of the mixture.
        unit: Standard normals, transformed by it.

    Returns:
        The places $w'$, and $\ln q(w) - \ln q(w')$, which the ratio of the densities is
        to be multiplied by (Hastings 1970, Biometrika 57:97).
    """
    of = jnp.searchsorted(jnp.cumsum(mixture.share)[:-1], rank)
    there = mixture.center[of] + jnp.einsum("nij,nj->ni", mixture.root[of], unit)
    log_density = jax.vmap(mixture.log_density)
    return there, log_density(w) - log_density(there)
