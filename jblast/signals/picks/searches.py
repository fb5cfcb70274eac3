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
much as one search, and none is rejected for a wrong peak. Trials run in single
precision in half the time: they differ by much more than rounding. Searches and their
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

LARGEST_WIDENING = 4.0
"""Largest factor by which the error of the duration is widened over that of Gauss and
Newton: one search two standard deviations off explores no flatter posterior."""
LEAST_SHARE = 1e-3
"""Smallest share of the posterior for which another optimum adds to the errors. Such a
one changes no 90 % interval, and may be at an arbitrary distance."""
DURATION = 2
"""Index of ln duration among the unknowns."""
PEAK_SD_UNSURE = 0.02
"""Standard deviation of ln peak from which on a second start, a shorter pulse, is
searched as well: in such noise a drift and a suction look alike."""
MISFIT_POOR = 1.5
"""Squared misfit per degree of freedom from which on the second start is searched as
well: five standard deviations above 1 for the noise of two hundred bins."""
MISFIT_ASTRAY = 5.0
"""Squared misfit from which on another start about the end of the first search is
tried: noise alone never has it, so the search missed the optimum or the model fails."""
PEAK_SD_FAINT = 0.04
"""Standard deviation of ln peak from which on a front is searched over `ARRIVALS`. One
in ten simulated records is that faint; without it their arrivals were up to 29 samples
early (docs/explanation/picks.md, CHANGELOG)."""
SHARP_RISE = 1.5
"""Rise below which a search may have stopped at the edge of a sample [samples]: fronts
of two or three samples have such a wrong optimum."""
MISFIT_WRONG = 1.2
"""Squared misfit from which on a search begins at the best slower rise even if that is
worse: far from its own optimum, the right rise fits worse than a wrong one at its best.
It is two standard deviations of the misfit of two hundred bins of noise."""
LEAST_GAIN = 0.1
"""Smallest gain in ln posterior for which a search begins at another point, and for
which its end counts as another optimum: smaller ones are the same optimum again."""
DURATION_STEP_SD = 2.0
"""Shift of the duration at which the curvature of its posterior is tested [sd]."""
DURATION_SD_TESTED = 0.05
"""Standard error of ln duration from which on the test is worth its search: below it
the posterior is close to normal."""
HOLD_WEIGHT = 1e4
"""Factor on the prior's residual that holds the duration at the tested value."""
FIRST, SHORT, AGAIN, ELSEWHERE, HELD = range(5)
"""The searches, in their order."""
ARRIVAL_STEP = 1.5
"""Distance of neighbouring trial arrivals [samples], shorter than the region from which
a search converges (see `START_RISES`, `SHIFTS`)."""
ARRIVALS = np.arange(-24.0, 64.0, ARRIVAL_STEP)
"""Trial arrivals relative to the detected front [samples]: 59 of them, mostly later,
because steps of the noise before a faint front may be taken for it."""
ARRIVAL_RISES = np.array([0.5, 1.5, 4.0, 10.0, 25.0])
"""Trial rises with each arrival [samples], spaced by a factor of about three."""
RISES_IN_DURATION = 2.0
"""Shortest positive phase of a trial, in rises."""
START_RISES = np.array([0.5, 1.5, 3.0, 5.0, 8.0, 13.0])
"""Trial rises [samples], in addition to that of the start."""
SHIFTS = np.array([-1.5, -0.7, 0.0, 0.7, 1.5])
"""Trial positions of the middle of the rise, relative to the detected front
[samples]."""
RING_DELAYS = np.array([0.0, 0.4, 0.8, 1.2, 1.6, 2.0, 2.4])
"""Trial delays of the front by a resonance [rad of its phase]: up to less than half a
period, after which the response to a step is at its maximum."""
HIDDEN_FREQUENCIES = np.exp(np.linspace(np.log(0.7), np.log(2.4), 20))
"""Angular frequencies of resonances that a slow front may hide [rad/sample]. The front
excites the sensor little, but the sensor still changes its rise. Lower ones ring
visibly, higher ones change the rise by less than the samples resolve."""
HIDDEN_RISE_FACTOR = 40.0
r"""Reduction of $\tau^2$ by a resonance, times $\omega^2$. The response to a slow rise
is one whose variance in time, $\tau^2/20$, is less by $2/\omega^2$."""
SLOWER_RISE_RATIO = 1.8
"""Smallest ratio of a slower trial rise to that at the end of a search; smaller ones
lead back to the same optimum."""
LN_OMEGA = CENTRE.size
"""Index of ln omega among the unknowns."""
LEAST_PEAK = 0.02
"""Smallest peak of a trial pulse [share of the largest sample]; its logarithm must be
finite."""
DRIFTS = CENTRE.size - PULSE_UNKNOWNS
"""Number of unknowns of the drift: level, slope, bend, twist."""
Numbers = TypeVar("Numbers")


