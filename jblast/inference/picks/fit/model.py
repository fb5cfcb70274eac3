r"""What a record's bins hold by the model, and its misfit.

    means over bins of: pulse + drift  ->  high-pass  ->  whitened, over sigma

The misfit is a vector whose half square is minus ln posterior: whitened differences,
then the unknowns' distances from their priors. A clipped bin only says that the
pressure $m$ was at least the level $c$; its part is
$\sqrt{-2 \ln \Phi((m - c)/\sigma)}$, of which half the square is minus the logarithm of
that probability.
"""

import jax.numpy as jnp
import numpy as np
from jax.scipy.special import log_ndtr
from jaxtyping import Array, Float

from jblast.inference.picks.ready.bins import Bins
from jblast.inference.picks.ready.case import Case
from jblast.inference.picks.ready.noise import whitened_means
from jblast.inference.picks.unknowns import (
    CENTRE,
    PULSE_UNKNOWNS,
    SPREAD,
    natural_of,
    pulse_by,
)
from jblast.waves.waveform.pulse import pulse_mean


def modelled(
    bins: Bins, y: Float[Array, " unknown"], case: Case
) -> Float[Array, " bin"]:
    """Return the mean pressure over each bin, as a share of the largest sample."""
    pulse = pulse_by(natural_of(y))
    waves = pulse_mean(pulse, bins.start.astype(y.dtype), bins.stop.astype(y.dtype))
    x = (bins.middle.astype(y.dtype) - case.middle) / case.span
    level, slope, bend = y[PULSE_UNKNOWNS : PULSE_UNKNOWNS + 3]
    return waves + level + x * (slope + x * bend)


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
    prior = (y - CENTRE.astype(y.dtype)) / SPREAD.astype(y.dtype)
    return jnp.concatenate([jnp.where(held, short, apart), prior])


def readings(case: Case) -> Float[Array, ""]:
    """Return how many bins count."""
    return jnp.sum(jnp.where((case.weight > 0) | (case.clipped != 0), 1.0, 0.0))


def data_misfit(apart: Float[Array, " term"]) -> Float[Array, ""]:
    """Return the sum of squares of what the record tells, without priors."""
    return jnp.sum(jnp.square(apart[: apart.shape[0] - np.size(CENTRE)]))
