r"""Hypotheses beyond one pulse: ringing, a later front, a baseline step, a high-pass.

The residuals of one pulse show signs of an oscillation of the sensor or of a further
front. A sign only begins another fit; a hypothesis is accepted by how much that fit
improves the posterior.

A high-pass whose corner was not stated shortens the positive phase and deepens the
suction, and another pulse may fit the result within noise: over the 4.5 durations of
the fit, a corner of $1/t_d$ and a deep suction look alike. But a high-pass of any order
leaves no net impulse, and its tail is as long as the pulse before it: a corner of
$1/t_d$ shortens the positive phase fivefold. A record whose net impulse may be zero is
therefore fitted over a longer stretch: with every negative phase and no high-pass, and
with the cubic and the continued one through a high-pass of first order (a high-pass of
second order, or an oscillation, has much the same effect). Both are equally probable a
priori, so the odds of a high-pass are the ratio of the largest evidence with it to that
without it, by Laplace's approximation, tempered as in `forms` where neither fits. Above
one, the record is reported as high-passed. Below one, the errors include the duration
that it would have with a high-pass.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float

from jblast.signals.picks.forms import RESOLVED, Formed
from jblast.signals.picks.model import Optimum, drift_at, misfit, optimum_of
from jblast.signals.picks.preparation import SINGLE_BEHIND, Bins, Case, Prepared
from jblast.signals.picks.searches import (
    LEAST_SHARE,
    OMEGA,
    Hidden,
    best_ring,
    cost_of,
    either,
    hidden_ring,
)
from jblast.signals.picks.unknowns import (
    CENTRE,
    CONTINUED,
    CUBIC,
    FURTHER,
    FURTHER_CENTRE,
    NEGATIVES,
    PULSE_UNKNOWNS,
    Form,
    Natural,
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
FREQUENCIES = np.linspace(0.08, 2.9, 96)
"""Looked at [rad/sample]."""
HIGHEST = 1.05 * FREQUENCIES[-1]
"""A ring above it [rad/sample] is a rise of another form."""
FURTHER_STEPS = 60
"""Most of a search for a ring or a further front: from a good start a dozen are
enough."""
LOUD = 9.5
"""Power of an oscillation [of white noise], which noise has once in 140 records."""
SHARP = 8.0
"""Standard deviations of a step."""
ODD = 4.0
"""Standard deviations of a squared misfit from which on one pulse is not all."""
CORNER = 0.3
"""Of a high-pass, times the duration of the positive phase, to begin with."""
SECOND_FRONT_SAMPLES = 4.0
"""Smallest distance of a further front behind the first, in addition to two rise times
[samples]."""
SIDES = (1, 2, 4, 8)
"""Bins on either side of a step."""
PLACE = CENTRE.size + FURTHER.index("ln_corner")
"""Of ln corner among the unknowns."""
SURE = 2.0
"""Standard deviations of the net impulse."""
NET = 0.3
"""Share of the positive impulse that the fit, whose drift is free, and the tail beyond
the stretch may leave of no net impulse; of a good record without a high-pass, one in
four has less."""
STARTS = ((0.3, 1.3), (1.0, 2.0), (1.0, 4.0), (2.0, 3.0))
"""Corners times the apparent duration to begin with [rad], and by how much the pulse
before the high-pass lasts longer."""
SUCTION = 0.1
"""Of that pulse, to begin with."""


class Shown(NamedTuple):
    """Optimum of a record with a ring, a further front and so on.

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
    # to the rise may show more than the ringing behind it
    slow = natural_of(one.y).rise > RESOLVED
    hidden = lax.cond(
        slow,
        lambda: hidden_ring(bins, one, first, simple._replace(rings=1.0 + none)),
        lambda: Hidden(-jnp.inf + none, first),
    )
    hides = hidden.gain - lax.stop_gradient(one.cost - alone) > HIDES
    oscillates = jnp.where(hides & (signs.power > QUIET), 1.0, signs.rings)
    bent = hides.astype(none.dtype)

    # with one that explains all there is, no other is tried
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
        apart = (
            jnp.exp(found.y[LAG])
            > SECOND_FRONT_SAMPLES + 2.0 * natural_of(found.y).rise
        )
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


class Signs(NamedTuple):
    """Signs of further effects in a record.

    Attributes:
        rings: 1: an oscillation; else 0.
        power: Of the loudest oscillation [of white noise].
        follows: 1: a further front; else 0.
        passed: 1: something that one pulse is not; else 0.
        start: Unknowns of all to begin with: see `FURTHER`.
    """

    rings: Float[Array, ""]
    power: Float[Array, ""]
    follows: Float[Array, ""]
    passed: Float[Array, ""]
    start: Float[Array, "7"]


