"""Some records picked together, in the units of the fit; times in samples."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jblast.inference.picks.fit.model import data_misfit, misfit, readings
from jblast.inference.picks.fit.optimum import optimum_of
from jblast.inference.picks.fit.posterior import values_of
from jblast.inference.picks.ready.bins import bins_about_front
from jblast.inference.picks.ready.case import prepared
from jblast.inference.picks.ready.start import bank_of
from jblast.inference.picks.unknowns import CENTRE, Natural

LEAST_SIGNAL = 5.0
"""A pulse is found where its peak is so many of its standard deviations."""

CHANCE = 3.0
"""A misfit that so many of its standard deviations leave to chance widens nothing."""


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
    clipped_level: Float[Array, " lane"]
    converged: Bool[Array, " lane"]
    found: Bool[Array, " lane"]
    drifting: Bool[Array, " lane"]
    cut_short: Bool[Array, " lane"]
    misfit: Float[Array, " lane"]


def pick_lanes(
    samples: Float[Array, "lane sample"],
    clipped: Float[Array, "lane sample"],
    count: Int[Array, " lane"],
) -> LanePicks:
    """Pick records of one length.

    Args:
        samples: Overpressure in any unit, finite.
        clipped: +1 where a sample is a lower bound, -1 an upper one, else 0.
        count: Samples of each record; the last of them repeats behind it.
    """
    bins = bins_about_front(samples.shape[1])
    bank = bank_of(bins, samples.shape[1])
    ready = jax.vmap(partial(prepared, bins, bank))(samples, clipped, count)
    of_record = partial(misfit, bins)
    best = optimum_of(of_record, ready.start, ready.case)
    apart = jax.vmap(of_record)(best.y, ready.case)
    freedom = jnp.maximum(jax.vmap(readings)(ready.case) - CENTRE.size, 1.0)
    ratio = jax.vmap(data_misfit)(apart) / freedom
    chance = 1.0 + CHANCE * jnp.sqrt(2.0 / freedom)
    widened = jnp.where(ratio > chance, ratio, 1.0)
    values = jax.vmap(values_of)(best.y, best.covariance, widened)
    natural, covariance = values
    x = (natural.arrival - ready.case.middle) / ready.case.span
    level, slope, bend = best.y[:, 7], best.y[:, 8], best.y[:, 9]
    drift = jnp.maximum(jnp.abs(slope), jnp.abs(bend))
    held = jnp.any(clipped > 0, axis=1)
    seen = LEAST_SIGNAL * jnp.sqrt(covariance[:, 1, 1]) < 1.0
    left = (count - ready.front.sample).astype(samples.dtype)
    return LanePicks(
        natural=natural,
        covariance=covariance,
        front=ready.front.sample,
        offset=ready.offset,
        scale=ready.scale,
        level=level + x * (slope + x * bend),
        noise=ready.case.noise.marginal,
        noise_known=ready.case.noise.known,
        clipped=held,
        clipped_level=ready.case.level,
        converged=best.converged,
        found=jnp.isfinite(covariance[:, 1, 1]) & (seen | held),
        drifting=drift > 0.02 * natural.peak,
        cut_short=natural.arrival + natural.duration > left,
        misfit=ratio,
    )
