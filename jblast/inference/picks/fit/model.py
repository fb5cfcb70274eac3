r"""What a record's bins hold by the model, and its misfit.

    pulses -> resonance -> means over bins -> high-pass -> drift added -> whitened

In wide bins what rings oscillates, and is whitened by what the taps make of its pole.

The misfit is a vector whose half square is minus ln posterior: whitened differences,
then the unknowns' distances from their priors. A clipped bin only says that the
pressure $m$ was at least the level $c$; its part is
$\sqrt{-2 \ln \Phi((m - c)/\sigma)}$, of which half the square is minus the logarithm of
that probability.
"""

import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.scipy.special import log_ndtr
from jaxtyping import Array, Float

from jblast.inference.picks.fit.means import means_over
from jblast.inference.picks.fit.pole import Ringing, pole_of, ringing
from jblast.inference.picks.ready.bins import Bins
from jblast.inference.picks.ready.case import Case
from jblast.inference.picks.ready.noise import whitened_means
from jblast.inference.picks.unknowns import (
    CENTRE,
    FURTHER_SPREAD,
    PULSE_UNKNOWNS,
    SPREAD,
    following,
    natural_of,
    pulse_by,
)

TOGETHER = 8
"""Bins whose differences are summed, to see what is slow."""

SLOW_UNKNOWNS = 9.0
"""All but arrival and rise."""

FARTHEST_MEMORY = 300.0
"""Time constants from the front that a high-pass is followed over: exponents stay
within double precision."""


