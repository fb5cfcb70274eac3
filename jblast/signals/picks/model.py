r"""The model of a record's bins, its misfit and the optimum of the posterior.

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
"""Bins whose residuals are summed to test for slow trends: a trend of about a third of
a standard deviation in each bin is one standard deviation of such a sum. A record has
about two hundred bins, so sums of more would be too few for the test."""
SLOW_UNKNOWNS = 9.0
"""Degrees of freedom that slow trends use: all unknowns but arrival and rise."""
FARTHEST_MEMORY = 300.0
"""Time constants from the front over which a high-pass is followed. Exponentials up to
exp(300) = 2e130 stay within double precision; effects that old are exp(-300)."""
MAX_STEPS = 60
"""Largest number of steps of a search from a poor start; a good one takes a dozen."""
STEP_TOLERANCE_SD = 1e-3
"""Distance to the optimum at which the search ends with one more step [standard
deviations, widened by the misfit]. That step leaves a tenth of it or less, far below
the error of any value."""
KINK_SD = 0.5
"""Largest distance between a kink that is accepted as the optimum and the optimum by
its slopes [standard deviations]. The cost has a kink where a sharp front meets the edge
of a sample, and may have its minimum there."""
LEAST_DECREASE = 1e-4
"""Smallest decrease of minus ln posterior, widened by the misfit, that counts as
progress. It corresponds to about a hundredth of a standard deviation."""
MAX_LOST_STEPS = 6
"""Steps in a row without progress after which the search ends. At a kink steps of any
damping make none, so it is accepted as an optimum whatever its slopes. Six steps
raise the damping by 1e6."""
PATIENT_STEPS = 10
"""Steps after which a search must be as good as the fit that it competes with: good
starts converge in about a dozen."""
FIRST_DAMPING, LEAST_DAMPING, MAX_DAMPING = 1e-1, 1e-10, 1e6
"""Damping at the start, and its bounds, over the unit diagonal. Below the lower bound a
step is that of Gauss and Newton to rounding; above the upper one it is negligible."""
END_DAMPING = 1e-2
"""Largest damping over the unit diagonal at which convergence is tested: steps that are
damped more are short whatever the distance to the optimum."""
Misfit = Callable[[Float[Array, " unknown"], Case], Float[Array, " term"]]


def modelled(
    bins: Bins, y: Float[Array, " unknown"], case: Case
) -> tuple[Float[Array, " bin"], Ringing | None]:
    """Return the mean pressure over each bin, as a share of the largest sample.

    The second result is the contribution of a resonance to it; None if the unknowns
    contain no further effects.
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

        # a record has at most one effect and mostly none: a switch evaluates only the
        # one whose flag is 1, and 0.5 selects none where all flags are 0
        flags = (zero[0] + 0.5, case.rings, case.follows, case.passed, case.shifted)
        choices = [lambda: none, rings_on, follows, passed, shifted]
        rings = lax.switch(jnp.argmax(jnp.stack(flags)), choices)
        waves = waves + rings.mean
    if case.high_pass is not None:
        waves = waves - low_passed(bins, waves, case.high_pass)
    x = (jnp.asarray(bins.middle, y.dtype) - case.middle) / case.span
    return waves + drift_at(y, x), rings


def _resonance(y: Float[Array, " unknown"]):
    """Return angular frequency [1/sample] and damping of a resonant sensor."""
    ln_omega, logit = y[CENTRE.size], y[CENTRE.size + 1]
    return jnp.exp(ln_omega), 1.0 / (1.0 + jnp.exp(-logit))


def _whitened(
    bins: Bins,
    y: Float[Array, " unknown"],
    case: Case,
    means: Float[Array, " bin"],
    rings: Ringing | None,
) -> Float[Array, " bin"]:
    """Return means filtered by the taps that whiten the noise."""
    if rings is None:
        return whitened_means(case.noise, bins, means)
    # in bins wider than a sample a ringing is not smooth, so the taps cannot be applied
    # to bins; but z(t - k) = z(t) exp(-pole k), so they multiply it by one number
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
    """Return the drift of the baseline.

    Args:
        y: The unknowns.
        x: Positions in the fitted interval, -1 at its start, 1 at its end.
    """
    level, slope, bend, twist = y[PULSE_UNKNOWNS : PULSE_UNKNOWNS + 4]
    return level + x * (slope + x * (bend + x * twist))


