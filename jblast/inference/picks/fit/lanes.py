"""Some records picked together, in the units of the fit; times in samples."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from jblast.inference.picks.fit.hypotheses import LAG, with_what_shows
from jblast.inference.picks.fit.model import drift_at, larger_misfit_ratio
from jblast.inference.picks.fit.one_pulse import first_optimum
from jblast.inference.picks.fit.optimum import Optimum
from jblast.inference.picks.fit.posterior import values_of
from jblast.inference.picks.ready.bins import Bins, bins_about_front
from jblast.inference.picks.ready.case import SHORTER, Prepared, prepared
from jblast.inference.picks.ready.start import bank_of
from jblast.inference.picks.unknowns import CENTRE, Natural

LEAST_SIGNAL = 5.0
"""A pulse is found where its peak is so many of its standard deviations."""


CURVED = 0.03
"""A baseline that bends by this share of the peak may do what no cubic does."""

AGAIN = 3.0
"""Squared misfit from which on a record is picked anew, over a shorter stretch."""


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
        count: Samples of each record; the last of them repeats behind it. A lane of
            none is passed over.
        high_pass: Corner of a first-order high-pass [1/sample]; None: there is none.
    """
    bins = bins_about_front(samples.shape[1])
    bank = bank_of(bins, samples.shape[1])

    def over(longest, samples, clipped, count, high_pass):
        ready = prepared(bins, bank, samples, clipped, count, high_pass, longest)
        duration = jnp.exp(lax.stop_gradient(ready.start[2]))
        return _picked(bins, ready, clipped, count), duration

    @jax.jit  # traced once, for what it gives and for the shape of that
    def picked(*record):
        longest = jnp.full((), jnp.inf, samples.dtype)
        shapes, _ = jax.eval_shape(over, longest, *record)
        nothing = jax.tree.map(lambda of: jnp.zeros(of.shape, of.dtype), shapes)
        nothing = nothing._replace(misfit=jnp.full_like(nothing.misfit, jnp.inf))

        def tried(best, _):
            longest, before = best
            odd = ~(before.misfit < AGAIN) | ~before.converged

            def anew():
                found, duration = over(longest, *record)
                better = ~(before.misfit < found.misfit)
                chosen = jax.tree.map(
                    lambda new, old: jnp.where(better, new, old), found, before
                )
                return SHORTER * duration, chosen

            return lax.cond(odd, anew, lambda: (longest, before)), None

        # a drift that is larger than the pulse is looked at as one: then look closer
        (_, found), _ = lax.scan(tried, (longest, nothing), length=2)
        return found

    def one(record):
        shapes = jax.eval_shape(picked, *record)
        nothing = jax.tree.map(lambda of: jnp.zeros(of.shape, of.dtype), shapes)
        return lax.cond(record[2] > 0, lambda: picked(*record), lambda: nothing)

    # one by one: what is thousands of samples long stays in the cache of a core, and no
    # search waits for another's
    return lax.map(one, (samples, clipped, count, high_pass))


def _picked(
    bins: Bins,
    ready: Prepared,
    clipped: Float[Array, " sample"],
    count: Int[Array, ""],
) -> LanePicks:
    """Pick a record that was made ready, as `pick_lanes` does."""
    one, others = first_optimum(bins, ready)
    shown = with_what_shows(bins, one, ready.start, ready.case)
    best, case = shown.best, shown.case
    ratio = larger_misfit_ratio(bins, best.y, case)
    widened = jnp.maximum(ratio, 1.0)
    plain = case.rings + case.follows + case.passed == 0
    # of two other optima the one that has more of the posterior
    rivals, shares = others.y, jnp.where(plain, others.share, 0.0)
    more = shown.share > shares[0]
    rivals = rivals.at[0].set(jnp.where(more, shown.rival, rivals[0]))
    shares = shares.at[0].set(jnp.maximum(shares[0], shown.share))
    natural, covariance = values_of(best.y, best.covariance, widened, rivals, shares)
    x = (natural.arrival - case.middle) / case.span
    one_way = drift_at(best.y, jnp.ones_like(x)) - drift_at(best.y, -jnp.ones_like(x))
    drift = jnp.maximum(jnp.abs(one_way), jnp.abs(best.y[9]))
    held, low = jnp.any(clipped > 0), jnp.any(clipped < 0)
    # by its own error: elsewhere, or through a ring, it is a pulse as well
    seen = LEAST_SIGNAL * jnp.sqrt(widened * best.covariance[1, 1]) < 1.0
    left = (count - ready.front.sample).astype(clipped.dtype)
    lag = jnp.exp(best.y[LAG])
    later_variance = (
        best.covariance[0, 0]
        + 2.0 * lag * best.covariance[0, LAG]
        + lag * lag * best.covariance[LAG, LAG]
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
        clipped=held,
        clipped_low=low,
        clipped_level=ready.clipped_at,
        converged=best.converged,
        found=jnp.isfinite(covariance[1, 1]) & (seen | held),
        drifting=drift > 0.02 * natural.peak,
        curving=_curving(best, natural.peak),
        cut_short=natural.arrival + natural.duration > left,
        misfit=ratio,
        rings=case.rings > 0,
        passed=case.passed > 0,
        frequency=jnp.exp(best.y[CENTRE.size]),
        later=jnp.where(case.follows > 0, natural.arrival + lag, jnp.nan),
        later_sd=jnp.sqrt(widened * later_variance),
    )


def _curving(best: Optimum, peak: Float[Array, ""]) -> Bool[Array, ""]:
    """Return whether a baseline bends, by much of the peak and for sure."""
    bends = jnp.square(best.y[9:11])
    sure = 16.0 * jnp.diagonal(best.covariance)[9:11]
    seen = jnp.where(bends > sure, bends, 0.0)
    return jnp.sum(seen) > jnp.square(CURVED * peak)
