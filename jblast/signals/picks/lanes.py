"""The fit of a batch of records, with times in samples and pressures as shares.

Each record is prepared and fitted by one pulse, by its forms and by further hypotheses.
A record that the model does not fit is fitted again over a shorter interval, or by its
front alone.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from jblast.signals.picks.forms import with_forms
from jblast.signals.picks.hypotheses import (
    BASELINE_SHIFT,
    LN_LAG,
    unstated_high_pass,
    with_further_effects,
)
from jblast.signals.picks.model import Optimum, drift_at, larger_misfit_ratio
from jblast.signals.picks.preparation import (
    FITTED_DURATIONS,
    LEAST_REACH,
    SHORTER_SHARE,
    Bins,
    Prepared,
    bank_of,
    bins_about_front,
    prepared,
)
from jblast.signals.picks.searches import LEAST_SHARE, first_optimum, select
from jblast.signals.picks.unknowns import (
    CENTRE,
    Form,
    Natural,
    error_covariance,
    values_of,
)

LEAST_SIGNAL = 5.0
"""Smallest peak of a detected pulse, in its standard deviations. Noise alone exceeds it
in 1 of 3 million records at one arrival, in about 1 of 1,000 over all arrivals."""
BASELINE_BEND = 0.03
"""Bend of the baseline from which on a record is marked as curved [share of the peak].
Such a baseline may not be the cubic that the fit assumes: durations of textbook pulses
with a long tail were off by 6 to 30 standard deviations."""
MISFIT_AGAIN = 3.0
"""Squared misfit above which the model does not hold: the pick is doubtful, and the
record is fitted again over a shorter interval."""
HOPELESS_MISFIT = 30.0
"""Squared misfit above which the model explains next to nothing: residuals are more
than five times the noise. The record is fitted again with its flat top as bounds and by
its front alone."""
FLAT_TOP_SD = 6.0
"""Depth of a flat top below the largest sample, in standard deviations of the noise:
about the range of thousands of samples of noise about one level."""
FRONT_PARTS = 8.0, 32.0
"""Ratios of the fitted interval to those of the fits of the front alone. These end at a
half and a seventh of the positive phase, and leave out any disturbance behind it."""
SLIGHT_RESIDUAL = 1e-3
"""Root mean square residual, over the peak, that is accepted whatever the misfit. In a
record with hardly any noise a ground tremor before the front is a hundred standard
deviations, but changes no value of the pick."""
STEP_LEVEL, STEP_SAMPLES = 0.5, 16
"""A record is a step, not a pulse, if the mean of its last 16 samples is above half of
its largest sample: a step that stays, or a decay too short to be distinguished from
one."""


class LanePicks(NamedTuple):
    """Picks in samples and in the record's unit; see `Pick`."""

    natural: Natural
    covariance: Float[Array, "lane 8 8"]
    front: Int[Array, " lane"]
    offset: Float[Array, " lane"]
    scale: Float[Array, " lane"]
    level: Float[Array, " lane"]
    noise: Float[Array, " lane"]
    noise_known: Bool[Array, " lane"]
    clipped: Bool[Array, " lane"]
    clipped_low: Bool[Array, " lane"]
    clipped_level: Float[Array, " lane"]
    converged: Bool[Array, " lane"]
    found: Bool[Array, " lane"]
    drifting: Bool[Array, " lane"]
    curving: Bool[Array, " lane"]
    cut_short: Bool[Array, " lane"]
    misfit: Float[Array, " lane"]
    rings: Bool[Array, " lane"]
    passed: Bool[Array, " lane"]
    shifted: Bool[Array, " lane"]
    front_alone: Bool[Array, " lane"]
    form: Form
    frequency: Float[Array, " lane"]
    later: Float[Array, " lane"]
    later_sd: Float[Array, " lane"]


