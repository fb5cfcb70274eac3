"""The optimum of one pulse, another that a record may have, and how wide it is."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from jblast.inference.picks.fit.elsewhere import Elsewhere, elsewhere
from jblast.inference.picks.fit.model import misfit, misfit_ratio
from jblast.inference.picks.fit.optimum import Optimum, optimum_of
from jblast.inference.picks.fit.trials import Closer, best_pulse, closer
from jblast.inference.picks.ready.bins import Bins
from jblast.inference.picks.ready.case import Prepared
from jblast.inference.picks.unknowns import CENTRE

DURATION = 2
"""Place of ln duration among the unknowns."""

UNSURE = 0.02
"""Standard deviation of ln peak from which on another start is searched from, too."""

POOR = 1.5
"""And squared misfit by degree of freedom."""

LOWER = 0.1
"""A search begins anew where ln posterior is higher by as much."""

FAR = 2.0
"""Standard deviations that the duration is moved by, to see whether they are true."""

LONG = 0.05
"""Of ln duration, from which on that is looked at."""

HOLD = 1e4
"""How firmly it is held there: as many times its prior."""

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

    Where the first search is not sure, or does not fit, others begin at a shorter pulse
    and wherever else its front may lie. Of the optima that they end in the second best
    is the first of the others. Where many durations fit, and longer ones better than
    the error of Gauss and Newton has it, it is one that is longer instead, and its
    share by how much the error is to be widened. The second of the others is a pulse
    of an arrival that has much of the posterior.

    Args:
        bins: Where the record is looked at.
        ready: The record.
    """
    of, case = partial(misfit, bins), ready.case
    zero = jnp.zeros_like(case.span)
    nothing = jnp.zeros_like(ready.start)
    none = Optimum(
        nothing, jnp.eye(CENTRE.size, dtype=nothing.dtype), jnp.asarray(False)
    )
    nowhere = Elsewhere(nothing, zero, zero, zero, nothing)

    def searched(before, begin):
        sure, poor, best = before
        start, kind = begin
        held, about = kind > 1.0, kind == 1.0
        cost, y, covariance, ratio = best
        seen = lax.cond(
            about & ~sure,
            lambda: elsewhere(bins, y, covariance, jnp.maximum(ratio, 1.0), case),
            lambda: nowhere,
        )
        near = lax.cond(
            about & poor, lambda: closer(bins, y, case), lambda: Closer(nothing, zero)
        )
        far = seen.gain > near.gain
        gain = jnp.maximum(seen.gain, near.gain)
        better = jnp.where(far, seen.start, near.start)
        sd = jnp.sqrt(covariance[DURATION, DURATION])
        longer = y + FAR / sd * covariance[:, DURATION]
        asked = jnp.where(held, sd > LONG, jnp.where(about, gain > LOWER, ~sure | poor))
        there = case.centre.at[DURATION].set(longer[DURATION])
        mine = case._replace(
            centre=jnp.where(held, there, case.centre), hold=jnp.where(held, HOLD, 0.0)
        )

        def anew():
            begin = lax.cond(
                held | about,
                lambda: jnp.where(held, longer, better),
                lambda: best_pulse(of, bins, start, case, kind == 0.0),
            )
            found = optimum_of(of, begin, mine)
            return found, cost_of(of(lax.stop_gradient(found.y), mine))

        found, new_cost = lax.cond(asked, anew, lambda: (none, jnp.inf + zero))
        still = lax.stop_gradient((found.y, found.covariance))
        ratio = misfit_ratio(bins, still[0], case)
        variance = still[1][1, 1] * jnp.maximum(ratio, 1.0)
        new_cost = lax.stop_gradient(new_cost)
        first = kind < 0
        after = (
            jnp.where(first, variance < UNSURE**2, sure),
            jnp.where(first, ratio > POOR, poor),
            either((new_cost < cost) & ~held, (new_cost, *still, ratio), best),
        )
        return after, (found, new_cost, seen, y[0])

    # and with the duration held off, to see by how much that costs
    starts = jnp.stack([ready.start, ready.shorter, ready.start, ready.start])
    kinds = jnp.asarray([-1.0, 0.0, 1.0, 2.0], case.span.dtype)
    worst = jnp.inf + zero, none.y, none.covariance, zero
    _, (all_of, all_costs, seen, ends) = lax.scan(
        searched, (jnp.asarray(False), jnp.asarray(True), worst), (starts, kinds)
    )
    both, held = (jax.tree.map(lambda x, k=k: x[k], all_of) for k in (slice(3), 3))
    costs = lax.stop_gradient(all_costs[:3])
    costs = jnp.where(jnp.isnan(costs), jnp.inf, costs)
    row, other = jnp.argsort(costs)[:2]
    best, rival = (jax.tree.map(lambda x, k=k: x[k], both) for k in (row, other))
    sizes = jnp.linalg.slogdet(lax.stop_gradient(both.covariance))[1]
    weights = 0.5 * sizes - costs
    share = 1.0 / (1.0 + jnp.exp(weights[row] - weights[other]))
    share = jnp.where(jnp.isfinite(share) & rival.converged, share, 0.0)
    # of what counts little, nothing: it may be anywhere
    share = jnp.where(share > LEAST_SHARE, share, 0.0)
    # where the way to a longer pulse costs less than a parabola, the error is larger
    dearer = jnp.maximum(2.0 * (all_costs[3] - costs[row]), (FAR / WIDEST) ** 2)
    more = jnp.where(held.converged, (FAR**2 / dearer - 1.0) / FAR**2, 0.0)
    off = jnp.square(held.y[DURATION] - best.y[DURATION])
    wider = (more * off) > share * jnp.square(rival.y - best.y)[DURATION]
    first = jnp.where(wider, held.y, rival.y), jnp.where(wider, more, share)
    far, part = _far(jax.tree.map(lambda x: x[2], seen), ends[2], best, first)
    others = Others(jnp.stack([first[0], far]), jnp.stack([first[1], part]))
    return best, lax.stop_gradient(others)


def _far(seen: Elsewhere, end, best: Optimum, first):
    """Return a pulse of another arrival, and its share: what errors lack by it."""
    moved = best.y[0] - end
    square = seen.square - moved * (2.0 * seen.mean - moved)
    known = best.covariance[0, 0] + first[1] * jnp.square(first[0][0] - best.y[0])
    off = jnp.square(seen.far[0] - best.y[0])
    asked = (seen.square > 0) & (off > 0)
    part = jnp.clip((square - known) / jnp.where(asked, off, 1.0), 0.0, 1.0)
    return seen.far, jnp.where(asked, part, 0.0)


def either(first, here, there):
    """Return one of two trees."""
    return jax.tree.map(lambda a, b: jnp.where(first, a, b), here, there)


def cost_of(apart: Float[Array, " term"]) -> Float[Array, ""]:
    """Return minus ln posterior."""
    return 0.5 * jnp.sum(apart * apart)
