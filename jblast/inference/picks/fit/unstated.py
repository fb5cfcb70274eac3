r"""Whether a record was high-passed although no corner was stated.

A high-pass shortens the positive phase and deepens the suction, and what it makes of a
pulse may fit another pulse as well as noise allows: over the stretch of 4.5 durations
a corner of $1/t_d$ and a deep suction are alike. But a high-pass of any order leaves no
net impulse, and its tail lasts as long as the pulse that it was made of: a corner of
$1/t_d$ shortens the positive phase fivefold. So a record whose net impulse may be zero
is analysed over a stretch as many times as long: with every negative phase and no
high-pass, and with the cubic and the continued one through a high-pass of first order
(a high-pass of second order, or an oscillation, has much the same effect).

Both are equally probable a priori, so the odds of a high-pass are the ratio of the
largest evidence with it to that without it, by Laplace's approximation, tempered as in
`forms.py` where neither fits. Above one, the record is called high-passed; below, the
errors contain the duration that it would have then.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float

from jblast.inference.picks.fit.forms import Formed
from jblast.inference.picks.fit.hypotheses import FURTHER_STEPS, Shown
from jblast.inference.picks.fit.model import misfit
from jblast.inference.picks.fit.optimum import Optimum, optimum_of
from jblast.inference.picks.fit.searches import either
from jblast.inference.picks.ready.bins import Bins
from jblast.inference.picks.ready.case import Case, Prepared
from jblast.inference.picks.unknowns import (
    CENTRE,
    CONTINUED,
    CUBIC,
    FURTHER,
    NEGATIVES,
    Form,
    natural_of,
)

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
    asked = _balanced(ready, formed) & (shown.case.passed == 0)
    return lax.cond(asked, lambda: _compared(bins, formed, shown, case), lambda: none)


def _balanced(ready: Prepared, formed: Formed) -> Bool[Array, ""]:
    """Return whether the net impulse may be zero."""
    impulse = natural_of(formed.best.y, formed.case.form).impulse
    return jnp.abs(ready.net) < SURE * ready.net_sd + NET * impulse


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
