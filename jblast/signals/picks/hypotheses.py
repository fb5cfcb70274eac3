r"""Hypotheses beyond one pulse: ringing, a later front, a baseline step, a high-pass.

The residuals of one pulse show signs of an oscillation of the sensor or of a further
front. A sign only starts another fit; a hypothesis is accepted if that fit improves the
posterior by enough.

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

from jblast.signals.picks.forms import RESOLVED_RISE, Formed
from jblast.signals.picks.model import Optimum, drift_at, misfit, optimum_of
from jblast.signals.picks.preparation import SINGLE_BEHIND, Bins, Case, Prepared
from jblast.signals.picks.searches import (
    LEAST_SHARE,
    LN_OMEGA,
    Hidden,
    best_ring,
    cost_of,
    hidden_ring,
    select,
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

LN_LAG = CENTRE.size + 2
"""Index of ln lag among the unknowns."""
EFFECT_GAIN = 15.0
"""Gain in ln posterior from which on a further front, a high-pass or a step of the
baseline is accepted. Such effects have up to three unknowns and are searched over the
whole record. Of 10,000 simulated records, which have neither, 5 are assigned a further
front and 12 a high-pass (`calibration/results/picks_simulated.txt`). A smaller gain
assigns more, a larger one misses weak reflections."""
BASELINE_SHIFT = 0.02
"""Share of the peak by which the baseline must move before a step of it is tried; the
same share marks a record as drifting. Smaller movements change duration and impulse by
less than the scatter of laws."""
RING_GAIN = 7.0
"""Gain in ln posterior from which on a ring is accepted. Prior odds of 1 to 20 against
one cost 3, the search over frequency and damping the rest. It is lower than
`EFFECT_GAIN` since sensors ring more often than fronts follow. Of 10,000 simulated
records with it, 14 are assigned a ring that they do not have, and 129 of 1,453 rings
behind resolved fronts are missed (`calibration/results/picks_simulated.txt`)."""
HIDDEN_RING_GAIN = 1.0
"""Gain in ln posterior of a trial from which on a ring behind a slow front is fitted.
The fit gains more than the trial and must reach `RING_GAIN`; a smaller value only costs
more fits."""
WEAK_RING_POWER = 5.0
"""Power of an oscillation [of white noise] from which on such a ring is also fitted
from the observed frequency. The largest of 96 powers of white noise exceeds it in four
records of ten, which costs a fit."""
RING_FREQUENCIES = np.linspace(0.08, 2.9, 96)
"""Angular frequencies of the spectrum of residuals [rad/sample]: from about one period
in the 96 single samples behind the front to just below Nyquist's, pi."""
HIGHEST_RING = 1.05 * RING_FREQUENCIES[-1]
"""Highest angular frequency of a ring [rad/sample]. One near Nyquist's, 3.14,
oscillates from sample to sample and only imitates a rise of another form."""
MAX_FURTHER_STEPS = 60
"""Largest number of steps of a search for a ring or a further front; from a good start
a dozen are enough."""
RING_POWER = 9.5
"""Power of an oscillation [of white noise] from which on a ring is fitted. The largest
of 96 powers of white noise exceeds it in one record of 150, at the cost of a fit."""
STEP_SIGNIFICANCE = 8.0
"""Height of a step in the residuals from which on a further front is fitted [standard
deviations]. Such a step gains about half of its square, 32, more than `EFFECT_GAIN`;
of smaller ones the other unknowns absorb too large a part."""
MISFIT_SIGNIFICANCE = 4.0
"""Excess of the squared misfit over 1 from which on one pulse does not explain the
record [standard deviations of the misfit of white noise]: noise in two hundred bins has
it in one record of 6,000."""
CORNER_START = 0.3
"""Start of the corner of a high-pass, times the duration of the positive phase."""
SECOND_FRONT_SAMPLES = 4.0
"""Smallest distance of a further front behind the first, in addition to two rise times
[samples]. Within it a second front and a rise of another form look alike."""
STEP_SIDES = (1, 2, 4, 8)
"""Bins on either side of a step whose means are compared: few for a short further
pulse, many for a faint long one."""
LN_CORNER = CENTRE.size + FURTHER.index("ln_corner")
"""Index of ln corner among the unknowns."""
NET_SIGNIFICANCE = 2.0
"""Standard deviations within which a net impulse may be zero: 95 % of high-passed
records satisfy it."""
NET_SHARE = 0.3
"""Share of the positive impulse within which a net impulse may be zero besides its
error: the fitted drift and the tail beyond the interval leave as much. One in four good
records without a high-pass has less, at the cost of the comparison."""
HIGH_PASS_STARTS = ((0.3, 1.3), (1.0, 2.0), (1.0, 4.0), (2.0, 3.0))
"""Starts of a search through a high-pass: corner times the apparent duration [rad], and
true over apparent duration. A corner of 1 shortens the phase up to fivefold."""
HIGH_PASS_SUCTION = 0.1
"""Start of the suction before the high-pass, over the peak: small, since most of the
observed suction is then due to the high-pass."""


