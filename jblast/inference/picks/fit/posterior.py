r"""From unknowns and their covariance to values and theirs."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.picks.unknowns import Natural, natural_of

WIDE, NARROW = 2.0, 1.0
"""Rises [samples]: above the first the front is resolved, below the second not."""


class Values(NamedTuple):
    """A pulse, and the covariance of its arrival, ln of others, decay as it is.

    Attributes:
        natural: Times in samples, pressures in shares.
        covariance: In the order of `result.NAMES`.
    """

    natural: Natural
    covariance: Float[Array, "8 8"]


def values_of(
    y: Float[Array, " unknown"],
    covariance: Float[Array, "unknown unknown"],
    widened: Float[Array, ""],
) -> Values:
    r"""Return the values.

    A front that rises within a sample may lie anywhere in it, whatever the instrument
    does between two samples: then $1/12$ of a squared sample is added to the variance
    of the arrival.

    Args:
        y: The unknowns.
        covariance: Theirs.
        widened: What to multiply it by.
    """
    natural = natural_of(y)
    slopes = jax.jacfwd(_in_error_units)(jax.lax.stop_gradient(y))
    total = widened * (slopes @ covariance @ slopes.T)
    unresolved = jnp.clip((WIDE - natural.rise) / (WIDE - NARROW), 0.0, 1.0)
    added = np.zeros((8, 8))
    added[0, 0] = 1.0 / 12.0
    return Values(natural, total + unresolved * jnp.asarray(added, total.dtype))


def _in_error_units(y: Float[Array, " unknown"]) -> Float[Array, "8"]:
    """Return the values in the unit of their errors."""
    n = natural_of(y)
    positive = (n.peak, n.duration, n.impulse, n.rise, n.suction, n.suction_duration)
    peak, duration, impulse, rise, suction, length = (jnp.log(x) for x in positive)
    order = (n.arrival, peak, duration, impulse, n.decay, rise, suction, length)
    return jnp.stack(order)