class Others(NamedTuple):
    """Other optima with a share of the posterior.

    Attributes:
        y: Unknowns of each.
        share: Factor on the square of its distance to the best, added to the
            covariance.
    """

    y: Float[Array, "other unknown"]
    share: Float[Array, " other"]


def first_optimum(bins: Bins, ready: Prepared) -> tuple[Optimum, Others]:
    """Return the optimum of one pulse, and two others.

    The first of the others is searched where the peak is uncertain or the pulse does
    not fit. If the posterior of the duration falls more slowly than that of Gauss and
    Newton, it is a longer pulse, with the share that widens the error accordingly. The
    second is a pulse of another arrival with much of the posterior, searched where the
    pulse is faint.

    Args:
        bins: Bins of the record.
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
    # a small share times a large distance would still widen the errors
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
    """Return the factor on the square of the shift that widens the error of duration.

    The error is larger if a longer pulse costs less than the parabola of Gauss and
    Newton.
    """
    dearer = jnp.maximum(2.0 * dearer, (DURATION_STEP_SD / LARGEST_WIDENING) ** 2)
    return jnp.where(
        held.converged, (DURATION_STEP_SD**2 / dearer - 1.0) / DURATION_STEP_SD**2, 0.0
    )


class Elsewhere(NamedTuple):
    """Share of other arrivals in the posterior.

    Attributes:
        start: Unknowns of the best of them.
        gain: Gain in ln posterior over the end of the search.
        mean: Mean of the arrivals relative to that end [samples].
        square: Mean of their squares [samples^2].
        far: Unknowns of the one that contributes most to that.
    """

    start: Float[Array, " unknown"]
    gain: Float[Array, ""]
    mean: Float[Array, ""]
    square: Float[Array, ""]
    far: Float[Array, " unknown"]


def _far(seen: Elsewhere, end, best: Optimum, first):
    """Return a pulse of another arrival, and its share.

    The share adds to the variance of the arrival what that lacks of the mean square.
    """
    moved = best.y[0] - end
    square = seen.square - moved * (2.0 * seen.mean - moved)
    known = best.covariance[0, 0] + first[1] * jnp.square(first[0][0] - best.y[0])
    off = jnp.square(seen.far[0] - best.y[0])
    some = (seen.square > 0) & (off > 0)
    part = jnp.clip((square - known) / jnp.where(some, off, 1.0), 0.0, 1.0)
    return seen.far, jnp.where(some, part, 0.0)


class Best(NamedTuple):
    """The best optimum so far.

    Attributes:
        cost: Minus its ln posterior.
        y: Its unknowns.
        covariance: Their covariance.
        ratio: Its squared misfit per degree of freedom.
    """

    cost: Float[Array, ""]
    y: Float[Array, " unknown"]
    covariance: Float[Array, "unknown unknown"]
    ratio: Float[Array, ""]


class SoFar(NamedTuple):
    """Results of earlier searches, for the next one.

    Attributes:
        sure: True if the last one fits and its peak is well constrained.
        poor: True if the first one does not fit at all.
        first: End of the first one.
        best: The best of all.
    """

    sure: Bool[Array, ""]
    poor: Bool[Array, ""]
    first: Float[Array, " unknown"]
    best: Best


class Searched(NamedTuple):
    """Result of a search.

    Attributes:
        found: The optimum; zeros, not converged, for a search that was not needed.
        cost: Minus its ln posterior; infinite for a search that was not needed or that
            found the best optimum again.
        seen: Share of other arrivals in the posterior, if computed.
        end: Arrival of the best optimum of the earlier searches.
    """

    found: Optimum
    cost: Float[Array, ""]
    seen: Elsewhere
    end: Float[Array, ""]


def searches_of(bins: Bins, ready: Prepared) -> Searched:
    """Return the results of the searches along a first axis, in their order.

    Args:
        bins: Bins of the record.
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

    # a scan compiles the search once for all five
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
    needed = jnp.where(kind == AGAIN, before.poor, ~before.sure)
    needed = jnp.where(far, there.needed, needed)
    needed = jnp.where(held, sd > DURATION_SD_TESTED, needed)
    moved = case.centre.at[DURATION].set(longer[DURATION])
    mine = case._replace(
        centre=jnp.where(held, moved, case.centre),
        hold=jnp.where(held, HOLD_WEIGHT, 0.0),
    )

    def optimized():
        here = jnp.where(kind == AGAIN, before.first, start)
        begin = lax.cond(
            held | far,
            lambda: jnp.where(held, longer, there.start),
            lambda: _best(bins, _about(here, jnp.asarray(SHIFTS, here.dtype)), case),
        )
        return optimum_of(of, begin, mine)

    found = lax.cond(needed, optimized, lambda: none)
    still = lax.stop_gradient((found.y, found.covariance))
    ratio = misfit_ratio(bins, still[0], case)
    variance = still[1][1, 1] * jnp.maximum(ratio, 1.0)
    cost = found.cost
    # an end that is no better is the same optimum again; at its cost it would take the
    # second rank from a real other one
    better = found.converged & (cost < best.cost - LEAST_GAIN)
    cost = jnp.where(far & ~better, jnp.inf, cost)
    first = kind == FIRST
    after = SoFar(
        sure=(variance < PEAK_SD_UNSURE**2) & (ratio < MISFIT_POOR),
        poor=jnp.where(first, ratio > MISFIT_ASTRAY, before.poor),
        first=jnp.where(first, still[0], before.first),
        best=select((cost < best.cost) & ~held, Best(cost, *still, ratio), best),
    )
    return after, Searched(found, cost, there.seen, best.y[0])