def signs_in(
    bins: Bins, apart: Float[Array, " bin"], case: Case, natural: Natural
) -> Signs:
    """Return what may be in a record.

    Args:
        bins: Where it is looked at.
        apart: Whitened differences to one pulse.
        case: The record.
        natural: The pulse, in samples.
    """
    power, omega = _oscillation(bins, apart)
    step, lag, height = _step(bins, apart, case, natural.rise)
    count = jnp.sum((apart != 0).astype(apart.dtype))
    ratio = jnp.sum(apart * apart) / jnp.maximum(count - CENTRE.size, 1.0)
    odd = ratio > 1.0 + ODD * jnp.sqrt(2.0 / jnp.maximum(count, 1.0))
    rings = (power > LOUD) | odd
    start = [jnp.log(omega), np.log(0.05), jnp.log(lag), jnp.log(height), 0.0]
    start += [np.log(CORNER) - jnp.log(natural.duration), 0.0]
    kind = apart.dtype
    return Signs(
        rings.astype(kind),
        power,
        (step > SHARP).astype(kind),
        odd.astype(kind),
        jnp.stack([jnp.asarray(x).astype(kind) for x in start]),
    )


def _oscillation(bins: Bins, apart):
    """Return the power of the loudest oscillation behind the front, and its omega."""
    first = bins.single.start + int(np.argmax(bins.first[bins.single] >= 0))
    behind = apart[first : first + SINGLE_BEHIND]
    phases = FREQUENCIES[:, None] * np.arange(behind.shape[0])[None, :]
    real = jnp.asarray(np.cos(phases), apart.dtype) @ behind
    imaginary = jnp.asarray(np.sin(phases), apart.dtype) @ behind
    power = (real**2 + imaginary**2) / behind.shape[0]
    best = jnp.argmax(power)
    return power[best], jnp.asarray(FREQUENCIES, apart.dtype)[best]


def _step(bins: Bins, apart, case: Case, rise):
    """Return the clearest step up behind the front, its lag and its height."""
    used = (case.weight > 0).astype(apart.dtype)
    gain = jnp.sum(case.noise.taps)
    # plain differences again, as far as noise is white
    weight = jnp.square(case.weight * gain)
    value = apart * case.weight * gain
    late = bins.start.astype(apart.dtype) > SECOND_FRONT_SAMPLES + 2.0 * rise
    sums = jnp.concatenate([jnp.zeros_like(value[:1]), jnp.cumsum(value)])
    weights = jnp.concatenate([jnp.zeros_like(weight[:1]), jnp.cumsum(weight)])
    n = value.shape[0]
    found = []
    for side in SIDES:
        at = np.arange(side, n - side)
        before, after = at - side, at + side
        left = weights[at] - weights[before]
        right = weights[after] - weights[at]
        both = (left > 0) & (right > 0) & late[at] & (used[at] > 0)
        left, right = jnp.where(both, left, 1.0), jnp.where(both, right, 1.0)
        rise_of = (sums[after] - sums[at]) / right - (sums[at] - sums[before]) / left
        size = jnp.where(both, rise_of / jnp.sqrt(1.0 / left + 1.0 / right), 0.0)
        best = jnp.argmax(size)
        place = jnp.asarray(bins.start[at], apart.dtype)[best]
        found.append((size[best], place, rise_of[best]))
    sizes = jnp.stack([size for size, _, _ in found])
    row = jnp.argmax(sizes)
    lag = jnp.stack([place for _, place, _ in found])[row]
    height = jnp.stack([height for _, _, height in found])[row]
    return sizes[row], jnp.maximum(lag, 1.0), jnp.clip(height, 0.02, 5.0)


class Unstated(NamedTuple):
    """The pulse before a high-pass that nobody stated.

    Attributes:
        found: Its optimum.
        case: The record over the long stretch, with a high-pass.
        share: Share of the posterior of a high-pass; zero where it was not looked for.
    """

    found: Optimum
    case: Case
    share: Float[Array, ""]

    @property
    def probable(self) -> Bool[Array, ""]:
        """Whether a high-pass is more probable than none."""
        return self.share > 0.5

    def chosen(self, shown: Shown) -> tuple[Optimum, Case]:
        """Return the more probable of the two, and its case.

        Args:
            shown: The pulse without a high-pass.
        """
        return (
            either(self.probable, self.found, shown.best),
            either(self.probable, self.case, shown.case),
        )


