"""The optimum of one pulse, another that a record may have, and how wide it is."""

from functools import partial

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from jblast.inference.picks.fit.model import misfit, misfit_ratio
from jblast.inference.picks.fit.optimum import Optimum, optimum_of
from jblast.inference.picks.fit.trials import best_pulse
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


def first_optimum(
    bins: Bins, ready: Prepared
) -> tuple[Optimum, Float[Array, " unknown"], Float[Array, ""]]:
    """Return the optimum of one pulse, another, and what that has of the posterior.

    The other is looked for where the first is not sure, or does not fit. Where many
    durations fit, and longer ones better than the error of Gauss and Newton has it, it
    is one that is longer, and its share by how much the error is to be widened.

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

    def searched(before, begin):
        sure, poor, last, best = before
        start, kind = begin
        held = kind > 1.0
        cost, y, covariance = best
        sd = jnp.sqrt(covariance[DURATION, DURATION])
        longer = y + FAR / sd * covariance[:, DURATION]
        asked = jnp.where(held, sd > LONG, jnp.where(kind > 0, poor, ~sure))
        there = case.centre.at[DURATION].set(longer[DURATION])
        mine = case._replace(
            centre=jnp.where(held, there, case.centre), hold=jnp.where(held, HOLD, 0.0)
        )

        def anew():
            here = jnp.where(kind > 0, last, start)
            begin = lax.cond(held, lambda: longer, lambda: best_pulse(of, here, case))
            found = optimum_of(of, begin, mine)
            return found, cost_of(of(lax.stop_gradient(found.y), mine))

        found, new_cost = lax.cond(asked, anew, lambda: (none, jnp.inf + case.span))
        still = lax.stop_gradient((found.y, found.covariance))
        ratio = misfit_ratio(bins, still[0], case)
        variance = still[1][1, 1] * jnp.maximum(ratio, 1.0)
        sure = (variance < UNSURE**2) & (ratio < POOR)
        first = kind < 0
        new_cost = lax.stop_gradient(new_cost)
        after = (
            sure,
            jnp.where(first, ratio > ASTRAY, poor),
            jnp.where(first, still[0], last),
            either((new_cost < cost) & ~held, (new_cost, *still), best),
        )
        return after, (found, new_cost)

    # a sharp front may end beside its optimum: once more from where that ended; and
    # with the duration held off, to see by how much that costs
    starts = jnp.stack([ready.start, ready.shorter, ready.start, ready.start])
    kinds = jnp.asarray([-1.0, 0.0, 1.0, 2.0], case.span.dtype)
    nowhere = jnp.full_like(case.span, jnp.inf), none.y, none.covariance
    begin = jnp.asarray(False), jnp.asarray(False), ready.start, nowhere
    _, (all_of, all_costs) = lax.scan(searched, begin, (starts, kinds))
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
    wider = lax.stop_gradient(
        (more * off) > share * jnp.square(rival.y - best.y)[DURATION]
    )
    rival_y = jnp.where(wider, held.y, rival.y)
    share = jnp.where(wider, more, share)
    return best, lax.stop_gradient(rival_y), lax.stop_gradient(share)


def either(first, here, there):
    """Return one of two trees."""
    return jax.tree.map(lambda a, b: jnp.where(first, a, b), here, there)


def cost_of(apart: Float[Array, " term"]) -> Float[Array, ""]:
    """Return minus ln posterior."""
    return 0.5 * jnp.sum(apart * apart)
