"""Some records picked together, in the units of the fit; times in samples."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from jblast.inference.picks.fit.model import data_misfit, drift_at, misfit, readings
from jblast.inference.picks.fit.optimum import Optimum, optimum_of
from jblast.inference.picks.fit.posterior import values_of
from jblast.inference.picks.fit.signs import NEAREST, signs_in
from jblast.inference.picks.ready.bins import Bins, bins_about_front
from jblast.inference.picks.ready.case import Case, prepared
from jblast.inference.picks.ready.start import Bank, bank_of
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
        count: Samples of each record; the last of them repeats behind it.
        high_pass: Corner of a first-order high-pass [1/sample]; None: there is none.
    """
    bins = bins_about_front(samples.shape[1])
    picked = partial(_picked, bins, bank_of(bins, samples.shape[1]))
    # one by one: what is thousands of samples long stays in the cache of a core, and no
    # search waits for another's
    return lax.map(lambda one: picked(*one), (samples, clipped, count, high_pass))


def _picked(
    bins: Bins,
    bank: Bank,
    samples: Float[Array, " sample"],
    clipped: Float[Array, " sample"],
    count: Int[Array, ""],
    high_pass: Float[Array, ""] | None,
) -> LanePicks:
    """Pick one record, as `pick_lanes` does."""
    of_one = prepared(bins, bank, samples, clipped, count, high_pass)
    ready = jax.tree.map(lambda x: x[None], of_one)
    one = optimum_of(partial(misfit, bins), ready.start, ready.case)
    best, case = with_what_shows(bins, one, ready.start, ready.case)
    apart = jax.vmap(partial(misfit, bins))(best.y, case)
    freedom = jnp.maximum(jax.vmap(readings)(case) - float(CENTRE.size), 1.0)
    ratio = jax.vmap(partial(data_misfit, bins=bins.first.size))(apart) / freedom
    widened = jnp.maximum(ratio, 1.0)
    natural, covariance = jax.vmap(values_of)(best.y, best.covariance, widened)
    x = (natural.arrival - case.middle) / case.span
    level = jax.vmap(drift_at)(best.y, x)
    moved = jax.vmap(drift_at)(best.y, jnp.ones_like(x))
    moved = moved - jax.vmap(drift_at)(best.y, -jnp.ones_like(x))
    drift = jnp.maximum(jnp.abs(moved), jnp.abs(best.y[:, 9]))
    held, low = jnp.any(clipped > 0)[None], jnp.any(clipped < 0)[None]
    seen = LEAST_SIGNAL * jnp.sqrt(covariance[:, 1, 1]) < 1.0
    left = (count - ready.front.sample).astype(samples.dtype)
    lag = jnp.exp(best.y[:, LAG])
    later_variance = (
        best.covariance[:, 0, 0]
        + 2.0 * lag * best.covariance[:, 0, LAG]
        + lag * lag * best.covariance[:, LAG, LAG]
    )
    lanes = LanePicks(
        natural=natural,
        covariance=covariance,
        front=ready.front.sample,
        offset=ready.offset,
        scale=ready.scale,
        level=level,
        noise=case.noise.marginal,
        noise_known=case.noise.known,
        clipped=held,
        clipped_low=low,
        clipped_level=ready.clipped_at,
        converged=best.converged,
        found=jnp.isfinite(covariance[:, 1, 1]) & (seen | held),
        drifting=drift > 0.02 * natural.peak,
        cut_short=natural.arrival + natural.duration > left,
        misfit=ratio,
        rings=case.rings > 0,
        passed=case.passed > 0,
        frequency=jnp.exp(best.y[:, CENTRE.size]),
        later=jnp.where(case.follows > 0, natural.arrival + lag, jnp.nan),
        later_sd=jnp.sqrt(widened * later_variance),
    )
    return jax.tree.map(lambda x: x[0], lanes)


def with_what_shows(
    bins: Bins, one: Optimum, start: Float[Array, "lane unknown"], case: Case
) -> tuple[Optimum, Case]:
    """Return the optima with a ring, a further front or a high-pass where one shows.

    Each is tried where there is a sign of it in any record of the lanes, and of those
    that raise ln posterior by `BETTER` the best is taken.
    """
    of_record = jax.vmap(partial(misfit, bins))
    apart = of_record(one.y, case)
    signs = lax.stop_gradient(
        jax.vmap(partial(signs_in, bins))(
            apart[:, : bins.first.size], case, jax.vmap(natural_of)(one.y)
        )
    )
    none = jnp.zeros_like(signs.rings)
    centre = _beside(case.centre, signs.start)
    plain = case._replace(centre=centre)
    unmoved = Optimum(
        _beside(one.y, signs.start), _with_block(one.covariance), one.converged
    )

    def tried(best, hypothesis):
        asked, start = hypothesis
        more = plain._replace(rings=asked[0], follows=asked[1], passed=asked[2])
        shown = jnp.sum(asked, axis=0) > 0

        def anew():
            return optimum_of(partial(misfit, bins), start, more)

        found = lax.cond(jnp.any(shown), anew, lambda: unmoved)
        cost = _cost(of_record(lax.stop_gradient(found.y), more))
        # a further front within the first one's rise is only a rise of another form
        rise = jax.vmap(natural_of)(found.y).rise
        apart = jnp.exp(found.y[:, LAG]) > NEAREST + 2.0 * rise
        taken = shown & (cost < best[0]) & (apart | (more.follows == 0))

        def chosen(new, old):
            return jnp.where(taken.reshape(-1, *[1] * (new.ndim - 1)), new, old)

        return jax.tree.map(chosen, (cost, found, more), best), None

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
    afresh = _beside(start, signs.start)
    starts = jnp.stack([afresh, afresh, unmoved.y, unmoved.y])
    (_, found, chosen_case), _ = lax.scan(tried, best, (asked, starts))
    return found, chosen_case


def _cost(apart: Float[Array, "lane term"]) -> Float[Array, " lane"]:
    """Return minus ln posterior."""
    return 0.5 * jnp.sum(apart * apart, axis=1)


def _beside(first, second):
    """Return unknowns and further ones."""
    return jnp.concatenate([first, second], axis=1)


def _with_block(covariance: Float[Array, "lane unknown unknown"]):
    """Return a covariance with further unknowns, of which nothing is known."""
    more = FURTHER_CENTRE.size
    wider = jnp.pad(covariance, [(0, 0), (0, more), (0, more)])
    n = covariance.shape[1]
    index = jnp.arange(n, n + more)
    return wider.at[:, index, index].set(1.0)
