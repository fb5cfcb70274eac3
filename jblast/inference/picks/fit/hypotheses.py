"""What a record holds besides one pulse."""

from functools import partial
from typing import NamedTuple

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from jblast.inference.picks.fit.forms import RESOLVED, Formed
from jblast.inference.picks.fit.model import drift_at, misfit
from jblast.inference.picks.fit.one_pulse import LEAST_SHARE
from jblast.inference.picks.fit.optimum import Optimum, optimum_of
from jblast.inference.picks.fit.searches import cost_of, either
from jblast.inference.picks.fit.signs import FREQUENCIES, NEAREST, ODD, signs_in
from jblast.inference.picks.fit.trials import (
    OMEGA,
    Hidden,
    best_ring,
    hidden_ring,
)
from jblast.inference.picks.ready.bins import Bins
from jblast.inference.picks.ready.case import Case
from jblast.inference.picks.unknowns import (
    CENTRE,
    FURTHER_CENTRE,
    PULSE_UNKNOWNS,
    natural_of,
)

LAG = CENTRE.size + 2
"""Place of ln lag among the unknowns."""

BETTER = 15.0
"""A further front, a high-pass or a step of the baseline is there if it raises ln
posterior by as much."""

SHIFT = 0.02
"""Share of the peak by which the baseline moves, from which on a step is tried; as much
makes a record drift."""

RING = 7.0
"""And a ring: ln of the odds against one, 3, and of what is lost by frequency and
damping being looked for, about 6. Sensors ring more often than pulses are followed."""

HIDES = 1.0
"""Gain in ln posterior of a trial from which on a slow front may hide a ring: a search
gains some more, and it has to be as much as `RING`."""

QUIET = 5.0
"""Power of an oscillation from which on a ring that a slow front may hide is looked for
where it is seen, too: noise has it in one record in four."""

HIGHEST = 1.05 * FREQUENCIES[-1]
"""A ring above it [rad/sample] is a rise of another form."""

FURTHER_STEPS = 60
"""Most of a search for a ring or a further front: from a good start a dozen are
enough."""


class Shown(NamedTuple):
    """What a record holds besides one pulse.

    Attributes:
        best: Its optimum.
        case: The record, with what is in it.
        rival: Unknowns of the pulse with a ring, if there is none, else without.
        share: What these have of the posterior.
    """

    best: Optimum
    case: Case
    rival: Float[Array, " plain"]
    share: Float[Array, ""]


