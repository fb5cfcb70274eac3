"""The optimum of one pulse: its searches, and the starts of these.

The first search begins at the best of some rises and arrivals about the front, since
one that begins half a period of a ringing off, or at a tenth of the rise, ends next to
the optimum. Further searches follow where the first may have missed the optimum. A
sharp front may stop a search next to its optimum: the next begins there. A drift may
replace a suction: the next begins at a shorter pulse. One search holds the duration
away from its optimum, to measure what that costs.

Coloured noise has steps of its own, and the front of a faint pulse may be found at one.
So many arrivals and rises are tried, and a search begins at the best of them if that is
better. Their shares of the posterior measure how far off the arrival may be, which the
curvature at one optimum does not.

In each trial arrival, rise, durations and decay are fixed. The record is then linear in
peak, suction and drift, six numbers whose optimum and covariance are one small system
of equations (variable projection; Golub and Pereyra 1973). Hundreds of trials cost as
much as one search, and none is rejected for a wrong peak. Trials are in single
precision, at half the time: they differ by much more than rounding. Searches and their
results are in the precision of the record.
"""

from functools import partial
from typing import NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.scipy.linalg import cho_solve
from jaxtyping import Array, Bool, Float, Int

from jblast.signals.picks.model import (
    Optimum,
    low_passed,
    misfit,
    misfit_ratio,
    optimum_of,
)
from jblast.signals.picks.preparation import Bins, Case, Prepared, whitened_means
from jblast.signals.picks.pulse_means import mean_columns
from jblast.signals.picks.unknowns import (
    CENTRE,
    PULSE_UNKNOWNS,
    SPREAD,
    free_rise,
    natural_of,
    pulse_by,
)

WIDEST = 4.0
"""The error of the duration is widened to at most so many times that by Gauss and
Newton."""
LEAST_SHARE = 1e-3
"""Another optimum of less of the posterior is left out."""
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
DURATION_STEP_SD = 2.0
"""Shift of the duration by which its standard error is tested [sd]."""
DURATION_SD_TESTED = 0.05
"""Standard error of ln duration from which on it is tested."""
HOLD = 1e4
"""Weight of its prior there, over the usual one."""
FIRST, SHORT, AGAIN, ELSEWHERE, HELD = range(5)
"""The searches, in their order."""
ARRIVAL_STEP = 1.5
"""Distance of two arrivals that are tried [samples]."""
ARRIVALS = np.arange(-24.0, 64.0, ARRIVAL_STEP)
"""From where the front was seen [samples]."""
ARRIVAL_RISES = np.array([0.5, 1.5, 4.0, 10.0, 25.0])
"""Tried with each [samples]."""
ROOM = 2.0
"""A positive phase lasts as many rises."""
START_RISES = np.array([0.5, 1.5, 3.0, 5.0, 8.0, 13.0])
"""Tried [samples], beside the one of the start."""
SHIFTS = np.array([-1.5, -0.7, 0.0, 0.7, 1.5])
"""Places of the middle of the rise, from where the front was seen [samples]."""
TURNS = np.array([0.0, 0.4, 0.8, 1.2, 1.6, 2.0, 2.4])
"""Delays of the front by a ring [radians of the ring]."""
HIDDEN = np.exp(np.linspace(np.log(0.7), np.log(2.4), 20))
"""Frequencies of rings that a slow front may hide [rad/sample]: it excites a sensor
little, and its rise is bent all the same."""
FASTER = 40.0
r"""A sensor at rest answers a slow rise with one whose mean square about its middle,
$\tau^2/20$, is less by $2/\omega^2$: so $\tau^2$ passes for less by this over
$\omega^2$."""
SLOWER = 1.8
"""Rises tried about the end of a search, over the one there, are larger than this."""
OMEGA = CENTRE.size
"""Place of ln omega among the unknowns."""
LEAST_PEAK = 0.02
"""Least peak of a trial pulse [share of the largest sample]."""
DRIFTS = CENTRE.size - PULSE_UNKNOWNS
"""Unknowns of the drift: level, slope, bend, twist."""
Numbers = TypeVar("Numbers")