def low_passed(
    bins: Bins, means: Float[Array, " bin"], corner: Float[Array, ""]
) -> Float[Array, " bin"]:
    r"""Return the part that a first-order high-pass removes, as means over bins.

    It obeys $v' = a\,(p - v)$. For a pressure that is constant over each bin,
    $v_i = \sum_{j<i} p_j\,(e^{-a(t_i - b_j)} - e^{-a(t_i - a_j)})$ exactly at the start
    $t_i$ of a bin, with $a_j$ and $b_j$ the bounds of the bins before. Exponents count
    from the front and are bounded by `FARTHEST_MEMORY`.
    """
    kind = means.dtype
    start, stop = bins.start.astype(kind), bins.stop.astype(kind)
    far = FARTHEST_MEMORY / jnp.maximum(corner, jnp.finfo(kind).tiny)
    start, stop = jnp.clip(start, -far, far), jnp.clip(stop, -far, far)
    steps = means * (jnp.exp(corner * stop) - jnp.exp(corner * start))
    sums = jnp.cumsum(steps) - steps
    before = sums * jnp.exp(-corner * start)
    passed = corner * bins.width.astype(kind)
    # 1 - exp(-x) loses all digits here: bins are short against the time constant
    kept = -jnp.expm1(-passed) / passed
    return before * kept + means * (1.0 - kept)


def misfit(
    bins: Bins, y: Float[Array, " unknown"], case: Case
) -> Float[Array, " term"]:
    """Return the residuals, half of whose square is minus ln posterior.

    Args:
        bins: Bins of the record.
        y: The unknowns.
        case: The record.
    """
    means, rings = modelled(bins, y, case)
    apart = case.white - case.weight * _whitened(bins, y, case, means, rings)
    held = case.clipped != 0

    def bounded():
        above = jnp.where(held, case.clipped * means - case.level, 0.0)
        chance = log_ndtr(above / case.noise.marginal)
        # the root has an infinite slope at zero: far above the level the chance rounds
        # to 1, and a floor instead has the slope zero that it should have
        short = jnp.sqrt(jnp.maximum(-2.0 * chance, 1e-20))
        return jnp.where(held, short, apart)

    # few records are clipped, and log_ndtr of all bins costs more than all their means
    apart = lax.cond(jnp.any(held), bounded, lambda: apart)
    spread = np.concatenate([SPREAD, FURTHER_SPREAD])[: y.shape[0]]
    prior = (y - case.centre) / spread.astype(y.dtype)
    prior = prior.at[2].multiply(1.0 + case.hold)
    return jnp.concatenate([apart, prior])


def misfit_ratio(
    bins: Bins, y: Float[Array, " unknown"], case: Case
) -> Float[Array, ""]:
    """Return the squared misfit of the used bins per degree of freedom.

    Args:
        bins: Bins of the record.
        y: The unknowns.
        case: The record.
    """
    return _ratio(_apart(bins, y, case), case)


def larger_misfit_ratio(
    bins: Bins, y: Float[Array, " unknown"], case: Case
) -> Float[Array, ""]:
    """Return the larger of `misfit_ratio` and the same of sums of `SUMMED_BINS` bins.

    A slow trend that the model does not have is small in each bin, but biases duration
    and impulse. In the square of a sum over bins it counts `SUMMED_BINS` times more
    than white noise.

    Args:
        bins: Bins of the record.
        y: The unknowns.
        case: The record.
    """
    apart = _apart(bins, y, case)
    return jnp.maximum(_ratio(apart, case), _slow_ratio(apart, case))


def _apart(bins: Bins, y, case: Case):
    """Return the residuals of the bins, without those of the priors."""
    return misfit(bins, y, case)[: bins.first.size]


def _ratio(apart, case: Case):
    """Return the squared misfit per degree of freedom."""
    many = jnp.sum(jnp.where((case.weight > 0) | (case.clipped != 0), 1.0, 0.0))
    return jnp.sum(jnp.square(apart)) / jnp.maximum(many - float(CENTRE.size), 1.0)


def _slow_ratio(apart, case: Case):
    """Return the same of sums over `SUMMED_BINS` neighbouring bins."""
    used = (case.weight > 0) & (case.clipped == 0)
    kind = apart.dtype
    apart = jnp.where(used, apart, 0.0)
    # padding with zeros completes the last block; its count leaves them out
    short = -apart.shape[0] % SUMMED_BINS
    blocks = jnp.pad(apart, (0, short)).reshape(-1, SUMMED_BINS)
    counts = jnp.pad(used.astype(kind), (0, short)).reshape(-1, SUMMED_BINS)
    count = jnp.sum(counts, axis=1)
    squares = jnp.square(jnp.sum(blocks, axis=1)) / jnp.maximum(count, 1.0)
    many = jnp.sum((count > 0).astype(kind))
    # a short record has few sums: at least 4 degrees of freedom keep the ratio finite
    return jnp.sum(squares) / jnp.maximum(many - SLOW_UNKNOWNS, 4.0)


