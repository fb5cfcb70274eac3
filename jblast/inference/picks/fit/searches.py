"""The searches for one pulse, one after another: where each begins, and whether.

A sharp front may end beside its optimum: one begins from where that ended. A drift may
pass for a suction: one begins at a shorter pulse. A faint front may lie in a step of
noise, or a slow one pass for a sharp one: one begins elsewhere. And one holds the
duration off, to see what that costs.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from jblast.inference.picks.fit.elsewhere import Elsewhere, elsewhere
from jblast.inference.picks.fit.model import misfit, misfit_ratio
from jblast.inference.picks.fit.optimum import Optimum, optimum_of
from jblast.inference.picks.fit.trials import Closer, best_pulse, closer
from jblast.inference.picks.ready.bins import Bins
from jblast.inference.picks.ready.case import Case, Prepared
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

WRONG = 1.2
"""Squared misfit from which on one begins at the best of slower ones, be it better or
not: far from its own optimum the right one is worse than a wrong one at its best."""

LOWER = 0.1
"""A search begins there if ln posterior is higher by as much, and counts if it ends
higher by as much."""

FAR = 2.0
"""Standard deviations that the duration is moved by, to see whether they are true."""

LONG = 0.05
"""Of ln duration, from which on that is looked at."""

HOLD = 1e4
"""How firmly it is held there: as many times its prior."""

FIRST, SHORT, AGAIN, ELSEWHERE, HELD = range(5)
"""The searches, in their order."""


class Best(NamedTuple):
    """The best that was found so far.

    Attributes:
        cost: Minus its ln posterior.
        y: Its unknowns.
        covariance: About it.
        ratio: Its squared misfit by degree of freedom.
    """

    cost: Float[Array, ""]
    y: Float[Array, " unknown"]
    covariance: Float[Array, "unknown unknown"]
    ratio: Float[Array, ""]


class SoFar(NamedTuple):
    """What a search knows of those before it.

    Attributes:
        sure: Whether the last one's peak is known, and fits.
        poor: Whether the first one does not fit at all.
        first: Where that ended.
        best: The best of all.
    """

    sure: Bool[Array, ""]
    poor: Bool[Array, ""]
    first: Float[Array, " unknown"]
    best: Best


class Searched(NamedTuple):
    """What a search found.

    Attributes:
        found: The optimum; zeros, not converged, where none was asked for.
        cost: Minus its ln posterior; infinite where none was asked for, or it is the
            best one again.
        seen: What other arrivals have of the posterior, where that was looked at.
        end: Unknown arrival of the best of those before.
    """

    found: Optimum
    cost: Float[Array, ""]
    seen: Elsewhere
    end: Float[Array, ""]


def searches_of(bins: Bins, ready: Prepared) -> Searched:
    """Return what the searches found, each along a first axis, in their order.

    Args:
        bins: Where the record is looked at.
        ready: The record.
    """
    kinds = jnp.asarray([FIRST, SHORT, AGAIN, ELSEWHERE, HELD])
    starts = jnp.tile(ready.start, (kinds.size, 1)).at[SHORT].set(ready.shorter)
    none = _nothing(ready.start)
    zero = jnp.zeros_like(ready.case.span)
    worst = Best(jnp.inf + zero, none.y, none.covariance, zero)
    begin = SoFar(jnp.asarray(False), jnp.asarray(False), ready.start, worst)

    def search(before: SoFar, one):
        return _search(bins, ready.case, before, *one)

    _, made = lax.scan(search, begin, (starts, kinds))
    return made


def _search(
    bins: Bins,
    case: Case,
    before: SoFar,
    start: Float[Array, " unknown"],
    kind: Int[Array, ""],
) -> tuple[SoFar, Searched]:
    """Search, if asked for; return what is known then, and what was found."""
    of = partial(misfit, bins)
    best, none = before.best, _nothing(start)
    held, far = kind == HELD, kind == ELSEWHERE
    there = _elsewhere(bins, case, best, far)
    sd = jnp.sqrt(best.covariance[DURATION, DURATION])
    longer = best.y + FAR / sd * best.covariance[:, DURATION]
    asked = jnp.where(kind == AGAIN, before.poor, ~before.sure)
    asked = jnp.where(held, sd > LONG, jnp.where(far, there.asked, asked))
    moved = case.centre.at[DURATION].set(longer[DURATION])
    mine = case._replace(
        centre=jnp.where(held, moved, case.centre), hold=jnp.where(held, HOLD, 0.0)
    )

    def anew():
        here = jnp.where(kind == AGAIN, before.first, start)
        begin = lax.cond(
            held | far,
            lambda: jnp.where(held, longer, there.start),
            lambda: best_pulse(bins, here, case),
        )
        return optimum_of(of, begin, mine)

    found = lax.cond(asked, anew, lambda: none)
    still = lax.stop_gradient((found.y, found.covariance))
    ratio = misfit_ratio(bins, still[0], case)
    variance = still[1][1, 1] * jnp.maximum(ratio, 1.0)
    cost = found.cost
    # what is no better is the same optimum again, which would hide another
    better = found.converged & (cost < best.cost - LOWER)
    cost = jnp.where(far & ~better, jnp.inf, cost)
    first = kind == FIRST
    after = SoFar(
        sure=(variance < UNSURE**2) & (ratio < POOR),
        poor=jnp.where(first, ratio > ASTRAY, before.poor),
        first=jnp.where(first, still[0], before.first),
        best=either((cost < best.cost) & ~held, Best(cost, *still, ratio), best),
    )
    return after, Searched(found, cost, there.seen, best.y[0])


class _Elsewhere(NamedTuple):
    """Where else a search may begin."""

    asked: Bool[Array, ""]
    start: Float[Array, " unknown"]
    seen: Elsewhere


def _elsewhere(
    bins: Bins, case: Case, best: Best, looked: Bool[Array, ""]
) -> _Elsewhere:
    """Return the better of a faint front's other places and of slower rises."""
    y, zero = best.y, jnp.zeros_like(best.ratio)
    # what clipped bins bound is not linear
    linear = ~jnp.any(case.clipped != 0)
    faint = linear & (best.covariance[1, 1] > FAINT**2)
    astray = linear & (y[4] < np.log(SHARP))
    widened = jnp.maximum(best.ratio, 1.0)
    nowhere = jnp.zeros_like(y)
    seen = lax.cond(
        looked & faint,
        lambda: elsewhere(bins, y, best.covariance, widened, case),
        lambda: Elsewhere(nowhere, zero, zero, zero, nowhere),
    )
    near = lax.cond(
        looked & astray,
        lambda: closer(bins, y, case),
        lambda: Closer(nowhere, zero),
    )
    farther = seen.gain > jnp.maximum(near.gain, 0.0)
    better = jnp.maximum(seen.gain, near.gain) > LOWER
    return _Elsewhere(
        asked=better | (astray & (best.ratio > WRONG)),
        start=jnp.where(farther, seen.start, near.start),
        seen=seen,
    )


def _nothing(start: Float[Array, " unknown"]) -> Optimum:
    """Return what is found where nothing is looked for."""
    unit = jnp.eye(CENTRE.size, dtype=start.dtype)
    never = jnp.full((), jnp.inf, start.dtype)
    none = jnp.zeros_like(never)
    return Optimum(jnp.zeros_like(start), unit, jnp.asarray(False), never, none)


def either(first, here, there):
    """Return one of two trees."""
    return jax.tree.map(lambda a, b: jnp.where(first, a, b), here, there)


def cost_of(apart: Float[Array, " term"]) -> Float[Array, ""]:
    """Return minus ln posterior."""
    return 0.5 * jnp.sum(apart * apart)
