"""The optimum of one pulse, another that a record may have, and how wide it is."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
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

ASTRAY = 5.0
"""And squared misfit from which on one is looked for about it."""

FAINT = 0.04
"""Standard deviation of ln peak from which on a front is looked for wherever it may
lie."""

SHARP = 1.5
"""Samples of a front that may be a slower one's, at the edge of a sample."""

OFF = 1.3
"""Squared misfit from which on slower rises are then tried."""

WRONG = 2.0
"""And from which on one begins at the best of them, be it better or not: far from its
own optimum the right one is worse than a wrong one at its best."""

LOWER = 0.1
"""A search begins there if ln posterior is higher by as much, and counts if it ends
higher by as much."""

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

FIRST, SHORT, AGAIN, ELSEWHERE, HELD = range(5)
"""The searches, in their order."""


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
    of, case = partial(misfit, bins), ready.case
    none = Optimum(
        jnp.zeros_like(ready.start),
        jnp.eye(CENTRE.size, dtype=ready.start.dtype),
        jnp.asarray(False),
    )
    zero = jnp.zeros_like(case.span)
    nowhere = Elsewhere(none.y, zero, zero, zero, none.y)
    # what clipped bins bound is not linear
    linear = ~jnp.any(case.clipped != 0)

    def searched(before, begin):
        sure, poor, last, best = before
        start, kind = begin
        held, far = kind == HELD, kind == ELSEWHERE
        cost, y, covariance, ratio = best
        faint = linear & (covariance[1, 1] > FAINT**2)
        astray = linear & (y[4] < np.log(SHARP))
        seen = lax.cond(
            far & faint,
            lambda: elsewhere(bins, y, covariance, jnp.maximum(ratio, 1.0), case),
            lambda: nowhere,
        )
        near = lax.cond(
            far & astray & (ratio > OFF),
            lambda: closer(bins, y, case),
            lambda: Closer(none.y, zero),
        )
        gain = jnp.maximum(seen.gain, near.gain)
        farther = seen.gain > jnp.maximum(near.gain, 0.0)
        there = jnp.where(farther, seen.start, near.start)
        sd = jnp.sqrt(covariance[DURATION, DURATION])
        longer = y + FAR / sd * covariance[:, DURATION]
        asked = jnp.where(held, sd > LONG, jnp.where(kind == AGAIN, poor, ~sure))
        asked = jnp.where(far, (gain > LOWER) | (astray & (ratio > WRONG)), asked)
        moved = case.centre.at[DURATION].set(longer[DURATION])
        mine = case._replace(
            centre=jnp.where(held, moved, case.centre), hold=jnp.where(held, HOLD, 0.0)
        )

        def anew():
            here = jnp.where(kind == AGAIN, last, start)
            begin = lax.cond(
                held | far,
                lambda: jnp.where(held, longer, there),
                lambda: best_pulse(of, here, case),
            )
            found = optimum_of(of, begin, mine)
            return found, cost_of(of(lax.stop_gradient(found.y), mine))

        found, new_cost = lax.cond(asked, anew, lambda: (none, jnp.inf + zero))
        still = lax.stop_gradient((found.y, found.covariance))
        ratio = misfit_ratio(bins, still[0], case)
        variance = still[1][1, 1] * jnp.maximum(ratio, 1.0)
        sure = (variance < UNSURE**2) & (ratio < POOR)
        first = kind == FIRST
        new_cost = lax.stop_gradient(new_cost)
        # what is no better is the same optimum again, which would hide another
        better = found.converged & (new_cost < cost - LOWER)
        new_cost = jnp.where(far & ~better, jnp.inf, new_cost)
        after = (
            sure,
            jnp.where(first, ratio > ASTRAY, poor),
            jnp.where(first, still[0], last),
            either((new_cost < cost) & ~held, (new_cost, *still, ratio), best),
        )
        return after, (found, new_cost, seen, y[0])

    # a sharp front may end beside its optimum: once more from where that ended; a faint
    # one in a step of noise; and with the duration held off, to see what that costs
    kinds = jnp.asarray([FIRST, SHORT, AGAIN, ELSEWHERE, HELD])
    starts = jnp.tile(ready.start, (kinds.size, 1)).at[SHORT].set(ready.shorter)
    worst = jnp.inf + zero, none.y, none.covariance, zero
    begin = jnp.asarray(False), jnp.asarray(False), ready.start, worst
    _, (all_of, all_costs, seen, ends) = lax.scan(searched, begin, (starts, kinds))
    both, held = (
        jax.tree.map(lambda x, k=k: x[k], all_of) for k in (slice(HELD), HELD)
    )
    costs = lax.stop_gradient(all_costs[:HELD])
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
    dearer = jnp.maximum(2.0 * (all_costs[HELD] - costs[row]), (FAR / WIDEST) ** 2)
    more = jnp.where(held.converged, (FAR**2 / dearer - 1.0) / FAR**2, 0.0)
    off = jnp.square(held.y[DURATION] - best.y[DURATION])
    wider = (more * off) > share * jnp.square(rival.y - best.y)[DURATION]
    first = jnp.where(wider, held.y, rival.y), jnp.where(wider, more, share)
    seen = jax.tree.map(lambda x: x[ELSEWHERE], seen)
    far, part = _far(seen, ends[ELSEWHERE], best, first)
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