class _Elsewhere(NamedTuple):
    """Another start of a search, and whether it needs one."""

    needed: Bool[Array, ""]
    start: Float[Array, " unknown"]
    seen: Elsewhere


def _elsewhere(
    bins: Bins, case: Case, best: Best, looked: Bool[Array, ""]
) -> _Elsewhere:
    """Return the better start of other arrivals of a faint front and slower rises."""
    y, zero = best.y, jnp.zeros_like(best.ratio)
    # bounds of clipped bins are not linear in the peak, as variable projection needs
    linear = ~jnp.any(case.clipped != 0)
    faint = linear & (best.covariance[1, 1] > PEAK_SD_FAINT**2)
    astray = linear & (y[4] < np.log(SHARP_RISE))
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
    better = jnp.maximum(seen.gain, near.gain) > LEAST_GAIN
    return _Elsewhere(
        needed=better | (astray & (best.ratio > MISFIT_WRONG)),
        start=jnp.where(farther, seen.start, near.start),
        seen=seen,
    )


def _nothing(start: Float[Array, " unknown"]) -> Optimum:
    """Return the result of a search that was not needed."""
    unit = jnp.eye(CENTRE.size, dtype=start.dtype)
    never = jnp.full((), jnp.inf, start.dtype)
    none = jnp.zeros_like(never)
    return Optimum(jnp.zeros_like(start), unit, jnp.asarray(False), never, none)


def select(first, here, there):
    """Return one of two trees of arrays, by a condition on all of their elements."""
    return jax.tree.map(lambda a, b: jnp.where(first, a, b), here, there)


def cost_of(apart: Float[Array, " term"]) -> Float[Array, ""]:
    """Return minus ln posterior by the residuals."""
    return 0.5 * jnp.sum(apart * apart)