def modelled(
    bins: Bins, y: Float[Array, " unknown"], case: Case
) -> tuple[Float[Array, " bin"], Ringing | None]:
    """Return the mean pressure over each bin, as a share of the largest sample.

    And what of it a resonance adds; None: the unknowns have none.
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

        # one at most is asked for, of most records none
        asked = (zero[0] + 0.5, case.rings, case.follows, case.passed, case.shifted)
        choices = [lambda: none, rings_on, follows, passed, shifted]
        rings = lax.switch(jnp.argmax(jnp.stack(asked)), choices)
        waves = waves + rings.mean
    if case.high_pass is not None:
        waves = waves - low_passed(bins, waves, case.high_pass)
    x = (jnp.asarray(bins.middle, y.dtype) - case.middle) / case.span
    return waves + drift_at(y, x), rings


def _resonance(y: Float[Array, " unknown"]):
    """Return frequency [1/sample] and damping of a sensor that rings."""
    ln_omega, logit = y[CENTRE.size], y[CENTRE.size + 1]
    return jnp.exp(ln_omega), 1.0 / (1.0 + jnp.exp(-logit))


def _whitened(
    bins: Bins,
    y: Float[Array, " unknown"],
    case: Case,
    means: Float[Array, " bin"],
    rings: Ringing | None,
) -> Float[Array, " bin"]:
    """Return means through the taps that make noise white."""
    if rings is None:
        return whitened_means(case.noise, bins, means)
    # z(t - k) is z(t) exp(-pole k): the taps multiply what rings by a number
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
    """Return the drift at places of the stretch, from -1 to 1.

    Args:
        y: The unknowns.
        x: The places.
    """
    level, slope, bend, twist = y[PULSE_UNKNOWNS : PULSE_UNKNOWNS + 4]
    return level + x * (slope + x * (bend + x * twist))


def low_passed(
    bins: Bins, means: Float[Array, " bin"], corner: Float[Array, ""]
) -> Float[Array, " bin"]:
    r"""Return what a first-order high-pass takes away, as means over bins.

    $v' = a\,(p - v)$: of steps from bin to bin exactly,
    $v_i = \sum_{j<i} p_j\,(e^{-a(t_i - b_j)} - e^{-a(t_i - a_j)})$ at the start $t_i$
    of a bin, $a_j$ and $b_j$ the ends of those before. The exponents are counted from
    the front, and bounded where nothing is left of what was that long ago.
    """
    kind = means.dtype
    start, stop = bins.start.astype(kind), bins.stop.astype(kind)
    far = FARTHEST_MEMORY / jnp.maximum(corner, jnp.finfo(kind).tiny)
    start, stop = jnp.clip(start, -far, far), jnp.clip(stop, -far, far)
    steps = means * (jnp.exp(corner * stop) - jnp.exp(corner * start))
    sums = jnp.cumsum(steps) - steps
    before = sums * jnp.exp(-corner * start)
    passed = corner * bins.width.astype(kind)
    kept = -jnp.expm1(-passed) / passed
    return before * kept + means * (1.0 - kept)


def misfit(
    bins: Bins, y: Float[Array, " unknown"], case: Case
) -> Float[Array, " term"]:
    """Return the vector of which half the square is minus ln posterior.

    Args:
        bins: Where the record is looked at.
        y: The unknowns.
        case: The record.
    """
    means, rings = modelled(bins, y, case)
    apart = case.white - case.weight * _whitened(bins, y, case, means, rings)
    held = case.clipped != 0

    def bounded():
        above = jnp.where(held, case.clipped * means - case.level, 0.0)
        chance = log_ndtr(above / case.noise.marginal)
        # far above the level the root has no slope, and needs none
        short = jnp.sqrt(jnp.maximum(-2.0 * chance, 1e-20))
        return jnp.where(held, short, apart)

    # few records are clipped, and the chance of one costs more than all its means
    apart = lax.cond(jnp.any(held), bounded, lambda: apart)
    spread = np.concatenate([SPREAD, FURTHER_SPREAD])[: y.shape[0]]
    prior = (y - case.centre) / spread.astype(y.dtype)
    prior = prior.at[2].multiply(1.0 + case.hold)
    return jnp.concatenate([apart, prior])


def misfit_ratio(
    bins: Bins, y: Float[Array, " unknown"], case: Case
) -> Float[Array, ""]:
    """Return the squared misfit of the bins that count, by degree of freedom.

    Args:
        bins: Where the record is looked at.
        y: The unknowns.
        case: The record.
    """
    return _ratio(_apart(bins, y, case), case)


def larger_misfit_ratio(
    bins: Bins, y: Float[Array, " unknown"], case: Case
) -> Float[Array, ""]:
    """Return that or the same of neighbours together, whichever is larger.

    Where a baseline is not the model's, what moves slowly is small in each bin, and all
    of it goes into duration and impulse; of `TOGETHER` bins' sum it is as many times
    more.

    Args:
        bins: Where the record is looked at.
        y: The unknowns.
        case: The record.
    """
    apart = _apart(bins, y, case)
    return jnp.maximum(_ratio(apart, case), _slow_ratio(apart, case))


def _apart(bins: Bins, y, case: Case):
    """Return the misfit without what is believed."""
    return misfit(bins, y, case)[: bins.first.size]


def _ratio(apart, case: Case):
    """Return the squared misfit by degree of freedom."""
    many = jnp.sum(jnp.where((case.weight > 0) | (case.clipped != 0), 1.0, 0.0))
    return jnp.sum(jnp.square(apart)) / jnp.maximum(many - float(CENTRE.size), 1.0)


def _slow_ratio(apart, case: Case):
    """Return the same of `TOGETHER` neighbours' sums."""
    used = (case.weight > 0) & (case.clipped == 0)
    kind = apart.dtype
    apart = jnp.where(used, apart, 0.0)
    short = -apart.shape[0] % TOGETHER
    blocks = jnp.pad(apart, (0, short)).reshape(-1, TOGETHER)
    counts = jnp.pad(used.astype(kind), (0, short)).reshape(-1, TOGETHER)
    count = jnp.sum(counts, axis=1)
    squares = jnp.square(jnp.sum(blocks, axis=1)) / jnp.maximum(count, 1.0)
    many = jnp.sum((count > 0).astype(kind))
    return jnp.sum(squares) / jnp.maximum(many - SLOW_UNKNOWNS, 4.0)