def unstated_high_pass(
    bins: Bins, ready: Prepared, formed: Formed, shown: Shown
) -> Unstated:
    """Return the pulse before a high-pass, and how probable that is.

    Args:
        bins: Where the record is looked at.
        ready: The record.
        formed: Best form of the pulse, without anything else.
        shown: The same with what else shows.
    """
    case = lax.stop_gradient(
        ready.whole._replace(
            centre=jnp.concatenate(
                [ready.case.centre, shown.case.centre[CENTRE.size :]]
            ),
            form=formed.case.form,
            passed=jnp.ones_like(shown.share),
        )
    )
    none = Unstated(shown.best, case, jnp.zeros_like(shown.share))
    if case.high_pass is not None:
        return none
    impulse = natural_of(formed.best.y, formed.case.form).impulse
    balanced = jnp.abs(ready.net) < SURE * ready.net_sd + NET * impulse
    asked = balanced & (shown.case.passed == 0)
    return lax.cond(asked, lambda: _compared(bins, formed, shown, case), lambda: none)


def _compared(bins: Bins, formed: Formed, shown: Shown, case: Case) -> Unstated:
    """Return the best pulse before a high-pass, and its share of the posterior."""
    of, kind = partial(misfit, bins), case.span.dtype
    form, further = formed.case.form, case.centre[CENTRE.size :]
    plain = jnp.concatenate([formed.best.y, further])
    here = natural_of(formed.best.y, form)
    off, yes = jnp.zeros_like(case.span), jnp.ones_like(case.span)
    clear = case._replace(passed=off)

    def rows(of_plain, of_shown, of_passed):
        """Return one of each hypothesis, in their order."""
        return jnp.stack(
            [
                *(jnp.asarray(x) for x in of_plain),
                jnp.asarray(of_shown),
                *(jnp.asarray(x) for x in of_passed),
            ]
        )

    starts, negatives = [], []
    for negative in (CUBIC, CONTINUED):
        for corner, longer in STARTS:
            # the slope behind the front is the pulse's and the high-pass's
            fall = longer * (1.0 + here.decay - corner)
            y = plain.at[2].add(np.log(longer))
            y = y.at[3].set(jnp.log(jnp.maximum(fall, 1.0 + SUCTION)))
            y = y.at[5].set(SUCTION)
            starts.append(y.at[PLACE].set(np.log(corner) - jnp.log(here.duration)))
            negatives.append(jnp.asarray(float(negative), kind))
    many, more = len(NEGATIVES), len(starts)
    flags = shown.case.rings, shown.case.follows, shown.case.passed, shown.case.shifted
    hypotheses = (
        rows([plain] * many, shown.best.y, starts),
        rows([form.rise] * many, shown.case.form.rise, [form.rise] * more),
        rows(
            [jnp.asarray(float(x), kind) for x in NEGATIVES],
            shown.case.form.negative,
            negatives,
        ),
        rows(
            [jnp.zeros(4, kind)] * many,
            jnp.stack(flags),
            [jnp.stack([off, off, yes, off])] * more,
        ),
    )

    def fitted(least, hypothesis):
        start, rise, negative, (rings, follows, passed, shifted) = hypothesis
        mine = clear._replace(
            form=Form(rise, negative),
            rings=rings,
            follows=follows,
            passed=passed,
            shifted=shifted,
        )
        found = optimum_of(of, start, mine, most_steps=FURTHER_STEPS)
        good = found.converged & jnp.isfinite(found.cost)
        return jnp.where(good, jnp.minimum(found.cost, least), least), found

    never = jnp.full_like(off, jnp.inf)
    least, found = lax.scan(fitted, never, hypotheses)
    count = jnp.maximum(jnp.sum((case.weight > 0).astype(kind)), 1.0)
    widened = jnp.maximum(2.0 * least / count, 1.0)
    level = 0.5 * found.size - found.cost / widened
    good = found.converged & jnp.isfinite(level)
    level = lax.stop_gradient(jnp.where(good, level, -jnp.inf))
    passed = level[many + 1 :]
    odds = jnp.max(passed) - jnp.max(level[: many + 1])
    best = many + 1 + jnp.argmax(passed)
    chosen = jax.tree.map(lambda x: x[best], found)
    share = jnp.where(jnp.isfinite(odds), jax.nn.sigmoid(odds), 0.0)
    mine = case._replace(form=Form(form.rise, hypotheses[2][best]))
    return Unstated(either(share > 0, chosen, shown.best), mine, share)