def elsewhere(
    bins: Bins,
    y: Float[Array, " unknown"],
    covariance: Float[Array, "unknown unknown"],
    widened: Float[Array, ""],
    case: Case,
) -> Elsewhere:
    """Return the share of other arrivals in the posterior.

    Args:
        bins: Bins of the record.
        y: End of a search.
        covariance: Covariance there.
        widened: Factor on the covariance by the misfit.
        case: The record.
    """
    kind = y.dtype
    end = y[0] + jnp.exp(y[2])
    arrivals = jnp.asarray(ARRIVALS, kind)

    def with_rise(rise):
        duration = jnp.maximum(end - arrivals, RISES_IN_DURATION * rise)
        trials = jnp.tile(y, (arrivals.size, 1))
        trials = trials.at[:, 0].set(arrivals).at[:, 2].set(jnp.log(duration))
        # the end of the positive phase and the suction behind it stay, as the record
        # behind the front does not depend on the arrival
        trials = trials.at[:, 6].add(y[2] - jnp.log(duration))
        trials = trials.at[:, 4].set(jnp.log(free_rise(rise, duration)))
        made = profiled(bins, trials, case)
        fits = end - arrivals >= RISES_IN_DURATION * rise
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
    # an optimum narrower than the grid of trials falls between them: its own volume is
    # that of its covariance, at most one cell of the grid
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
    """Return the best starting point of a pulse through a resonant sensor.

    Args:
        bins: Bins of the record.
        start: A pulse; frequency and damping by the residuals of one pulse.
        case: The record.
    """
    # a resonance delays the visible front, so the true one is earlier
    late = jnp.asarray(RING_DELAYS, start.dtype) * jnp.exp(-start[LN_OMEGA])
    trials = jnp.concatenate([_about(start, -late), _hidden(start)])
    return _best(bins, trials, case)


class Closer(NamedTuple):
    """A pulse with a slower rise about the end of a search.

    Attributes:
        start: Its unknowns.
        gain: Gain in ln posterior over that end.
    """

    start: Float[Array, " unknown"]
    gain: Float[Array, ""]


def closer(bins: Bins, y: Float[Array, " unknown"], case: Case) -> Closer:
    """Return the best pulse with a slower rise about the end of a search.

    A sharp front has a minimum of the cost at the edge of a sample, far from that of a
    slower one, and a search may end there.

    Args:
        bins: Bins of the record.
        y: End of a search.
        case: The record.
    """
    made = profiled(bins, _about(y, jnp.asarray(SHIFTS, y.dtype)), case)
    # the first of them is the end itself
    slower = made.y[:, 4] > y[4] + np.log(SLOWER_RISE_RATIO)
    best = jnp.argmin(jnp.where(slower, made.cost, jnp.inf))
    return Closer(made.y[best], made.cost[0] - made.cost[best])


class Hidden(NamedTuple):
    """The resonance that would explain most of the residuals of one pulse.

    Attributes:
        gain: Gain in ln posterior, to second order.
        start: Starting point of a search.
    """

    gain: Float[Array, ""]
    start: Float[Array, " unknown"]


def hidden_ring(
    bins: Bins, one: Optimum, start: Float[Array, " unknown"], case: Case
) -> Hidden:
    r"""Return the resonance that a slow front may hide.

    The contribution of a resonance is projected onto the complement of the changes by
    the pulse's own unknowns. With the residuals $r$, their slopes $J$ and the change
    $\Delta$ by a trial, the gain is $-r^T P \Delta - |P \Delta|^2/2$, where
    $P = 1 - J (J^T J)^{-1} J^T$.

    Args:
        bins: Bins of the record.
        one: Optimum of one pulse.
        start: The same, with the further unknowns.
        case: The record, with a resonance.
    """
    plain = CENTRE.size
    alone = case._replace(centre=case.centre[:plain], rings=jnp.zeros_like(case.rings))
    still = lax.stop_gradient((alone, case, one.y, one.covariance, start))
    alone, case, y, covariance, start = still

    def twice(y):
        apart = misfit(bins, y, alone)
        return apart, apart

    # residuals and slopes by one evaluation
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
    """Return trials of hidden resonances, whose true rises are slower."""
    kind = start.dtype
    longest = 0.5 * jnp.exp(start[2])
    rise = jnp.exp(start[4]) / (1.0 + jnp.exp(start[4] - start[2]))
    slower = jnp.sqrt(
        rise * rise + (HIDDEN_RISE_FACTOR / HIDDEN_FREQUENCIES**2).astype(kind)
    )
    slower = jnp.minimum(slower, longest)
    trials = jnp.tile(start, (HIDDEN_FREQUENCIES.size, 1))
    trials = trials.at[:, 0].add(0.5 * (rise - slower))
    free = slower / (1.0 - slower * jnp.exp(-start[2]))
    trials = trials.at[:, 4].set(jnp.log(free))
    return trials.at[:, LN_OMEGA].set(np.log(HIDDEN_FREQUENCIES).astype(kind))


