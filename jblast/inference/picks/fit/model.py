r"""What a record's bins hold by the model, and its misfit.

    pulses -> resonance -> means over bins -> high-pass -> drift added -> whitened

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

from jblast.inference.picks.fit.pole import ringing
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
from jblast.waves.waveform.pulse import Pulse, pulse_mean

FARTHEST_MEMORY = 300.0
"""Time constants from the front that a high-pass is followed over: exponents stay
within double precision."""


def modelled(
    bins: Bins, y: Float[Array, " unknown"], case: Case
) -> Float[Array, " bin"]:
    """Return the mean pressure over each bin, as a share of the largest sample."""
    natural = natural_of(y)
    waves = _means(bins, pulse_by(natural))
    if (further := y[CENTRE.size :]).size:
        second = pulse_by(following(natural, further))
        waves = waves + case.follows * _means(bins, second)
        damping = 1.0 / (1.0 + jnp.exp(-further[1]))
        # of most records nothing is asked, and this is ten times all the rest
        waves = waves + lax.cond(
            case.rings > 0,
            lambda: ringing(bins, pulse_by(natural), jnp.exp(further[0]), damping),
            lambda: jnp.zeros_like(waves),
        )
        passed = _low_passed(bins, waves, jnp.exp(further[5]))
        waves = waves - case.passed * passed
    if case.high_pass is not None:
        waves = waves - _low_passed(bins, waves, case.high_pass)
    x = (jnp.asarray(bins.middle, y.dtype) - case.middle) / case.span
    return waves + drift_at(y, x)


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


def _means(bins: Bins, pulse: Pulse) -> Float[Array, " bin"]:
    """Return the means of a pulse."""
    kind = pulse.peak.dtype
    return pulse_mean(pulse, bins.start.astype(kind), bins.stop.astype(kind))


def _low_passed(
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
    means = modelled(bins, y, case)
    apart = case.white - case.weight * whitened_means(case.noise, bins, means)
    held = case.clipped != 0
    above = jnp.where(held, case.clipped * means - case.level, 0.0)
    chance = log_ndtr(above / case.noise.marginal)
    # far above the level the root has no slope, and needs none
    short = jnp.sqrt(jnp.maximum(-2.0 * chance, 1e-20))
    spread = np.concatenate([SPREAD, FURTHER_SPREAD])[: y.shape[0]]
    prior = (y - case.centre) / spread.astype(y.dtype)
    return jnp.concatenate([jnp.where(held, short, apart), prior])


def misfit_ratio(
    bins: Bins, y: Float[Array, " unknown"], case: Case
) -> Float[Array, ""]:
    """Return the squared misfit of the bins that count, by degree of freedom.

    Args:
        bins: Where the record is looked at.
        y: The unknowns.
        case: The record.
    """
    apart = misfit(bins, y, case)[: bins.first.size]  # without what is believed
    many = jnp.sum(jnp.where((case.weight > 0) | (case.clipped != 0), 1.0, 0.0))
    return jnp.sum(jnp.square(apart)) / jnp.maximum(many - float(CENTRE.size), 1.0)
