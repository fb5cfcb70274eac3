r"""The model of a record's bins, its misfit, and the optimum of that.

    pulses -> resonance -> means over bins -> high-pass -> drift added -> whitened

In wide bins a ringing oscillates; it is whitened by the response of the taps at its
pole.

Half of the squared misfit is minus ln posterior: whitened residuals, then the
distances of the unknowns from their priors. A clipped bin states only that the pressure
$m$ was at least the level $c$; its residual is $\sqrt{-2 \ln \Phi((m - c)/\sigma)}$,
half of whose square is minus the logarithm of that probability.

The optimum is searched by Levenberg and Marquardt, as in `inference/many`, for one
record. The search is not differentiated: at an optimum the slope $g(y, d)$ of minus ln
posterior is zero, so $\mathrm{d}y = -H^{-1}\,\partial_d g\,\mathrm{d}d$ with the full
Hessian $H$.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.scipy.special import log_ndtr
from jaxtyping import Array, Bool, Float, Int

from jblast.signals.picks.preparation import Bins, Case, whitened_means
from jblast.signals.picks.pulse_means import Ringing, means_over, pole_of, ringing
from jblast.signals.picks.unknowns import (
    CENTRE,
    FURTHER_SPREAD,
    PULSE_UNKNOWNS,
    SPREAD,
    following,
    natural_of,
    pulse_by,
)

SUMMED_BINS = 8
"""Bins whose differences are summed to test for slow trends."""
SLOW_UNKNOWNS = 9.0
"""All but arrival and rise."""
FARTHEST_MEMORY = 300.0
"""Time constants from the front that a high-pass is followed over: exponents stay
within double precision."""
MOST_STEPS = 60
"""Of a search from a poor start; a good one takes about a dozen."""
TOLERANCE = 1e-3
"""Ends with the step before which the way left to an optimum is this long [standard
deviations, as they are widened by the misfit]: behind it a tenth or less is left."""
KINK = 0.5
"""Where a sharp front meets the edge of a sample the cost has a kink, and may have its
least there, so far from where its slopes would have it [standard deviations]."""
STILL = 1e-4
"""A step that lowers minus ln posterior by less, as errors are widened, is lost."""
MOST_LOST = 6
"""Steps in a row: at a kink the next are no better, whatever their damping, and it is
an optimum, whatever the slopes."""
PATIENT = 10
"""Steps by which a search is to be as good as what stands already."""
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-1, 1e-10, 1e6
"""Of a unit diagonal, at the start and its bounds: below the least a step is Gauss and
Newton's to rounding, above the most it moves nothing."""
SMALL_DAMPING = 1e-2
"""Of a unit diagonal: no end is seen from a step that is damped more."""
Misfit = Callable[[Float[Array, " unknown"], Case], Float[Array, " term"]]


def modelled(
    bins: Bins, y: Float[Array, " unknown"], case: Case
) -> tuple[Float[Array, " bin"], Ringing | None]:
    """Return the mean pressure over each bin, as a share of the largest sample.

    And what of it a resonance adds; None: the unknowns have none.
    """
    natural = natural_of(y)
    waves, rings = means_over(bins, pulse_by(natural), case.form), None
    if (further := y[CENTRE.size :]).size:
        zero = jnp.zeros_like(waves)
        none = Ringing(zero, zero, zero)

        def follows():
            after = pulse_by(following(natural, further))
            return none._replace(mean=means_over(bins, after, case.form))

        def rings_on():
            return ringing(bins, pulse_by(natural), *_resonance(y))

        def passed():
            return none._replace(mean=-low_passed(bins, waves, jnp.exp(further[5])))

        def shifted():
            stop, width = (x.astype(y.dtype) for x in (bins.stop, bins.width))
            behind = jnp.clip((stop - natural.arrival) / width, 0.0, 1.0)
            return none._replace(mean=natural.peak * further[6] * behind)

        # one at most is requested, for most records none
        asked = (zero[0] + 0.5, case.rings, case.follows, case.passed, case.shifted)
        choices = [lambda: none, rings_on, follows, passed, shifted]
        rings = lax.switch(jnp.argmax(jnp.stack(asked)), choices)
        waves = waves + rings.mean
    if case.high_pass is not None:
        waves = waves - low_passed(bins, waves, case.high_pass)
    x = (jnp.asarray(bins.middle, y.dtype) - case.middle) / case.span
    return waves + drift_at(y, x), rings