class Others(NamedTuple):
    """Other optima with a share of the posterior.

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
    dearer = jnp.maximum(2.0 * dearer, (DURATION_STEP_SD / WIDEST) ** 2)
    return jnp.where(
        held.converged, (DURATION_STEP_SD**2 / dearer - 1.0) / DURATION_STEP_SD**2, 0.0
    )


class Elsewhere(NamedTuple):
    """Share of other arrivals in the posterior.

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


def _far(seen: Elsewhere, end, best: Optimum, first):
    """Return a pulse of another arrival, and its share: what errors lack by it."""
    moved = best.y[0] - end
    square = seen.square - moved * (2.0 * seen.mean - moved)
    known = best.covariance[0, 0] + first[1] * jnp.square(first[0][0] - best.y[0])
    off = jnp.square(seen.far[0] - best.y[0])
    asked = (seen.square > 0) & (off > 0)
    part = jnp.clip((square - known) / jnp.where(asked, off, 1.0), 0.0, 1.0)
    return seen.far, jnp.where(asked, part, 0.0)


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
    """Results of earlier searches, for the next one.

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
    """Result of a search.

    Attributes:
        found: The optimum; zeros, not converged, where none was needed.
        cost: Minus its ln posterior; infinite where none was needed, or it is the
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
    """Search if needed; return the results so far, and of this search."""
    of = partial(misfit, bins)
    best, none = before.best, _nothing(start)
    held, far = kind == HELD, kind == ELSEWHERE
    there = _elsewhere(bins, case, best, far)
    sd = jnp.sqrt(best.covariance[DURATION, DURATION])
    longer = best.y + DURATION_STEP_SD / sd * best.covariance[:, DURATION]
    asked = jnp.where(kind == AGAIN, before.poor, ~before.sure)
    asked = jnp.where(held, sd > DURATION_SD_TESTED, jnp.where(far, there.asked, asked))
    moved = case.centre.at[DURATION].set(longer[DURATION])
    mine = case._replace(
        centre=jnp.where(held, moved, case.centre), hold=jnp.where(held, HOLD, 0.0)
    )

    def anew():
        here = jnp.where(kind == AGAIN, before.first, start)
        begin = lax.cond(
            held | far,
            lambda: jnp.where(held, longer, there.start),
            lambda: _best(bins, _about(here, jnp.asarray(SHIFTS, here.dtype)), case),
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
    """Another start of a search."""

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

    made = lax.map(with_rise, jnp.asarray(ARRIVAL_RISES, kind))
    made = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), made)
    here = jax.tree.map(lambda x: x[0], profiled(bins, y[None, :], case))
    steps = np.gradient(np.log(ARRIVAL_RISES))
    cell = jnp.repeat(jnp.asarray(ARRIVAL_STEP * steps, kind), arrivals.size)
    levels = (here.cost - made.cost) / widened + made.width - here.width
    levels = jnp.where(jnp.isfinite(levels), levels, -jnp.inf)
    top = jnp.maximum(jnp.max(levels), 0.0)
    weight = cell * jnp.exp(levels - top)
    # between those that are tried the optimum itself may be narrow
    own = 2.0 * np.pi * widened
    spread = covariance[0, 0] * covariance[4, 4] - jnp.square(covariance[0, 4])
    own = own * jnp.sqrt(jnp.maximum(spread, 0.0))
    own = jnp.minimum(own, ARRIVAL_STEP * float(np.max(steps))) * jnp.exp(-top)
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


def best_ring(
    bins: Bins, start: Float[Array, " unknown"], case: Case
) -> Float[Array, " unknown"]:
    """Return where to begin with a pulse through a sensor that rings.

    Args:
        bins: Where the record is looked at.
        start: A pulse; frequency and damping by what one pulse left over.
        case: The record.
    """
    late = jnp.asarray(TURNS, start.dtype) * jnp.exp(-start[OMEGA])
    trials = jnp.concatenate([_about(start, -late), _hidden(start)])
    return _best(bins, trials, case)


class Closer(NamedTuple):
    """A pulse that rises more slowly, about the end of a search.

    Attributes:
        start: Its unknowns.
        gain: By how much its ln posterior is higher than there.
    """

    start: Float[Array, " unknown"]
    gain: Float[Array, ""]