def pick_lanes(
    samples: Float[Array, "lane sample"],
    clipped: Float[Array, "lane sample"],
    count: Int[Array, " lane"],
    high_pass: Float[Array, " lane"] | None = None,
) -> LanePicks:
    """Pick records of one length.

    Args:
        samples: Overpressure in any unit, finite.
        clipped: +1 where a sample is a lower bound, -1 an upper one, else 0.
        count: Samples of each record, whose last one is repeated behind it. A lane
            without samples is skipped.
        high_pass: Corner of a first-order high-pass [1/sample]; None: there is none.
    """
    bins = bins_about_front(samples.shape[1])
    bank = bank_of(bins, samples.shape[1])

    def over(attempt, longest, until, samples, clipped, count, high_pass):
        flat = _flat_top(samples, count, attempt.sigma)
        clipped = jnp.where(attempt.flat, jnp.maximum(clipped, flat), clipped)
        last = jnp.minimum(until, count)
        index = jnp.arange(samples.shape[0])
        # samples behind the front alone must not be in the search for a start, either
        cut = jnp.where((index < last) | (until >= count), samples, samples[0])
        ready = prepared(bins, bank, cut, clipped, last, high_pass, longest)
        # a front alone has no tail, so its net impulse is no sign of a high-pass
        off = jnp.where(until < count, jnp.inf, ready.net)
        ready = ready._replace(
            net=off, net_sd=jnp.where(until < count, 0.0, ready.net_sd)
        )
        duration = jnp.exp(lax.stop_gradient(ready.start[2]))
        found = _picked(bins, ready, clipped, count)
        ends = (index >= count - STEP_SAMPLES) & (index < count)
        end = (
            jnp.sum(jnp.where(ends, samples, 0.0)) / float(STEP_SAMPLES) - ready.offset
        )
        found = found._replace(
            found=found.found & ~(end > STEP_LEVEL * ready.scale),
            front_alone=until < count,
        )
        return found, duration

    # traced once for both its results and their shapes
    @jax.jit
    def picked(*record):
        kind, count = samples.dtype, record[2]
        longest = jnp.full((), jnp.inf, kind)
        first = _Attempt(jnp.asarray(False), jnp.ones((), kind), longest)
        shapes, _ = jax.eval_shape(over, first, longest, count, *record)
        nothing = jax.tree.map(lambda of: jnp.zeros(of.shape, of.dtype), shapes)
        nothing = nothing._replace(misfit=jnp.full_like(nothing.misfit, jnp.inf))

        def tried(best, attempt):
            longest, reach, before = best
            odd = ~(before.misfit < MISFIT_AGAIN) | ~before.converged
            left = jnp.sqrt(before.misfit) * before.noise
            slight = left < SLIGHT_RESIDUAL * before.natural.peak
            flawed = attempt.flat | (attempt.part > 0)
            holds = slight | (before.misfit < HOPELESS_MISFIT)
            odd &= ~(flawed & before.converged & holds)

            def refitted():
                sigma = before.noise * before.scale
                part = jnp.maximum(reach * attempt.part, 0.5 * LEAST_REACH)
                near = before.front + part.astype(count.dtype)
                until = jnp.where(attempt.part > 0, near, count)
                mine = attempt._replace(sigma=sigma)
                most = jnp.where(flawed, jnp.inf, longest)
                found, duration = over(mine, most, until, *record)
                better = ~(before.misfit < found.misfit)
                fits = found.found & found.converged & (found.misfit < MISFIT_AGAIN)
                better = jnp.where(flawed, fits, better)
                chosen = select(better, found, before)
                first = jnp.where(
                    jnp.isinf(longest), FITTED_DURATIONS * duration, reach
                )
                return SHORTER_SHARE * duration, first, chosen

            return lax.cond(odd, refitted, lambda: (longest, reach, before)), None

        # a drift larger than the pulse may be fitted as one, so the second attempt
        # looks for a shorter pulse; the attempts by flat top and front alone keep what
        # comes before a disturbance
        parts = jnp.asarray(
            [0.0, 0.0, 0.0, *(1.0 / part for part in FRONT_PARTS)], kind
        )
        flats = jnp.asarray([False, False, True, *(False for _ in FRONT_PARTS)])
        attempts = _Attempt(flats, jnp.zeros_like(parts), parts)
        begin = (longest, jnp.zeros((), kind), nothing)
        (_, _, found), _ = lax.scan(tried, begin, attempts)
        return found

    def one(record):
        shapes = jax.eval_shape(picked, *record)
        nothing = jax.tree.map(lambda of: jnp.zeros(of.shape, of.dtype), shapes)
        return lax.cond(record[2] > 0, lambda: picked(*record), lambda: nothing)

    # one record at a time: thousands of samples stay in the cache of a core, and no
    # search waits for the slowest of a batch, as under vmap
    return lax.map(one, (samples, clipped, count, high_pass))


class _Attempt(NamedTuple):
    """One of several attempts at a record.

    Attributes:
        flat: True if the flat top is treated as clipped.
        sigma: Standard deviation of the noise, in the record's unit.
        part: Fitted share of the interval; 0 for all of it.
    """

    flat: Bool[Array, ""]
    sigma: Float[Array, ""]
    part: Float[Array, ""]


def _flat_top(samples, count, sigma):
    """Return 1 for the samples of a flat top, else 0."""
    inside = jnp.arange(samples.shape[0]) < count
    top = jnp.max(jnp.where(inside, samples, -jnp.inf))
    # the largest samples of noise alone are no flat top
    high = top - samples[0] > 2.0 * FLAT_TOP_SD * sigma
    return (inside & high & (samples > top - FLAT_TOP_SD * sigma)).astype(samples.dtype)


