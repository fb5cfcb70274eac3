r"""From unknowns and their covariance to values and theirs."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.inference.picks.unknowns import Form, Natural, natural_of

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
    form: Form,
    offset: Float[Array, "8"],
    covariance: Float[Array, "8 8"],
    others: Float[Array, "other plain"],
    shares: Float[Array, " other"],
) -> Values:
    r"""Return the values.

    Where another optimum has a share $q$ of the posterior, a distance $\Delta$ off,
    $q\,\Delta\Delta^T$ is added: the mean square about the better one.

    A front that rises within a sample may lie anywhere in it, whatever the instrument
    does between two samples: then $1/12$ of a squared sample is added to the variance
    of the arrival. What follows the front stays where it is, so with a later one
    duration, peak, impulse and decay are less.

    Args:
        y: The unknowns.
        form: Formulas of the pulse.
        offset: What to add to the values, in the units of their errors.
        covariance: Of the values.
        others: Unknowns of other optima.
        shares: That they have of the posterior.
    """
    here = in_error_units(y, form)
    there = jax.vmap(lambda y: in_error_units(y, form))(others)
    off = jnp.where(shares[:, None] > 0, there - here[None, :], 0.0)
    off = jax.lax.stop_gradient(off)
    total = covariance + (shares[:, None] * off).T @ off
    natural = _averaged(natural_of(y, form), here + offset)
    later = jax.lax.stop_gradient(_of_later_front(natural))
    added = unresolved(natural.rise) / 12.0 * later[:, None] * later[None, :]
    return Values(natural, total + added)


def unresolved(rise: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return 1 for a rise that no sample resolves, 0 for one that some do."""
    return jnp.clip((WIDE - rise) / (WIDE - NARROW), 0.0, 1.0)


def _averaged(natural: Natural, values: Float[Array, "8"]) -> Natural:
    """Return a pulse with the mean values of all forms; its suction is the best's."""
    peak, duration, impulse = (jnp.exp(values[k]) for k in (1, 2, 3))
    return natural._replace(
        arrival=values[0],
        peak=peak,
        duration=duration,
        impulse=impulse,
        decay=values[4],
        rise=jnp.exp(values[5]),
    )


def error_covariance(
    y: Float[Array, " unknown"],
    covariance: Float[Array, "unknown unknown"],
    form: Form,
) -> Float[Array, "8 8"]:
    """Return the covariance of the values, in the order of `result.NAMES`.

    Args:
        y: The unknowns.
        covariance: Theirs.
        form: Formulas of the pulse.
    """
    slopes = jax.jacfwd(lambda y: in_error_units(y, form))(jax.lax.stop_gradient(y))
    return slopes @ covariance @ slopes.T


def _of_later_front(n: Natural) -> Float[Array, "8"]:
    """Return what a front a sample later changes, behind which nothing moves."""
    one, none = jnp.ones_like(n.peak), jnp.zeros_like(n.peak)
    behind = n.duration - n.rise
    peak, decay = -(1.0 + n.decay) / behind, -n.decay / behind
    impulse = -n.peak / n.impulse
    order = (one, peak, -1.0 / n.duration, impulse, decay, none, none, none)
    return jnp.stack(order)


def in_error_units(y: Float[Array, " unknown"], form: Form) -> Float[Array, "8"]:
    """Return the values in the unit of their errors.

    Args:
        y: The unknowns.
        form: Formulas of the pulse.
    """
    n = natural_of(y, form)
    sizes = (n.peak, n.duration, n.impulse, n.rise, n.suction, n.suction_duration)
    # a suction below zero, too: its error is a share of its size
    peak, duration, impulse, rise, suction, length = (
        jnp.log(jnp.abs(x)) for x in sizes
    )
    order = (n.arrival, peak, duration, impulse, n.decay, rise, suction, length)
    return jnp.stack(order)