def closer(bins: Bins, y: Float[Array, " unknown"], case: Case) -> Closer:
    """Return the best pulse that rises more slowly, about the end of a search.

    A sharp front has its least cost at the edge of a sample, far from that of a slower
    one: a search may end there.

    Args:
        bins: Where the record is looked at.
        y: The end of a search.
        case: The record.
    """
    made = profiled(bins, _about(y, jnp.asarray(SHIFTS, y.dtype)), case)
    # the first of them is the end itself
    slower = made.y[:, 4] > y[4] + np.log(SLOWER)
    best = jnp.argmin(jnp.where(slower, made.cost, jnp.inf))
    return Closer(made.y[best], made.cost[0] - made.cost[best])


class Hidden(NamedTuple):
    """The ring that would explain most of what one pulse leaves over.

    Attributes:
        gain: How much ln posterior it gains, as far as that is square.
        start: Unknowns to begin a search with.
    """

    gain: Float[Array, ""]
    start: Float[Array, " unknown"]


def hidden_ring(
    bins: Bins, one: Optimum, start: Float[Array, " unknown"], case: Case
) -> Hidden:
    r"""Return the ring that a slow front may hide.

    What a ring adds to the pulse is looked at across all that the pulse's own unknowns
    do: with the misfit $r$, its slopes $J$ and the change $\Delta$ by a trial, the gain
    is $-r^T P \Delta - |P \Delta|^2/2$, where $P = 1 - J (J^T J)^{-1} J^T$.

    Args:
        bins: Where the record is looked at.
        one: Optimum of one pulse.
        start: That, with the further unknowns.
        case: The record, with a ring.
    """
    plain = CENTRE.size
    alone = case._replace(centre=case.centre[:plain], rings=jnp.zeros_like(case.rings))
    still = lax.stop_gradient((alone, case, one.y, one.covariance, start))
    alone, case, y, covariance, start = still

    def twice(y):
        apart = misfit(bins, y, alone)
        return apart, apart

    slopes, apart = jax.jacfwd(twice, has_aux=True)(y)
    trials = _hidden(start)
    coarse = in_single(case)

    def gain(trial):
        with_ring = misfit(bins, in_single(trial), coarse)[: apart.size]
        across = with_ring.astype(apart.dtype) - apart
        across = across - slopes @ (covariance @ (slopes.T @ across))
        return -(apart @ across) - 0.5 * across @ across

    gains = jax.vmap(gain)(trials)
    gains = jnp.where(jnp.isfinite(gains), gains, -jnp.inf)
    best = jnp.argmax(gains)
    return Hidden(gains[best], trials[best])


def _hidden(start):
    """Return trials of rings that a front may hide: of slower rises."""
    kind = start.dtype
    longest = 0.5 * jnp.exp(start[2])
    rise = jnp.exp(start[4]) / (1.0 + jnp.exp(start[4] - start[2]))
    slower = jnp.sqrt(rise * rise + (FASTER / HIDDEN**2).astype(kind))
    slower = jnp.minimum(slower, longest)
    trials = jnp.tile(start, (HIDDEN.size, 1))
    trials = trials.at[:, 0].add(0.5 * (rise - slower))
    free = slower / (1.0 - slower * jnp.exp(-start[2]))
    trials = trials.at[:, 4].set(jnp.log(free))
    return trials.at[:, OMEGA].set(np.log(HIDDEN).astype(kind))


def _about(start, shifts):
    """Return a start, and those of other rises and places about it."""
    # the bank has the arrival of its own rise
    middle = start[0] + 0.5 * jnp.exp(start[4])
    longest = 0.5 * jnp.exp(start[2])
    rises = jnp.minimum(jnp.asarray(START_RISES, start.dtype), longest)
    rises = jnp.concatenate([rises, jnp.exp(start[4:5])])
    rise, shift = (x.ravel() for x in jnp.meshgrid(rises, shifts))
    trials = jnp.tile(start, (rise.size, 1))
    trials = trials.at[:, 0].set(middle + shift - 0.5 * rise)
    trials = trials.at[:, 4].set(jnp.log(rise))
    return jnp.concatenate([start[None, :], trials])


def _best(bins: Bins, trials, case: Case):
    """Return what of the trials fits best."""
    trials = lax.stop_gradient(trials)
    still = in_single(lax.stop_gradient(case))

    def cost(y):
        return jnp.sum(jnp.square(misfit(bins, y, still)))

    costs = jax.vmap(cost)(in_single(trials))
    costs = jnp.where(jnp.isfinite(costs), costs, jnp.inf)
    return trials[jnp.argmin(costs)]