def _picked(
    bins: Bins,
    ready: Prepared,
    clipped: Float[Array, " sample"],
    count: Int[Array, ""],
) -> LanePicks:
    """Pick a prepared record, as `pick_lanes` does."""
    one, others = first_optimum(bins, ready)
    formed = with_forms(bins, one, ready.continued, ready.case)
    shown = with_further_effects(bins, one, formed, ready.start, ready.case)
    passed = unstated_high_pass(bins, ready, formed, shown)
    plain = shown.case.rings + shown.case.follows + shown.case.passed
    plain = ~passed.probable & (plain + shown.case.shifted == 0)
    best, case = passed.chosen(shown)
    ratio = larger_misfit_ratio(bins, best.y, case)
    widened = jnp.maximum(ratio, 1.0)
    # two rivals compete for the first place: the larger share of the posterior counts
    rivals = others.y
    shares = jnp.where(plain, lax.stop_gradient(formed.cubic) * others.share, 0.0)
    more = shown.share > shares[0]
    rivals = rivals.at[0].set(jnp.where(more, shown.rival, rivals[0]))
    shares = shares.at[0].set(jnp.maximum(shares[0], shown.share))
    # the fit with or without a high-pass is a rival, too: they differ in duration
    other = jnp.where(passed.probable, shown.best.y, passed.found.y)
    share = jnp.where(passed.probable, 1.0 - passed.share, passed.share)
    share = jnp.where(share > LEAST_SHARE, share, 0.0)
    rivals = jnp.concatenate([rivals, other[None, : rivals.shape[1]]])
    shares = jnp.concatenate([shares, share[None]])
    within, between, offset = jax.tree.map(
        lambda mean, own: jnp.where(plain, mean, own),
        (formed.within, formed.between, formed.offset),
        (
            error_covariance(best.y, best.covariance, case.form),
            jnp.where(passed.probable, formed.front_between, 0.0),
            jnp.where(passed.probable, formed.front_offset, 0.0),
        ),
    )
    average = widened * within + between
    natural, covariance = values_of(best.y, case.form, offset, average, rivals, shares)
    x = (natural.arrival - case.middle) / case.span
    one_way = drift_at(best.y, jnp.ones_like(x)) - drift_at(best.y, -jnp.ones_like(x))
    drift = jnp.maximum(jnp.abs(one_way), jnp.abs(best.y[9]))
    high, low = jnp.any(clipped > 0), jnp.any(clipped < 0)
    # the pulse must be significant by the error of the best hypothesis, by that of the
    # average over forms, and by that of the first form: of many forms one fits noise
    seen = LEAST_SIGNAL * jnp.sqrt(widened * best.covariance[1, 1]) < 1.0
    seen &= LEAST_SIGNAL * jnp.sqrt(average[1, 1]) < 1.0
    seen &= LEAST_SIGNAL * jnp.sqrt(one.covariance[1, 1]) < 1.0
    left = (count - ready.front.sample).astype(clipped.dtype)
    lag = jnp.exp(best.y[LN_LAG])
    later_variance = (
        best.covariance[0, 0]
        + 2.0 * lag * best.covariance[0, LN_LAG]
        + lag * lag * best.covariance[LN_LAG, LN_LAG]
    )
    return LanePicks(
        natural=natural,
        covariance=covariance,
        front=ready.front.sample,
        offset=ready.offset,
        scale=ready.scale,
        level=drift_at(best.y, x),
        noise=case.noise.marginal,
        noise_known=case.noise.known,
        clipped=high,
        clipped_low=low,
        clipped_level=ready.clipped_at,
        converged=best.converged,
        found=jnp.isfinite(covariance[1, 1]) & (seen | high),
        drifting=drift > BASELINE_SHIFT * natural.peak,
        curving=_curving(best, natural.peak),
        cut_short=natural.arrival + natural.duration > left,
        misfit=ratio,
        rings=case.rings > 0,
        passed=case.passed > 0,
        shifted=case.shifted > 0,
        front_alone=jnp.zeros_like(high),
        form=case.form,
        frequency=jnp.exp(best.y[CENTRE.size]),
        later=jnp.where(case.follows > 0, natural.arrival + lag, jnp.nan),
        later_sd=jnp.sqrt(widened * later_variance),
    )


def _curving(best: Optimum, peak: Float[Array, ""]) -> Bool[Array, ""]:
    """Return whether a baseline bends significantly and by much of the peak."""
    # only bends of four standard deviations count: noise bends long intervals, too
    bends = jnp.square(best.y[9:11])
    sure = 16.0 * jnp.diagonal(best.covariance)[9:11]
    seen = jnp.where(bends > sure, bends, 0.0)
    return jnp.sum(seen) > jnp.square(BASELINE_BEND * peak)