class Optimum(NamedTuple):
    """The most probable unknowns of a record.

    Attributes:
        y: The unknowns.
        covariance: Covariance of the posterior about them, by Gauss and Newton.
        converged: Whether they are an optimum.
        cost: Minus ln posterior at the last point where it was evaluated; the search
            ends with one more step.
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
    most_steps: int = MAX_STEPS,
    hopeless: Float[Array, ""] | float = np.inf,
) -> Optimum:
    """Return the optimum of a record.

    Args:
        misfit: Its misfit.
        start: Starting point.
        case: The record.
        most_steps: Largest number of steps.
        hopeless: A search whose cost is above this after `PATIENT_STEPS` steps ends,
            since its optimum is not needed.
    """
    # a while loop has no reverse mode, and slopes through all steps would be wrong by
    # what is left of convergence: those of the implicit function are exact (`_settled`)
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
    """Minus ln posterior about a point, to second order by Gauss and Newton.

    The unknowns are scaled so that the information matrix has a unit diagonal.
    """

    cost: Float[Array, ""]
    slope: Float[Array, " unknown"]
    information: Float[Array, "unknown unknown"]
    scale: Float[Array, " unknown"]


def _expansion(misfit: Misfit, y, apart, cost, case: Case) -> _Expansion:
    """Return the expansion about a point whose residuals are given."""
    _, moved = jax.linearize(lambda y: misfit(y, case), y)
    # one row per unknown, so that elementwise operations are contiguous along the bins
    slopes = jax.vmap(moved)(jnp.eye(y.size, dtype=y.dtype))
    information = slopes @ slopes.T
    # unknowns differ by orders of magnitude: with a unit diagonal one damping suits all
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
    # rounding error of the root of the cost, and of a slope in standard deviations: a
    # step that worsens the cost by less than rounding is not rejected
    rounding = 4.0 * eps * jnp.sqrt(jnp.sum(jnp.square(case.weight)))
    many = jnp.maximum(jnp.sum((case.weight > 0).astype(start.dtype)), 1.0)

    def step(state: _State) -> _State:
        apart = misfit(state.tried, case)
        cost = 0.5 * jnp.sum(apart * apart)
        slack = rounding * (jnp.sqrt(2.0 * jnp.abs(cost)) + rounding)
        better = cost <= state.here.cost + slack
        widened = jnp.maximum(2.0 * state.here.cost / many, 1.0)
        lost = ~(cost < state.here.cost - LEAST_DECREASE * widened)
        # slopes cost as much as several misfits: rejected steps reuse the last ones
        here = lax.cond(
            better,
            lambda: _expansion(misfit, state.tried, apart, cost, case),
            lambda: state.here,
        )
        y = jnp.where(better, state.tried, state.y)
        # factors of ten as in Marquardt (1963)
        damping = jnp.where(better, 0.1 * state.damping, 10.0 * state.damping)
        damping = jnp.clip(damping, LEAST_DAMPING, MAX_DAMPING)
        move = -jnp.linalg.solve(here.information + damping * unit, here.slope)
        left = -jnp.sum(move * (2.0 * here.slope + damping * move))
        # records that the model does not fit have errors wider by the misfit, and need
        # correspondingly fewer digits
        near = left <= widened * jnp.square(jnp.maximum(STEP_TOLERANCE_SD, rounding))
        move = jnp.where(jnp.isfinite(move), move, 0.0)
        return _State(
            y=y,
            tried=y + move * here.scale,
            damping=damping,
            here=here,
            done=near & (damping <= END_DAMPING),
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

    def unfinished(state: _State) -> Bool[Array, ""]:
        hopes = (state.steps < PATIENT_STEPS) | ~(state.here.cost > hopeless)
        ended = (
            state.done | (state.steps >= most_steps) | (state.lost >= MAX_LOST_STEPS)
        )
        return hopes & ~ended

    state = lax.while_loop(unfinished, step, state)
    inverse = jnp.linalg.inv(state.here.information)
    scale, slope = state.here.scale, state.here.slope
    covariance = inverse * scale[:, None] * scale[None, :]
    left = slope @ inverse @ slope
    y = jnp.where(state.done, state.tried, state.y)
    ended = state.done | (state.lost >= MAX_LOST_STEPS)
    size = jnp.linalg.slogdet(covariance)[1]
    return Optimum(y, covariance, ended | (left < KINK_SD**2), state.here.cost, size)


def _slope(misfit: Misfit, y, case: Case):
    """Return the slope of minus ln posterior."""
    apart, back = jax.vjp(lambda y: misfit(y, case), y)
    return back(apart)[0]


def _settled(misfit: Misfit, found: Optimum, case: Case):
    """Return an optimum, its cost and size, differentiated as an implicit function."""

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
        # the full Hessian: that of Gauss and Newton lacks the residuals' curvature, and
        # the derivative would be wrong where the model does not fit
        bend = jax.jacfwd(lambda y: _slope(misfit, y, case))(y)
        there = -jnp.linalg.solve(bend, moved[:, None])[:, 0]
        # at an optimum the cost has no slope by the unknowns, so only the record
        # changes it; the width of the posterior changes by both
        _, dearer = jax.jvp(
            lambda case: 0.5 * jnp.sum(jnp.square(misfit(y, case))), (case,), (moves,)
        )
        _, wider = jax.jvp(size_at, (y, case), (there, moves))
        return primals[:3], (there, dearer, wider)

    return settled(found.y, found.cost, found.size, case)