class Profiled(NamedTuple):
    """Pulses with their best peak, suction and drift.

    Attributes:
        y: The unknowns.
        cost: Minus ln posterior.
        width: ln of the volume that the linear ones have about their best.
    """

    y: Float[Array, "trial unknown"]
    cost: Float[Array, " trial"]
    width: Float[Array, " trial"]


def profiled(bins: Bins, trials: Float[Array, "trial unknown"], case: Case) -> Profiled:
    """Return pulses with peak, suction and drift at their best.

    Clipped bins are left out: the search accounts for their bounds.

    Args:
        bins: Where the record is looked at.
        trials: Unknowns; their peak, suction and drift are a first guess.
        case: The record.
    """
    kind = trials.dtype
    trials = lax.stop_gradient(trials)
    x = (jnp.asarray(bins.middle, kind) - case.middle) / case.span
    drift = _whitened(bins, case, jnp.stack([x**k for k in range(DRIFTS)]))
    fixed = jnp.concatenate([drift, case.white[None, :]])
    rows = jax.vmap(partial(_pulse_rows, bins, in_single(case)))(in_single(trials))
    # rounded as they are, what follows is exact for them
    rows = rows.astype(kind)
    own, across = rows @ jnp.swapaxes(rows, 1, 2), rows @ fixed.T
    among = fixed @ fixed.T
    spread = jnp.asarray(SPREAD, kind)
    wide = jnp.diag(jnp.square(1.0 / spread[PULSE_UNKNOWNS:]))

    def one(y, own, across):
        # the suction is believed to be a share of the peak, whatever that is
        sure = 1.0 / (spread[5] * jnp.maximum(jnp.exp(y[1]), LEAST_PEAK))
        share = jnp.stack([-case.centre[5] * sure, sure])
        mixed = across[:, :DRIFTS]
        information = jnp.block(
            [
                [own + share[:, None] * share[None, :], mixed],
                [mixed.T, among[:DRIFTS, :DRIFTS] + wide],
            ]
        )
        slope = jnp.concatenate([across[:, DRIFTS], among[:DRIFTS, DRIFTS]])
        root = jnp.linalg.cholesky(information, symmetrize_input=False)
        best = cho_solve((root, True), slope)
        peak = jnp.maximum(best[0], LEAST_PEAK)
        best = best.at[0].set(peak)
        square = among[DRIFTS, DRIFTS] + best @ (information @ best - 2.0 * slope)
        other = ((y - case.centre[: y.size]) / spread)[jnp.asarray([3, 4, 6])]
        cost = 0.5 * (square + other @ other)
        found = y.at[1].set(jnp.log(peak)).at[5].set(best[1] / peak)
        found = found.at[PULSE_UNKNOWNS:].set(best[2:])
        width = -jnp.sum(jnp.log(jnp.diagonal(root)))
        good = jnp.isfinite(cost)
        return Profiled(found, jnp.where(good, cost, jnp.inf), width)

    return lax.stop_gradient(jax.vmap(one)(trials, own, across))


def _pulse_rows(bins: Bins, case: Case, y: Float[Array, " unknown"]):
    """Return what a peak and a suction of 1 put into the bins, whitened."""
    rows = mean_columns(bins, pulse_by(natural_of(y)))
    if case.high_pass is not None:
        passed = jax.vmap(partial(low_passed, bins), in_axes=(0, None))
        rows = rows - passed(rows, case.high_pass)
    return _whitened(bins, case, rows)


def _whitened(bins: Bins, case: Case, rows: Float[Array, "row bin"]):
    """Return means over bins, whitened and weighed."""
    white = jax.vmap(partial(whitened_means, case.noise, bins))(rows)
    return case.weight[None, :] * white


def in_single(numbers: Numbers) -> Numbers:
    """Return the arrays of a tree in single precision; what is no number as it is.

    Args:
        numbers: The tree.
    """

    def single(x):
        return x.astype(jnp.float32) if jnp.issubdtype(x.dtype, jnp.floating) else x

    return jax.tree.map(single, numbers)
