r"""Whether the front of a faint pulse may lie elsewhere.

Noise with a memory makes steps of its own, and a search that begins at one ends there.
So each of many arrivals and rises is tried, all that is linear at its best and the end
of the positive phase where it is (`profiled.py`). A search begins anew from the best of
them, if that is better; and what all of them have of the posterior tells how far off
the arrival may be, which no parabola about one optimum does.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float

from jblast.inference.picks.fit.profiled import profiled
from jblast.inference.picks.ready.bins import Bins
from jblast.inference.picks.ready.case import Case
from jblast.inference.picks.unknowns import free_rise

APART = 1.5
"""Of two arrivals that are tried [samples]."""

ARRIVALS = np.arange(-24.0, 64.0, APART)
"""From where the front was seen [samples]."""

RISES = np.array([0.5, 1.5, 4.0, 10.0, 25.0])
"""Tried with each [samples]."""

ROOM = 2.0
"""A positive phase lasts as many rises."""


class Elsewhere(NamedTuple):
    """What other arrivals have of the posterior.

    Attributes:
        start: Unknowns of the best of them.
        gain: By how much its ln posterior is higher than where the search ended.
        mean: Of the arrivals, from that end [samples].
        square: And of their squares.
        far: Unknowns of one that has much of it.
    """

    start: Float[Array, " unknown"]
    gain: Float[Array, ""]
    mean: Float[Array, ""]
    square: Float[Array, ""]
    far: Float[Array, " unknown"]


def elsewhere(
    bins: Bins,
    y: Float[Array, " unknown"],
    covariance: Float[Array, "unknown unknown"],
    widened: Float[Array, ""],
    case: Case,
) -> Elsewhere:
    """Return what other arrivals have of the posterior.

    Args:
        bins: Where the record is looked at.
        y: Where a search ended.
        covariance: About it.
        widened: What to multiply it by.
        case: The record.
    """
    kind = y.dtype
    end = y[0] + jnp.exp(y[2])
    arrivals = jnp.asarray(ARRIVALS, kind)

    def with_rise(rise):
        duration = jnp.maximum(end - arrivals, ROOM * rise)
        trials = jnp.tile(y, (arrivals.size, 1))
        trials = trials.at[:, 0].set(arrivals).at[:, 2].set(jnp.log(duration))
        # a suction keeps its length
        trials = trials.at[:, 6].add(y[2] - jnp.log(duration))
        trials = trials.at[:, 4].set(jnp.log(free_rise(rise, duration)))
        made = profiled(bins, trials, case)
        fits = end - arrivals >= ROOM * rise
        return made._replace(cost=jnp.where(fits, made.cost, jnp.inf))

    made = lax.map(with_rise, jnp.asarray(RISES, kind))
    made = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), made)
    here = jax.tree.map(lambda x: x[0], profiled(bins, y[None, :], case))
    steps = np.gradient(np.log(RISES))
    cell = jnp.repeat(jnp.asarray(APART * steps, kind), arrivals.size)
    levels = (here.cost - made.cost) / widened + made.width - here.width
    levels = jnp.where(jnp.isfinite(levels), levels, -jnp.inf)
    top = jnp.maximum(jnp.max(levels), 0.0)
    weight = cell * jnp.exp(levels - top)
    # between those that are tried the optimum itself may be narrow
    own = 2.0 * np.pi * widened
    spread = covariance[0, 0] * covariance[4, 4] - jnp.square(covariance[0, 4])
    own = own * jnp.sqrt(jnp.maximum(spread, 0.0))
    own = jnp.minimum(own, APART * float(np.max(steps))) * jnp.exp(-top)
    off = made.y[:, 0] - y[0]
    weight = weight / (jnp.sum(weight) + own)
    best = jnp.argmin(made.cost)
    return Elsewhere(
        made.y[best],
        here.cost - made.cost[best],
        jnp.sum(weight * off),
        jnp.sum(weight * off * off),
        made.y[jnp.argmax(weight * off * off)],
    )