def _about(start, shifts):
    """Return a start, and trials of other rises and arrivals about it."""
    # the position of a rise's middle is better constrained than its start
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
    """Return the trial that fits best."""
    trials = lax.stop_gradient(trials)
    # single precision: trials differ by much more than its rounding, in half the time
    still = in_single(lax.stop_gradient(case))

    def cost(y):
        return jnp.sum(jnp.square(misfit(bins, y, still)))

    costs = jax.vmap(cost)(in_single(trials))
    costs = jnp.where(jnp.isfinite(costs), costs, jnp.inf)
    return trials[jnp.argmin(costs)]


class Profiled(NamedTuple):
    """Pulses with optimal peak, suction and drift.

    Attributes:
        y: The unknowns.
        cost: Minus ln posterior.
        width: ln of the posterior volume of the linear unknowns.
    """

    y: Float[Array, "trial unknown"]
    cost: Float[Array, " trial"]
    width: Float[Array, " trial"]


def profiled(bins: Bins, trials: Float[Array, "trial unknown"], case: Case) -> Profiled:
    """Return pulses with optimal peak, suction and drift.

    Clipped bins are left out: the search accounts for their bounds.

    Args:
        bins: Bins of the record.
        trials: Unknowns; their peak, suction and drift are a first guess.
        case: The record.
    """
    kind = trials.dtype
    trials = lax.stop_gradient(trials)
    x = (jnp.asarray(bins.middle, kind) - case.middle) / case.span
    drift = _whitened(bins, case, jnp.stack([x**k for k in range(DRIFTS)]))
    fixed = jnp.concatenate([drift, case.white[None, :]])
    rows = jax.vmap(partial(_pulse_rows, bins, in_single(case)))(in_single(trials))
    # rows computed in single precision, normal equations of them in the record's: these
    # square the condition number
    rows = rows.astype(kind)
    own, across = rows @ jnp.swapaxes(rows, 1, 2), rows @ fixed.T
    among = fixed @ fixed.T
    spread = jnp.asarray(SPREAD, kind)
    wide = jnp.diag(jnp.square(1.0 / spread[PULSE_UNKNOWNS:]))

    def one(y, own, across):
        # the prior of the suction is one of its ratio to the peak, hence a row that
        # couples both
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
    """Return the whitened bins of a peak of 1 and of a suction of 1."""
    rows = mean_columns(bins, pulse_by(natural_of(y)))
    if case.high_pass is not None:
        passed = jax.vmap(partial(low_passed, bins), in_axes=(0, None))
        rows = rows - passed(rows, case.high_pass)
    return _whitened(bins, case, rows)


def _whitened(bins: Bins, case: Case, rows: Float[Array, "row bin"]):
    """Return means over bins, whitened and weighted."""
    white = jax.vmap(partial(whitened_means, case.noise, bins))(rows)
    return case.weight[None, :] * white


def in_single(numbers: Numbers) -> Numbers:
    """Return a tree with its floating-point arrays in single precision.

    Args:
        numbers: The tree.
    """

    def single(x):
        return x.astype(jnp.float32) if jnp.issubdtype(x.dtype, jnp.floating) else x

    return jax.tree.map(single, numbers)
