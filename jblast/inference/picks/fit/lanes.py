"""Some records picked together, in the units of the fit; times in samples."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from jblast.inference.picks.fit.model import drift_at, misfit, misfit_ratio
from jblast.inference.picks.fit.optimum import Optimum, optimum_of
from jblast.inference.picks.fit.posterior import values_of
from jblast.inference.picks.fit.signs import NEAREST, signs_in
from jblast.inference.picks.ready.bins import Bins, bins_about_front
from jblast.inference.picks.ready.case import Case, Prepared, prepared
from jblast.inference.picks.ready.start import bank_of
from jblast.inference.picks.unknowns import CENTRE, FURTHER_CENTRE, Natural, natural_of
from jblast.kept_programs import kept

LEAST_SIGNAL = 5.0
"""A pulse is found where its peak is so many of its standard deviations."""

LAG = CENTRE.size + 2
"""Place of ln lag among the unknowns."""

BETTER = 15.0
"""A ring or a further front is there if it raises ln posterior by as much."""


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
    cut_short: Bool[Array, " lane"]
    misfit: Float[Array, " lane"]
    rings: Bool[Array, " lane"]
    passed: Bool[Array, " lane"]
    frequency: Float[Array, " lane"]
    later: Float[Array, " lane"]
    later_sd: Float[Array, " lane"]


@kept
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

    @jax.jit  # traced once, for what it gives and for the shape of that
    def picked(samples, clipped, count, high_pass):
        ready = prepared(bins, bank, samples, clipped, count, high_pass)
        return _picked(bins, ready, clipped, count)

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
    one = optimum_of(partial(misfit, bins), ready.start, ready.case)
    best, case = with_what_shows(bins, one, ready.start, ready.case)
    ratio = misfit_ratio(bins, best.y, case)
    widened = jnp.maximum(ratio, 1.0)
    natural, covariance = values_of(best.y, best.covariance, widened)
    x = (natural.arrival - case.middle) / case.span
    one_way = drift_at(best.y, jnp.ones_like(x)) - drift_at(best.y, -jnp.ones_like(x))
    drift = jnp.maximum(jnp.abs(one_way), jnp.abs(best.y[9]))
    held, low = jnp.any(clipped > 0), jnp.any(clipped < 0)
    seen = LEAST_SIGNAL * jnp.sqrt(covariance[1, 1]) < 1.0
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
        cut_short=natural.arrival + natural.duration > left,
        misfit=ratio,
        rings=case.rings > 0,
        passed=case.passed > 0,
        frequency=jnp.exp(best.y[CENTRE.size]),
        later=jnp.where(case.follows > 0, natural.arrival + lag, jnp.nan),
        later_sd=jnp.sqrt(widened * later_variance),
    )


def with_what_shows(
    bins: Bins, one: Optimum, start: Float[Array, " unknown"], case: Case
) -> tuple[Optimum, Case]:
    """Return the optimum with a ring, a further front or a high-pass if one shows.

    Each is tried where there is a sign of it, and of those that raise ln posterior by
    `BETTER` the best is taken.

    Args:
        bins: Where the record is looked at.
        one: Optimum of one pulse.
        start: Where its search began.
        case: The record.
    """
    apart = misfit(bins, one.y, case)
    signs = lax.stop_gradient(
        signs_in(bins, apart[: bins.first.size], case, natural_of(one.y))
    )
    none = jnp.zeros_like(signs.rings)
    plain = case._replace(centre=jnp.concatenate([case.centre, signs.start]))
    unmoved = Optimum(
        jnp.concatenate([one.y, signs.start]),
        _with_block(one.covariance),
        one.converged,
    )

    def tried(best, hypothesis):
        asked, start = hypothesis
        more = plain._replace(rings=asked[0], follows=asked[1], passed=asked[2])
        shown = jnp.sum(asked) > 0

        def anew():
            found = optimum_of(partial(misfit, bins), start, more)
            return found, _cost(misfit(bins, lax.stop_gradient(found.y), more))

        found, cost = lax.cond(shown, anew, lambda: (unmoved, best[0]))
        # a further front within the first one's rise is only a rise of another form
        apart = jnp.exp(found.y[LAG]) > NEAREST + 2.0 * natural_of(found.y).rise
        taken = shown & (cost < best[0]) & (apart | (more.follows == 0))
        better = jax.tree.map(
            lambda new, old: jnp.where(taken, new, old), (cost, found, more), best
        )
        return better, None

    asked = jnp.stack(
        [
            jnp.stack([signs.rings, none, none]),
            jnp.stack([none, signs.follows, none]),
            jnp.stack([none, signs.follows, none]),
            jnp.stack([none, none, signs.passed]),
        ]
    )
    best = (lax.stop_gradient(_cost(apart)) - BETTER, unmoved, plain)
    # one pulse through a ring, or of two fronts, goes astray: begin before it did, too
    afresh = jnp.concatenate([start, signs.start])
    starts = jnp.stack([afresh, afresh, unmoved.y, unmoved.y])
    (_, found, chosen), _ = lax.scan(tried, best, (asked, starts))
    return found, chosen


def _cost(apart: Float[Array, " term"]) -> Float[Array, ""]:
    """Return minus ln posterior."""
    return 0.5 * jnp.sum(apart * apart)


def _with_block(covariance: Float[Array, "unknown unknown"]):
    """Return a covariance with further unknowns, of which nothing is known."""
    n, more = covariance.shape[0], FURTHER_CENTRE.size
    index = jnp.arange(n, n + more)
    return jnp.pad(covariance, [(0, more), (0, more)]).at[index, index].set(1.0)
