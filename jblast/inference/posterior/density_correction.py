r"""What one log-density has over another, from the places where both are known.

A polyharmonic spline (Duchon 1977, Lect. Notes Math. 571:85) through the differences
$d_i$ at nodes $w_i$, $s(w) = \sum_i \lambda_i |w - w_i|^3 + q(w)$ with a quadratic $q$
and weights that no quadratic is along, $\sum_i \lambda_i q(w_i) = 0$. How far it would
miss a node that was left out is known without leaving it out, $\lambda_i / B_{ii}$ with
$B$ the inverse of the spline's equations (Rippa 1999, Adv. Comput. Math. 11:193).
Beyond the nodes it stays as it is at their edge.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

TINY = 1e-30
"""Keeps the slope of a root at zero a number."""
ROUNDING = 1e-12
"""Of the spline's equations: what is smaller is of directions that no node lies in."""


class DensityCorrection(eqx.Module):
    """What is added to a log-density.

    Attributes:
        center: Where the spline's coordinates begin.
        inverse: Takes distances from there into these: standard deviations.
        nodes: Where the difference is known.
        weights: Of each node; 0 where there is none.
        tail: Coefficients of the quadratic.
        reach: How far from the center nodes lie.
    """

    center: Float[Array, " free"]
    inverse: Float[Array, "free free"]
    nodes: Float[Array, "node free"]
    weights: Float[Array, " node"]
    tail: Float[Array, " term"]
    reach: Float[Array, ""]

    def __call__(self, z: Float[Array, " free"]) -> Float[Array, ""]:
        """Return what is added at a place."""
        w = self.inverse @ (z - self.center)
        w = w * jnp.minimum(1.0, self.reach / jnp.sqrt(w @ w + TINY))
        away = jnp.sum(jnp.square(self.nodes - w[None, :]), axis=1)
        cubes = away * jnp.sqrt(away + TINY)
        return self.weights @ cubes + self.tail @ _quadratic(w)


def no_correction(free: int, nodes: int) -> DensityCorrection:
    """Return a correction that adds nothing, of the shape of one that does.

    Args:
        free: Coordinates.
        nodes: Room for so many.
    """
    terms = (free + 1) * (free + 2) // 2
    return DensityCorrection(
        jnp.zeros(free),
        jnp.eye(free),
        jnp.zeros((nodes, free)),
        jnp.zeros(nodes),
        jnp.zeros(terms),
        jnp.asarray(1.0),
    )


def correction_by(
    blank: DensityCorrection,
    w: Float[np.ndarray, "node free"],
    apart: Float[np.ndarray, " node"],
) -> tuple[DensityCorrection, Float[np.ndarray, " node"]]:
    """Lay a spline through differences.

    Args:
        blank: Has center and coordinates, and room for all nodes.
        w: Nodes in these coordinates.
        apart: What is added there.

    Returns:
        The correction, and by how much it would miss each node if that were left out.
    """
    count, free = w.shape
    room = blank.nodes.shape[0]
    away = np.linalg.norm(w[:, None, :] - w[None, :, :], axis=2) ** 3
    terms = np.asarray(_quadratic(jnp.asarray(w.T))).T
    none = np.zeros((terms.shape[1], terms.shape[1]))
    equations = np.block([[away, terms], [terms.T, none]])
    inverse = np.linalg.pinv(equations, rcond=ROUNDING, hermitian=True)
    found = inverse @ np.concatenate([apart, np.zeros(len(none))])
    missed = found[:count] / np.diag(inverse)[:count]
    nodes, weights = np.zeros((room, free)), np.zeros(room)
    nodes[:count], weights[:count] = w, found[:count]
    made = DensityCorrection(
        blank.center,
        blank.inverse,
        jnp.asarray(nodes),
        jnp.asarray(weights),
        jnp.asarray(found[count:]),
        jnp.asarray(np.linalg.norm(w, axis=1).max()),
    )
    return made, missed


def _quadratic(w: Float[Array, "free ..."]) -> Float[Array, "term ..."]:
    """Return the terms of a quadratic."""
    first, second = np.triu_indices(w.shape[0])
    return jnp.concatenate([jnp.ones_like(w[:1]), w, w[first] * w[second]])
