r"""One pulse by several formulas, averaged by their evidence.

Records have rises and negative phases of several forms, and a fit of one form has
biased times for the others. The optimum with the cubic negative phase is followed by
those of a half-sine, a triangle and Friedlander's formula continued; then, with the
best of them, by those of a smoother, a linear and an exponential rise. A smooth rise
(of either polynomial), a linear one (up to the decay or times it) and an exponential
one are equally probable a priori, so are the negative phases, and all have the same
priors. The weight of a form is its prior times its evidence by Laplace's approximation,

$$w_k \propto \pi_k \, e^{-c_k/\rho} \, |C_k|^{1/2},$$

with $c_k$ minus ln posterior at the optimum, $C_k$ its covariance and $\rho$ the
squared misfit of the best form where that is above 1: where no form fits, none is
certain. A rise changes the front and a negative phase what follows, so both averages
are independent: means and covariances add up (Hoeting et al. 1999, "Bayesian model
averaging: a tutorial").

A sample may be a mean over its time or the pressure at an instant. The mean adds 1/12
of a squared sample to the variance in time of a front, which a fit subtracts from the
rise: for instantaneous samples the rise is longer and begins earlier. Both are equally
probable.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float

from jblast.signals.picks.model import Optimum, misfit, optimum_of
from jblast.signals.picks.preparation import Bins, Case
from jblast.signals.picks.searches import select
from jblast.signals.picks.unknowns import (
    CONCAVE,
    CONTINUED,
    CUBIC,
    EXPONENTIAL,
    HALF_SINE,
    LINEAR,
    NEGATIVES,
    RISEN,
    RISES,
    SMOOTH,
    SMOOTHER,
    TRIANGLE,
    Form,
    error_covariance,
    free_rise,
    in_error_units,
    natural_of,
    unresolved,
)

RESOLVED_RISE = 0.8
"""Shortest rise whose form the samples resolve [samples]. Below it the polynomial
rises are not fitted: their means over samples of such a front are nearly equal. The
exponential rise is fitted always, since it also lowers the peak."""
RISE_SPREADS = np.sqrt([1.0 / 20.0, 1.0 / 28.0, 1.0 / 12.0, 1.0 / 12.0, 1.0 / RISEN**2])
"""Standard deviation in time of the slope of each of `RISES` [rises]."""
RISE_CENTRES = np.array([0.5, 0.5, 0.5, 0.5, 1.0 / RISEN])
"""Mean time of that slope [rises]."""
RISE_PRIOR = np.array([1.0, 1.0, 1.0, 1.0, 2.0]) / 6.0
"""Prior of the rises: smooth, linear and exponential are equally probable, and the
first two have two forms each."""
NEGATIVE_PRIOR = np.full(4, 0.25)
"""Prior of the four negative phases, equally probable."""
OTHER_FORMS_SD = 0.02
"""Standard deviation of arrival and time of the peak due to forms that are not fitted
[rises]: the start of half a cosine, fitted by a cubic of equal spread, is off by 0.013.
Coverage of such rises: rows `cosine` and `Gaussian` of
`calibration/results/pulse_forms.txt`."""
APERTURE_VARIANCE = 1.0 / 12.0
"""Variance in time of the mean over a sample [samples^2]: that of a uniform density."""
FIRST_OTHER_RISE = 3
"""Index of the first form of `FORMS` with another rise."""
LONGEST_RISE = 0.5
"""Largest rise of a start, as a share of the positive phase: a front that takes more
than half of it has no decay left to fit."""
FORMS = (
    *((SMOOTH, HALF_SINE), (SMOOTH, TRIANGLE), (SMOOTH, CONTINUED)),
    *((SMOOTHER, None), (LINEAR, None), (CONCAVE, None), (EXPONENTIAL, None)),
)
"""Forms that follow the smooth rise with the cubic negative phase; None: the negative
phase with the best evidence."""


class Formed(NamedTuple):
    """The best form of a pulse, and the average over all forms.

    Attributes:
        best: Optimum of the best form.
        case: The record with that form.
        offset: Mean of the values over all forms minus those of the best one, in the
            order of `pick.NAMES` and in the units of their errors.
        within: Mean covariance of the values.
        between: Covariance of the values between forms.
        cubic: Weight of the cubic negative phase.
        front_offset: The offset of the rises alone.
        front_between: Covariance between rises, including the sampling (mean or
            instant).
    """

    best: Optimum
    case: Case
    offset: Float[Array, "8"]
    within: Float[Array, "8 8"]
    between: Float[Array, "8 8"]
    cubic: Float[Array, ""]
    front_offset: Float[Array, "8"]
    front_between: Float[Array, "8 8"]


def with_forms(
    bins: Bins, one: Optimum, continued: Float[Array, " unknown"], case: Case
) -> Formed:
    """Return the pulse averaged over forms.

    Args:
        bins: Bins of the record.
        one: Optimum of a smooth rise and a cubic negative phase.
        continued: Starting point of a pulse that continues below zero.
        case: The record.
    """
    of, kind = partial(misfit, bins), one.y.dtype
    rises = jnp.asarray([rise for rise, _ in FORMS], kind)
    negatives = jnp.asarray(
        [-1 if negative is None else negative for _, negative in FORMS], kind
    )
    spreads, centres = jnp.asarray(RISE_SPREADS, kind), jnp.asarray(RISE_CENTRES, kind)
    # the optimum has located the front already: the second start of a continued pulse
    # takes arrival and rise from it, the rest from the bank
    other = continued.at[0].set(one.y[0]).at[4].set(one.y[4])
    resolved = lax.stop_gradient(natural_of(one.y).rise > RESOLVED_RISE)

    def fitted(tail, form):
        """Fit one form; `tail` holds the best negative phase of those before."""
        best, negative = tail
        rise, given = form
        front = rise > SMOOTH
        mine = Form(rise, jnp.where(front, negative, given))
        y = jnp.where(front, best.y, one.y)
        here = natural_of(y)
        number = rise.astype(int)
        # a start of equal centre and spread in time: the samples constrain these two
        # moments of a rise first, whatever its form
        time = here.rise * spreads[SMOOTH] / spreads[number]
        time = jnp.minimum(time, LONGEST_RISE * here.duration)
        moved = 0.5 * here.rise - centres[number] * time
        risen = y.at[0].add(moved).at[4].set(jnp.log(free_rise(time, here.duration)))
        this = case._replace(form=mine)
        near, far = (0.5 * jnp.sum(jnp.square(of(x, this))) for x in (y, other))
        farther = (mine.negative == CONTINUED) & ~front & ~(near <= far)
        start = jnp.where(front, risen, jnp.where(farther, other, y))
        none = best._replace(converged=jnp.asarray(False))
        # an exponential rise shorter than a sample still lowers the peak, so it is
        # fitted whether the rise is resolved or not
        idle = front & ~resolved & (rise < EXPONENTIAL)
        found = lax.cond(idle, lambda: none, lambda: optimum_of(of, start, this))
        better = ~front & (_level(found) > _level(best))
        tail = select(better, (found, given), (best, negative))
        return tail, found

    begin = (one, jnp.full((), CUBIC, kind))
    (best, negative), found = lax.scan(fitted, begin, (rises, negatives))
    tails = _stacked(one, jax.tree.map(lambda x: x[:FIRST_OTHER_RISE], found))
    fronts = _stacked(best, jax.tree.map(lambda x: x[FIRST_OTHER_RISE:], found))
    weights = _weights(tails, case, NEGATIVE_PRIOR)
    shares = _weights(fronts, case, RISE_PRIOR)
    every = jnp.asarray(NEGATIVES, kind)
    each = jnp.asarray(RISES, kind)
    tail = jnp.argmax(every == negative)
    head = jnp.argmax(lax.stop_gradient(shares))
    chosen = jax.tree.map(lambda x: x[head], fronts)

    def moments(rise, negative, optimum):
        mine = Form(rise, negative)
        values = in_error_units(optimum.y, mine)
        covariance = error_covariance(optimum.y, optimum.covariance, mine)
        # a fit of sample means subtracts the aperture's variance from the rise; for
        # instantaneous samples the rise is longer by it and begins earlier
        number = rise.astype(int)
        time = jnp.exp(values[5])
        longer = jnp.sqrt(time * time + APERTURE_VARIANCE / jnp.square(spreads[number]))
        seen = 1.0 - unresolved(time)
        moved = -centres[number] * (longer - time)
        later = jnp.zeros_like(values).at[0].set(1.0).at[2].set(-jnp.exp(-values[2]))
        either_way = 0.5 * moved * later
        apart = lax.stop_gradient(either_way)
        spread = seen * apart[:, None] * apart[None, :]
        slope = (1.0 + values[4]) * jnp.exp(-values[2])
        height = jnp.zeros_like(values).at[1].set(slope)
        for beyond in (later, height):
            other = lax.stop_gradient(OTHER_FORMS_SD * time * beyond)
            spread = spread + other[:, None] * other[None, :]
        return values + seen * either_way, covariance, spread

    by_tail, wide, _ = jax.vmap(moments, in_axes=(None, 0, 0))(each[0], every, tails)
    by_front, tall, sampled = jax.vmap(moments, in_axes=(0, None, 0))(
        each, negative, fronts
    )
    mean, between = _moments(weights, by_tail, by_tail[tail])
    own = in_error_units(chosen.y, Form(each[head], negative))
    mean_front, between_front = _moments(shares, by_front, own)
    # the best negative phase was fitted with all rises, the others with the smooth one
    rest = weights.at[tail].set(0.0)
    within = weights[tail] * _mean_of(shares, tall)
    between_front = between_front + _mean_of(shares, sampled)
    return Formed(
        best=chosen,
        case=case._replace(form=Form(each[head], negative)),
        offset=mean + mean_front,
        within=within + _mean_of(rest, wide),
        between=between + between_front,
        cubic=weights[CUBIC],
        front_offset=mean_front,
        front_between=between_front,
    )


def _level(found: Optimum) -> Float[Array, ""]:
    """Return the ln evidence of a form, up to a constant common to all."""
    level = lax.stop_gradient(0.5 * found.size - found.cost)
    good = found.converged & jnp.isfinite(level)
    return jnp.where(good, level, -jnp.inf)


def _stacked(first: Optimum, others: Optimum) -> Optimum:
    """Return optima along one axis."""
    return jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), first, others)


def _weights(
    found: Optimum, case: Case, prior: Float[np.ndarray, " form"]
) -> Float[Array, " form"]:
    """Return the weights of forms."""
    still = lax.stop_gradient(found)
    many = jnp.maximum(jnp.sum((case.weight > 0).astype(still.cost.dtype)), 1.0)
    good = still.converged & jnp.isfinite(still.cost) & jnp.isfinite(still.size)
    # softmax over minus infinities alone is NaN, so the first form always counts
    good = good.at[0].set(True)
    cost = jnp.where(good, found.cost, 0.0)
    # not inside stop_gradient: without the slope of the tempering, 2 of 32 records
    # disagreed with finite differences
    widened = jnp.maximum(2.0 * jnp.min(jnp.where(good, cost, jnp.inf)) / many, 1.0)
    size = jnp.where(good & jnp.isfinite(still.size), found.size, 0.0)
    level = 0.5 * size - cost / widened
    level = level + jnp.asarray(np.log(prior), level.dtype)
    return jax.nn.softmax(jnp.where(good, level, -jnp.inf))


def _mean_of(weights, matrices):
    """Return the weighted sum of matrices; those of zero weight may be infinite."""
    # zero times infinity is NaN: forms that failed are masked before the sum
    some = weights[:, None, None] > 0
    return jnp.einsum("k,kij->ij", weights, jnp.where(some, matrices, 0.0))


def _moments(weights, values, best):
    """Return the mean of values over forms, minus the best, and the covariance."""
    off = jnp.where(weights[:, None] > 0, values - best[None, :], 0.0)
    # noise may make the suction negative, and a mean of logarithms of sizes of both
    # signs has no meaning: suction and its duration are those of the best form
    mean = (weights @ off).at[6:].set(0.0)
    apart = off - mean[None, :]
    return mean, (weights[:, None] * apart).T @ apart