def with_what_shows(
    bins: Bins,
    one: Optimum,
    formed: Formed,
    start: Float[Array, " unknown"],
    case: Case,
) -> Shown:
    """Return the optimum with what shows: a ring, a further front and so on.

    Each is tried where there is a sign of it, and of those that raise ln posterior by
    `RING`, or `BETTER`, the best is taken. A further front and a high-pass are tried
    with the best form of the pulse, which may be the best only for want of them, and
    with the smooth rise and the cubic negative phase; a step of the baseline with the
    former, a ring with the latter, of which its closed form is.

    Args:
        bins: Where the record is looked at.
        one: Optimum of one pulse, of a smooth rise and a cubic negative phase.
        formed: That of the best form.
        start: Where the search for the first began.
        case: The record.
    """
    best_form, mine = formed.best, formed.case
    apart = misfit(bins, best_form.y, mine)
    signs = lax.stop_gradient(
        signs_in(bins, apart[: bins.first.size], mine, natural_of(best_form.y))
    )
    none, alone = jnp.zeros_like(signs.rings), lax.stop_gradient(cost_of(apart))
    plain = mine._replace(centre=jnp.concatenate([case.centre, signs.start]))
    simple = plain._replace(form=case.form)
    unmoved = Optimum(
        jnp.concatenate([best_form.y, signs.start]),
        _with_block(best_form.covariance),
        best_form.converged,
        alone,
        lax.stop_gradient(best_form.size),
    )
    first = jnp.concatenate([one.y, signs.start])

    # a slow front makes a sensor ring little, and delays it all the same: what it does
    # to the rise may tell more than what rings behind
    slow = natural_of(one.y).rise > RESOLVED
    hidden = lax.cond(
        slow,
        lambda: hidden_ring(bins, one, first, simple._replace(rings=1.0 + none)),
        lambda: Hidden(-jnp.inf + none, first),
    )
    hides = hidden.gain - lax.stop_gradient(one.cost - alone) > HIDES
    oscillates = jnp.where(hides & (signs.power > QUIET), 1.0, signs.rings)
    bent = hides.astype(none.dtype)

    # with one that explains all there is, no other is asked for
    many = jnp.sum(case.weight > 0).astype(one.y.dtype)
    enough = 0.5 * many * (1.0 + ODD * jnp.sqrt(2.0 / jnp.maximum(many, 1.0)))

    def explains_more(case):
        return case.rings + case.follows + case.passed + case.shifted > 0

    def tried(carried, hypothesis):
        best, ring = carried
        asked, start, price, by_trial = hypothesis
        tested = either(asked[4] > 0, simple, plain)
        more = tested._replace(
            rings=asked[0], follows=asked[1], passed=asked[2], shifted=asked[3]
        )
        all_there_is = explains_more(best[2]) & best[1].converged & (best[0] < enough)
        shown = (jnp.sum(asked[:4]) > 0) & ~all_there_is

        def anew():
            of = partial(misfit, bins)
            begin = lax.cond(
                by_trial,
                lambda: best_ring(bins, start, more),
                lambda: start,
            )
            # a ring is believed to be where it is seen, or was tried with best success
            seen = more._replace(centre=more.centre.at[OMEGA].set(begin[OMEGA]))
            found = optimum_of(
                of, begin, seen, most_steps=FURTHER_STEPS, hopeless=alone
            )
            return found, found.cost + price, seen

        found, cost, more = lax.cond(
            shown, anew, lambda: (unmoved, jnp.inf + price, plain)
        )
        # a further front within the first one's rise is only a rise of another form
        apart = jnp.exp(found.y[LAG]) > NEAREST + 2.0 * natural_of(found.y).rise
        apart |= more.follows == 0
        heard = (more.rings == 0) | (jnp.exp(found.y[OMEGA]) < HIGHEST)
        taken = shown & (cost < best[0]) & apart & heard
        better = either(taken, (cost, found, more), best)
        rings = (more.rings > 0) & heard & (cost < ring[0])
        ring = either(rings, (cost, lax.stop_gradient(found.y)), ring)
        return (better, ring), None

    # of a baseline that moves: level before the front, and a step at it
    before, after = (drift_at(best_form.y, jnp.full_like(none, x)) for x in (-1, 1))
    peak = jnp.exp(best_form.y[1])
    moves = (jnp.abs(after - before) > SHIFT * peak).astype(none.dtype)
    level = unmoved.y.at[PULSE_UNKNOWNS : CENTRE.size].set(0.0)
    level = level.at[PULSE_UNKNOWNS].set(before).at[-1].set((after - before) / peak)
    yes = jnp.ones_like(none)
    asked = jnp.stack(
        [
            jnp.stack([none, none, signs.passed, none, yes]),
            jnp.stack([none, none, signs.passed, none, none]),
            jnp.stack([none, none, none, moves, none]),
            jnp.stack([bent, none, none, none, yes]),
            jnp.stack([oscillates, none, none, none, yes]),
            jnp.stack([oscillates, none, none, none, yes]),
            jnp.stack([none, signs.follows, none, none, yes]),
            jnp.stack([none, signs.follows, none, none, yes]),
            jnp.stack([none, signs.follows, none, none, none]),
        ]
    )
    prices = jnp.asarray([*[BETTER] * 3, *[RING] * 3, *[BETTER] * 3], alone.dtype)
    tries = jnp.asarray([*[False] * 4, True, True, *[False] * 3])
    # one pulse through a ring, or of two fronts, goes astray: begin before it did, too
    afresh = jnp.concatenate([start, signs.start])
    # what has one unknown comes first: a further front explains nearly anything
    starts = [first, unmoved.y, level, hidden.start, first, afresh, afresh, first]
    starts.append(unmoved.y)
    begin = (alone, unmoved, plain), (jnp.full_like(alone, jnp.inf), unmoved.y)
    (best, ring), _ = lax.scan(tried, begin, (asked, jnp.stack(starts), prices, tries))
    _, found, chosen = best
    # a sensor that may ring, or may not: either may have the right pulse
    odds = lax.stop_gradient(jnp.abs(ring[0] - alone))
    share = jnp.where(jnp.isfinite(odds), 1.0 / (1.0 + jnp.exp(odds)), 0.0)
    share = jnp.where(chosen.follows + chosen.passed + chosen.shifted > 0, 0.0, share)
    rival = jnp.where(
        chosen.rings > 0, lax.stop_gradient(best_form.y), ring[1][: CENTRE.size]
    )
    return Shown(found, chosen, rival, jnp.where(share > LEAST_SHARE, share, 0.0))


def _with_block(covariance: Float[Array, "unknown unknown"]):
    """Return a covariance with further unknowns, of which nothing is known."""
    n, more = covariance.shape[0], FURTHER_CENTRE.size
    index = jnp.arange(n, n + more)
    return jnp.pad(covariance, [(0, more), (0, more)]).at[index, index].set(1.0)