def _resonance(y: Float[Array, " unknown"]):
    """Return frequency [1/sample] and damping of a sensor that rings."""
    ln_omega, logit = y[CENTRE.size], y[CENTRE.size + 1]
    return jnp.exp(ln_omega), 1.0 / (1.0 + jnp.exp(-logit))


def _whitened(
    bins: Bins,
    y: Float[Array, " unknown"],
    case: Case,
    means: Float[Array, " bin"],
    rings: Ringing | None,
) -> Float[Array, " bin"]:
    """Return means through the taps that make noise white."""
    if rings is None:
        return whitened_means(case.noise, bins, means)
    # z(t - k) is z(t) exp(-pole k): the taps multiply what rings by a number
    later = jnp.exp(-pole_of(*_resonance(y)))
    taps = case.noise.taps.astype(later.dtype)
    gain = jnp.zeros_like(later)
    for k in reversed(range(taps.shape[0])):
        gain = gain * later + taps[k]
    passed = jnp.real(gain) * rings.real - jnp.imag(gain) * rings.imaginary
    return whitened_means(case.noise, bins, means, rings.real, passed)


def drift_at(
    y: Float[Array, " unknown"], x: Float[Array, "..."]
) -> Float[Array, "..."]:
    """Return the drift at places of the stretch, from -1 to 1.

    Args:
        y: The unknowns.
        x: The places.
    """
    level, slope, bend, twist = y[PULSE_UNKNOWNS : PULSE_UNKNOWNS + 4]
    return level + x * (slope + x * (bend + x * twist))


def low_passed(
    bins: Bins, means: Float[Array, " bin"], corner: Float[Array, ""]
) -> Float[Array, " bin"]:
    r"""Return what a first-order high-pass takes away, as means over bins.

    $v' = a\,(p - v)$: of steps from bin to bin exactly,
    $v_i = \sum_{j<i} p_j\,(e^{-a(t_i - b_j)} - e^{-a(t_i - a_j)})$ at the start $t_i$
    of a bin, $a_j$ and $b_j$ the ends of those before. The exponents are counted from
    the front, and bounded where nothing is left of what was that long ago.
    """
    kind = means.dtype
    start, stop = bins.start.astype(kind), bins.stop.astype(kind)
    far = FARTHEST_MEMORY / jnp.maximum(corner, jnp.finfo(kind).tiny)
    start, stop = jnp.clip(start, -far, far), jnp.clip(stop, -far, far)
    steps = means * (jnp.exp(corner * stop) - jnp.exp(corner * start))
    sums = jnp.cumsum(steps) - steps
    before = sums * jnp.exp(-corner * start)
    passed = corner * bins.width.astype(kind)
    # the mean over the bin; by expm1, because bins are short against its time constant
    kept = -jnp.expm1(-passed) / passed
    return before * kept + means * (1.0 - kept)


def misfit(
    bins: Bins, y: Float[Array, " unknown"], case: Case
) -> Float[Array, " term"]:
    """Return the vector of which half the square is minus ln posterior.

    Args:
        bins: Where the record is looked at.
        y: The unknowns.
        case: The record.
    """
    means, rings = modelled(bins, y, case)
    apart = case.white - case.weight * _whitened(bins, y, case, means, rings)
    held = case.clipped != 0

    def bounded():
        above = jnp.where(held, case.clipped * means - case.level, 0.0)
        chance = log_ndtr(above / case.noise.marginal)
        # far above the level the root has no slope, and needs none
        short = jnp.sqrt(jnp.maximum(-2.0 * chance, 1e-20))
        return jnp.where(held, short, apart)

    # few records are clipped, and the chance of one costs more than all its means
    apart = lax.cond(jnp.any(held), bounded, lambda: apart)
    spread = np.concatenate([SPREAD, FURTHER_SPREAD])[: y.shape[0]]
    prior = (y - case.centre) / spread.astype(y.dtype)
    prior = prior.at[2].multiply(1.0 + case.hold)
    return jnp.concatenate([apart, prior])


def misfit_ratio(
    bins: Bins, y: Float[Array, " unknown"], case: Case
) -> Float[Array, ""]:
    """Return the squared misfit of the bins that count, by degree of freedom.

    Args:
        bins: Where the record is looked at.
        y: The unknowns.
        case: The record.
    """
    return _ratio(_apart(bins, y, case), case)


def larger_misfit_ratio(
    bins: Bins, y: Float[Array, " unknown"], case: Case
) -> Float[Array, ""]:
    """Return that or the same of neighbours together, whichever is larger.

    Where a baseline is not the model's, what moves slowly is small in each bin, and all
    of it goes into duration and impulse; of `SUMMED_BINS` bins' sum it is as many times
    more.

    Args:
        bins: Where the record is looked at.
        y: The unknowns.
        case: The record.
    """
    apart = _apart(bins, y, case)
    return jnp.maximum(_ratio(apart, case), _slow_ratio(apart, case))