class WithEffects(NamedTuple):
    """Optimum of a record with the accepted effect: ring, further front, and so on.

    Attributes:
        best: The optimum.
        case: The record, with the flag of the effect.
        rival: Unknowns of the pulse with a ring if none was accepted, else without.
        share: Share of that rival in the posterior.
    """

    best: Optimum
    case: Case
    rival: Float[Array, " plain"]
    share: Float[Array, ""]


def with_further_effects(
    bins: Bins,
    one: Optimum,
    formed: Formed,
    start: Float[Array, " unknown"],
    case: Case,
) -> WithEffects:
    """Return the optimum with the best further effect: a ring, a further front, etc.

    Each effect with a sign in the residuals is fitted. Of those that raise ln posterior
    by `RING_GAIN` or `EFFECT_GAIN` the best is accepted. A further front and a
    high-pass are fitted with the best form of the pulse, which may only imitate them,
    and with the smooth rise and the cubic negative phase. A step of the baseline is
    fitted with the best form, a ring with the smooth rise and the cubic phase, whose
    response has a closed form.

    Args:
        bins: Bins of the record.
        one: Optimum of one pulse, of a smooth rise and a cubic negative phase.
        formed: Optimum of the best form.
        start: Starting point of the search for the first.
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

    # a slow front excites a sensor little, but the sensor still delays it: the change
    # of the rise may be clearer than the ringing behind it
    slow = natural_of(one.y).rise > RESOLVED_RISE
    hidden = lax.cond(
        slow,
        lambda: hidden_ring(bins, one, first, simple._replace(rings=1.0 + none)),
        lambda: Hidden(-jnp.inf + none, first),
    )
    hides = hidden.gain - lax.stop_gradient(one.cost - alone) > HIDDEN_RING_GAIN
    oscillates = jnp.where(hides & (signs.power > WEAK_RING_POWER), 1.0, signs.rings)
    bent = hides.astype(none.dtype)

    # once an effect explains the record within noise, no other is fitted
    many = jnp.sum(case.weight > 0).astype(one.y.dtype)
    enough = (
        0.5
        * many
        * (1.0 + MISFIT_SIGNIFICANCE * jnp.sqrt(2.0 / jnp.maximum(many, 1.0)))
    )

    def explains_more(case):
        return case.rings + case.follows + case.passed + case.shifted > 0

    def tried(carried, hypothesis):
        best, ring = carried
        flags, start, price, by_trial = hypothesis
        tested = select(flags[4] > 0, simple, plain)
        more = tested._replace(
            rings=flags[0], follows=flags[1], passed=flags[2], shifted=flags[3]
        )
        explained = explains_more(best[2]) & best[1].converged & (best[0] < enough)
        shown = (jnp.sum(flags[:4]) > 0) & ~explained

        def fitted():
            of = partial(misfit, bins)
            begin = lax.cond(
                by_trial,
                lambda: best_ring(bins, start, more),
                lambda: start,
            )
            # the prior of the frequency is about the observed or best tried one
            seen = more._replace(centre=more.centre.at[LN_OMEGA].set(begin[LN_OMEGA]))
            found = optimum_of(
                of, begin, seen, most_steps=MAX_FURTHER_STEPS, hopeless=alone
            )
            return found, found.cost + price, seen

        found, cost, more = lax.cond(
            shown, fitted, lambda: (unmoved, jnp.inf + price, plain)
        )
        # a further front within the first one's rise only imitates another form of it
        apart = (
            jnp.exp(found.y[LN_LAG])
            > SECOND_FRONT_SAMPLES + 2.0 * natural_of(found.y).rise
        )
        apart |= more.follows == 0
        resolved = (more.rings == 0) | (jnp.exp(found.y[LN_OMEGA]) < HIGHEST_RING)
        accepted = shown & (cost < best[0]) & apart & resolved
        better = select(accepted, (cost, found, more), best)
        rings = (more.rings > 0) & resolved & (cost < ring[0])
        ring = select(rings, (cost, lax.stop_gradient(found.y)), ring)
        return (better, ring), None

    # start of a step of the baseline: the level before the front, and the change to
    # the level behind it, instead of the cubic drift
    before, after = (drift_at(best_form.y, jnp.full_like(none, x)) for x in (-1, 1))
    peak = jnp.exp(best_form.y[1])
    moves = (jnp.abs(after - before) > BASELINE_SHIFT * peak).astype(none.dtype)
    level = unmoved.y.at[PULSE_UNKNOWNS : CENTRE.size].set(0.0)
    level = level.at[PULSE_UNKNOWNS].set(before).at[-1].set((after - before) / peak)
    yes = jnp.ones_like(none)
    requested = jnp.stack(
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
    prices = jnp.asarray(
        [*[EFFECT_GAIN] * 3, *[RING_GAIN] * 3, *[EFFECT_GAIN] * 3], alone.dtype
    )
    tries = jnp.asarray([*[False] * 4, True, True, *[False] * 3])
    # the fit of one pulse to a ring, or to two fronts, may have gone far astray: these
    # are also searched from where it began
    afresh = jnp.concatenate([start, signs.start])
    # effects with one unknown come first: a further front has three and would explain
    # most of what they do
    starts = [first, unmoved.y, level, hidden.start, first, afresh, afresh, first]
    starts.append(unmoved.y)
    begin = (alone, unmoved, plain), (jnp.full_like(alone, jnp.inf), unmoved.y)
    # a scan compiles the fit once for all nine hypotheses
    hypotheses = (requested, jnp.stack(starts), prices, tries)
    (best, ring), _ = lax.scan(tried, begin, hypotheses)
    _, found, chosen = best
    # where the odds of a ring are near even, the other pulse widens the errors
    odds = lax.stop_gradient(jnp.abs(ring[0] - alone))
    share = jnp.where(jnp.isfinite(odds), 1.0 / (1.0 + jnp.exp(odds)), 0.0)
    share = jnp.where(chosen.follows + chosen.passed + chosen.shifted > 0, 0.0, share)
    rival = jnp.where(
        chosen.rings > 0, lax.stop_gradient(best_form.y), ring[1][: CENTRE.size]
    )
    return WithEffects(found, chosen, rival, jnp.where(share > LEAST_SHARE, share, 0.0))


def _with_block(covariance: Float[Array, "unknown unknown"]):
    """Return a covariance extended by further unknowns of unit variance."""
    n, more = covariance.shape[0], FURTHER_CENTRE.size
    index = jnp.arange(n, n + more)
    return jnp.pad(covariance, [(0, more), (0, more)]).at[index, index].set(1.0)


class Signs(NamedTuple):
    """Signs of further effects in a record.

    Attributes:
        rings: 1 for an oscillation, else 0.
        power: Power of the largest oscillation [of white noise].
        follows: 1 for a further front, else 0.
        passed: 1 for a misfit of any kind, else 0.
        start: Starting point of the further unknowns, see `FURTHER`.
    """

    rings: Float[Array, ""]
    power: Float[Array, ""]
    follows: Float[Array, ""]
    passed: Float[Array, ""]
    start: Float[Array, "7"]


def signs_in(
    bins: Bins, apart: Float[Array, " bin"], case: Case, natural: Natural
) -> Signs:
    """Return the signs of further effects in a record.

    Args:
        bins: Bins of the record.
        apart: Whitened residuals of one pulse.
        case: The record.
        natural: The pulse, in samples.
    """
    power, omega = _oscillation(bins, apart)
    step, lag, height = _step(bins, apart, case, natural.rise)
    count = jnp.sum((apart != 0).astype(apart.dtype))
    ratio = jnp.sum(apart * apart) / jnp.maximum(count - CENTRE.size, 1.0)
    odd = ratio > 1.0 + MISFIT_SIGNIFICANCE * jnp.sqrt(2.0 / jnp.maximum(count, 1.0))
    rings = (power > RING_POWER) | odd
    start = [jnp.log(omega), np.log(0.05), jnp.log(lag), jnp.log(height), 0.0]
    start += [np.log(CORNER_START) - jnp.log(natural.duration), 0.0]
    kind = apart.dtype
    return Signs(
        rings.astype(kind),
        power,
        (step > STEP_SIGNIFICANCE).astype(kind),
        odd.astype(kind),
        jnp.stack([jnp.asarray(x).astype(kind) for x in start]),
    )


def _oscillation(bins: Bins, apart):
    """Return power and frequency [rad/sample] of the largest oscillation."""
    first = bins.single.start + int(np.argmax(bins.first[bins.single] >= 0))
    behind = apart[first : first + SINGLE_BEHIND]
    # a product with constant matrices: an FFT has no frequencies between its own
    phases = RING_FREQUENCIES[:, None] * np.arange(behind.shape[0])[None, :]
    real = jnp.asarray(np.cos(phases), apart.dtype) @ behind
    imaginary = jnp.asarray(np.sin(phases), apart.dtype) @ behind
    power = (real**2 + imaginary**2) / behind.shape[0]
    best = jnp.argmax(power)
    return power[best], jnp.asarray(RING_FREQUENCIES, apart.dtype)[best]


def _step(bins: Bins, apart, case: Case, rise):
    """Return the most significant rise behind the front, its lag and its height."""
    used = (case.weight > 0).astype(apart.dtype)
    gain = jnp.sum(case.noise.taps)
    # least squares for a step in pressure: behind the taps, a step is itself times
    # their gain at zero frequency, so the weights contain that gain
    weight = jnp.square(case.weight * gain)
    value = apart * case.weight * gain
    late = bins.start.astype(apart.dtype) > SECOND_FRONT_SAMPLES + 2.0 * rise
    sums = jnp.concatenate([jnp.zeros_like(value[:1]), jnp.cumsum(value)])
    weights = jnp.concatenate([jnp.zeros_like(weight[:1]), jnp.cumsum(weight)])
    n = value.shape[0]
    found = []
    for side in STEP_SIDES:
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
    """The pulse before a high-pass that was not specified.

    Attributes:
        found: Its optimum.
        case: The record over the long interval, with a high-pass.
        share: Probability of a high-pass; zero where it was not tested.
    """

    found: Optimum
    case: Case
    share: Float[Array, ""]

    @property
    def probable(self) -> Bool[Array, ""]:
        """True if a high-pass is more probable than none."""
        return self.share > 0.5

    def chosen(self, shown: WithEffects) -> tuple[Optimum, Case]:
        """Return the more probable of the two, and its case.

        Args:
            shown: The pulse without a high-pass.
        """
        return (
            select(self.probable, self.found, shown.best),
            select(self.probable, self.case, shown.case),
        )


def unstated_high_pass(
    bins: Bins, ready: Prepared, formed: Formed, shown: WithEffects
) -> Unstated:
    """Return the pulse before a high-pass, and its probability.

    Args:
        bins: Bins of the record.
        ready: The record.
        formed: Best form of the pulse, without further effects.
        shown: The pulse with the accepted effect.
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
    balanced = (
        jnp.abs(ready.net) < NET_SIGNIFICANCE * ready.net_sd + NET_SHARE * impulse
    )
    # thirteen fits over a longer interval, only for records that may be high-passed
    tested = balanced & (shown.case.passed == 0)
    return lax.cond(tested, lambda: _compared(bins, formed, shown, case), lambda: none)


