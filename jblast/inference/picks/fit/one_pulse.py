"""The optimum of one pulse, another that a record may have, and how wide it is."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from jblast.inference.picks.fit.elsewhere import Elsewhere
from jblast.inference.picks.fit.optimum import Optimum
from jblast.inference.picks.fit.searches import (
    DURATION,
    ELSEWHERE,
    FAR,
    HELD,
    searches_of,
)
from jblast.inference.picks.ready.bins import Bins
from jblast.inference.picks.ready.case import Prepared

WIDEST = 4.0
"""Times its error by Gauss and Newton, at most."""

LEAST_SHARE = 1e-3
"""Another optimum of less of the posterior is left out."""


class Others(NamedTuple):
    """What else has a share of the posterior.

    Attributes:
        y: Unknowns of each.
        share: By how much of its square off the best the errors grow.
    """

    y: Float[Array, "other unknown"]
    share: Float[Array, " other"]


def first_optimum(bins: Bins, ready: Prepared) -> tuple[Optimum, Others]:
    """Return the optimum of one pulse, and two others.

    The first of the others is looked for where the search is not sure, or does not fit.
    Where many durations fit, and longer ones better than the error of Gauss and Newton
    has it, it is one that is longer, and its share by how much the error is to be
    widened. The second is a pulse of another arrival that has much of the posterior,
    looked for where the pulse is faint.

    Args:
        bins: Where the record is looked at.
        ready: The record.
    """
    made = searches_of(bins, ready)
    both = jax.tree.map(lambda x: x[:HELD], made.found)
    costs = lax.stop_gradient(made.cost[:HELD])
    costs = jnp.where(jnp.isnan(costs), jnp.inf, costs)
    row, other = jnp.argsort(costs)[:2]
    best, rival = (jax.tree.map(lambda x, k=k: x[k], both) for k in (row, other))
    weights = 0.5 * lax.stop_gradient(both.size) - costs
    share = 1.0 / (1.0 + jnp.exp(weights[row] - weights[other]))
    share = jnp.where(jnp.isfinite(share) & rival.converged, share, 0.0)
    # of what counts little, nothing: it may be anywhere
    share = jnp.where(share > LEAST_SHARE, share, 0.0)
    held = jax.tree.map(lambda x: x[HELD], made.found)
    more = _wider(held, made.cost[HELD] - costs[row])
    off = jnp.square(held.y[DURATION] - best.y[DURATION])
    wider = (more * off) > share * jnp.square(rival.y - best.y)[DURATION]
    first = jnp.where(wider, held.y, rival.y), jnp.where(wider, more, share)
    seen = jax.tree.map(lambda x: x[ELSEWHERE], made.seen)
    far, part = _far(seen, made.end[ELSEWHERE], best, first)
    others = Others(jnp.stack([first[0], far]), jnp.stack([first[1], part]))
    return best, lax.stop_gradient(others)


def _wider(held: Optimum, dearer: Float[Array, ""]) -> Float[Array, ""]:
    """Return by how much of its square off a held duration the error is to be widened.

    Where the way to a longer pulse costs less than a parabola, the error is larger.
    """
    dearer = jnp.maximum(2.0 * dearer, (FAR / WIDEST) ** 2)
    return jnp.where(held.converged, (FAR**2 / dearer - 1.0) / FAR**2, 0.0)


def _far(seen: Elsewhere, end, best: Optimum, first):
    """Return a pulse of another arrival, and its share: what errors lack by it."""
    moved = best.y[0] - end
    square = seen.square - moved * (2.0 * seen.mean - moved)
    known = best.covariance[0, 0] + first[1] * jnp.square(first[0][0] - best.y[0])
    off = jnp.square(seen.far[0] - best.y[0])
    asked = (seen.square > 0) & (off > 0)
    part = jnp.clip((square - known) / jnp.where(asked, off, 1.0), 0.0, 1.0)
    return seen.far, jnp.where(asked, part, 0.0)