def _apart(bins: Bins, y, case: Case):
    """Return the misfit without what is believed."""
    return misfit(bins, y, case)[: bins.first.size]


def _ratio(apart, case: Case):
    """Return the squared misfit by degree of freedom."""
    many = jnp.sum(jnp.where((case.weight > 0) | (case.clipped != 0), 1.0, 0.0))
    return jnp.sum(jnp.square(apart)) / jnp.maximum(many - float(CENTRE.size), 1.0)


def _slow_ratio(apart, case: Case):
    """Return the same of `SUMMED_BINS` neighbours' sums."""
    used = (case.weight > 0) & (case.clipped == 0)
    kind = apart.dtype
    apart = jnp.where(used, apart, 0.0)
    # zeros to whole blocks: they enter no sum
    short = -apart.shape[0] % SUMMED_BINS
    blocks = jnp.pad(apart, (0, short)).reshape(-1, SUMMED_BINS)
    counts = jnp.pad(used.astype(kind), (0, short)).reshape(-1, SUMMED_BINS)
    count = jnp.sum(counts, axis=1)
    squares = jnp.square(jnp.sum(blocks, axis=1)) / jnp.maximum(count, 1.0)
    many = jnp.sum((count > 0).astype(kind))
    return jnp.sum(squares) / jnp.maximum(many - SLOW_UNKNOWNS, 4.0)


class Optimum(NamedTuple):
    """The most probable unknowns of a record.

    Attributes:
        y: The unknowns.
        covariance: Of the posterior about them, by Gauss and Newton.
        converged: Whether they are an optimum.
        cost: Minus ln posterior of the last step but the one that ended the search.
        size: ln of the determinant of the covariance.
    """

    y: Float[Array, " unknown"]
    covariance: Float[Array, "unknown unknown"]
    converged: Bool[Array, ""]
    cost: Float[Array, ""]
    size: Float[Array, ""]


def optimum_of(
    misfit: Misfit,
    start: Float[Array, " unknown"],
    case: Case,
    *,
    most_steps: int = MOST_STEPS,
    hopeless: Float[Array, ""] | float = np.inf,
) -> Optimum:
    """Return the optimum of a record.

    Args:
        misfit: Its misfit.
        start: Where to begin.
        case: The record.
        most_steps: After which the search ends, at an optimum or not.
        hopeless: A search whose cost is above this after `PATIENT` steps ends; its
            optimum is not needed.
    """
    # the search has no slopes of its own: those of its end are of the implicit function
    # (`_settled`), whatever its steps
    still = lax.stop_gradient(case)
    begin = lax.stop_gradient(start)
    found = _search(misfit, begin, still, most_steps, hopeless)
    y, cost, size = _settled(misfit, found, case)
    return found._replace(y=y, cost=cost, size=size)


class _State(NamedTuple):
    """State of the search."""

    y: Float[Array, " unknown"]
    tried: Float[Array, " unknown"]
    damping: Float[Array, ""]
    here: "_Expansion"
    done: Bool[Array, ""]
    steps: Int[Array, ""]
    lost: Int[Array, ""]


class _Expansion(NamedTuple):
    """Minus ln posterior about a place, to second order by Gauss and Newton.

    The unknowns are scaled so that the information has a diagonal of ones.
    """

    cost: Float[Array, ""]
    slope: Float[Array, " unknown"]
    information: Float[Array, "unknown unknown"]
    scale: Float[Array, " unknown"]


def _expansion(misfit: Misfit, y, apart, cost, case: Case) -> _Expansion:
    """Return the cost of a record about a place, its misfit there being known."""
    _, moved = jax.linearize(lambda y: misfit(y, case), y)
    # a row an unknown: what is done to each of them runs along the bins
    slopes = jax.vmap(moved)(jnp.eye(y.size, dtype=y.dtype))
    information = slopes @ slopes.T
    # unknowns differ by orders of magnitude: with ones on the diagonal a damping means
    # the same for each
    scale = 1.0 / jnp.sqrt(jnp.diagonal(information))
    return _Expansion(
        cost=cost,
        slope=scale * (slopes @ apart),
        information=information * scale[:, None] * scale[None, :],
        scale=scale,
    )