def _compared(bins: Bins, formed: Formed, shown: WithEffects, case: Case) -> Unstated:
    """Return the best pulse before a high-pass, and its probability."""
    of, kind = partial(misfit, bins), case.span.dtype
    form, further = formed.case.form, case.centre[CENTRE.size :]
    plain = jnp.concatenate([formed.best.y, further])
    here = natural_of(formed.best.y, form)
    off, yes = jnp.zeros_like(case.span), jnp.ones_like(case.span)
    clear = case._replace(passed=off)

    def rows(of_plain, of_shown, of_passed):
        """Return one row for each hypothesis."""
        return jnp.stack(
            [
                *(jnp.asarray(x) for x in of_plain),
                jnp.asarray(of_shown),
                *(jnp.asarray(x) for x in of_passed),
            ]
        )

    starts, negatives = [], []
    for negative in (CUBIC, CONTINUED):
        for corner, longer in HIGH_PASS_STARTS:
            # the observed slope behind the front is the sum of the pulse's and of the
            # high-pass's: the start of the decay is what the corner leaves of it
            fall = longer * (1.0 + here.decay - corner)
            y = plain.at[2].add(np.log(longer))
            y = y.at[3].set(jnp.log(jnp.maximum(fall, 1.0 + HIGH_PASS_SUCTION)))
            y = y.at[5].set(HIGH_PASS_SUCTION)
            starts.append(y.at[LN_CORNER].set(np.log(corner) - jnp.log(here.duration)))
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
        found = optimum_of(of, start, mine, most_steps=MAX_FURTHER_STEPS)
        good = found.converged & jnp.isfinite(found.cost)
        return jnp.where(good, jnp.minimum(found.cost, least), least), found

    never = jnp.full_like(off, jnp.inf)
    least, found = lax.scan(fitted, never, hypotheses)
    count = jnp.maximum(jnp.sum((case.weight > 0).astype(kind)), 1.0)
    # tempered by the least misfit as in `forms`: where no hypothesis fits, none is sure
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
    return Unstated(select(share > 0, chosen, shown.best), mine, share)