def _search(misfit: Misfit, start, case: Case, most_steps: int, hopeless) -> Optimum:
    """Return the optimum, found by Levenberg-Marquardt."""
    unit = jnp.eye(start.size, dtype=start.dtype)
    eps = jnp.finfo(start.dtype).eps
    # what rounding makes of the cost, and of a slope in standard deviations
    rounding = 4.0 * eps * jnp.sqrt(jnp.sum(jnp.square(case.weight)))
    many = jnp.maximum(jnp.sum((case.weight > 0).astype(start.dtype)), 1.0)

    def step(state: _State) -> _State:
        apart = misfit(state.tried, case)
        cost = 0.5 * jnp.sum(apart * apart)
        slack = rounding * (jnp.sqrt(2.0 * jnp.abs(cost)) + rounding)
        better = cost <= state.here.cost + slack
        widened = jnp.maximum(2.0 * state.here.cost / many, 1.0)
        lost = ~(cost < state.here.cost - STILL * widened)
        # slopes cost as much as several misfits, and not every step is taken
        here = lax.cond(
            better,
            lambda: _expansion(misfit, state.tried, apart, cost, case),
            lambda: state.here,
        )
        y = jnp.where(better, state.tried, state.y)
        # Marquardt's factors (1963)
        damping = jnp.where(better, 0.1 * state.damping, 10.0 * state.damping)
        damping = jnp.clip(damping, LEAST_DAMPING, MOST_DAMPING)
        move = -jnp.linalg.solve(here.information + damping * unit, here.slope)
        left = -jnp.sum(move * (2.0 * here.slope + damping * move))
        # what does not fit has larger errors, and no use for as many digits
        near = left <= widened * jnp.square(jnp.maximum(TOLERANCE, rounding))
        move = jnp.where(jnp.isfinite(move), move, 0.0)
        return _State(
            y=y,
            tried=y + move * here.scale,
            damping=damping,
            here=here,
            done=near & (damping <= SMALL_DAMPING),
            steps=state.steps + 1,
            lost=jnp.where(lost, state.lost + 1, 0),
        )

    nothing = _Expansion(
        cost=jnp.full((), jnp.inf, start.dtype),
        slope=jnp.zeros_like(start),
        information=unit,
        scale=jnp.ones_like(start),
    )
    state = _State(
        y=start,
        tried=start,
        damping=jnp.full((), FIRST_DAMPING, start.dtype),
        here=nothing,
        done=jnp.asarray(False),
        steps=jnp.asarray(0),
        lost=jnp.asarray(0),
    )

    def goes_on(state: _State) -> Bool[Array, ""]:
        hopes = (state.steps < PATIENT) | ~(state.here.cost > hopeless)
        ended = state.done | (state.steps >= most_steps) | (state.lost >= MOST_LOST)
        return hopes & ~ended

    state = lax.while_loop(goes_on, step, state)
    inverse = jnp.linalg.inv(state.here.information)
    scale, slope = state.here.scale, state.here.slope
    covariance = inverse * scale[:, None] * scale[None, :]
    left = slope @ inverse @ slope
    y = jnp.where(state.done, state.tried, state.y)
    ended = state.done | (state.lost >= MOST_LOST)
    size = jnp.linalg.slogdet(covariance)[1]
    return Optimum(y, covariance, ended | (left < KINK**2), state.here.cost, size)


def _slope(misfit: Misfit, y, case: Case):
    """Return the slope of minus ln posterior."""
    apart, back = jax.vjp(lambda y: misfit(y, case), y)
    return back(apart)[0]


def _settled(misfit: Misfit, found: Optimum, case: Case):
    """Return an optimum, its cost and size, with slopes of the implicit function."""

    def size_at(y, case):
        slopes = jax.jacfwd(lambda y: misfit(y, case))(y)
        return -jnp.linalg.slogdet(slopes.T @ slopes)[1]

    @jax.custom_jvp
    def settled(y, cost, size, case):
        del case
        return y, cost, size

    @settled.defjvp
    def _(primals, tangents):
        y, _, _, case = primals
        moves = tangents[3]
        _, moved = jax.jvp(lambda case: _slope(misfit, y, case), (case,), (moves,))
        bend = jax.jacfwd(lambda y: _slope(misfit, y, case))(y)
        there = -jnp.linalg.solve(bend, moved[:, None])[:, 0]
        # at an optimum the cost moves by the record alone, its width by both
        _, dearer = jax.jvp(
            lambda case: 0.5 * jnp.sum(jnp.square(misfit(y, case))), (case,), (moves,)
        )
        _, wider = jax.jvp(size_at, (y, case), (there, moves))
        return primals[:3], (there, dearer, wider)

    return settled(found.y, found.cost, found.size, case)
