"""Picks of a batch in seconds and pascals, by one program whatever their number."""

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float

from jblast.inference.picks.chunks import in_chunks
from jblast.inference.picks.fit.lanes import LanePicks, pick_lanes
from jblast.inference.picks.ready.clipped import clipped_samples
from jblast.inference.picks.result import Pick
from jblast.kept_programs import kept

SHORTEST = 512
"""Records are filled up to this or a larger power of two, so that those of any length
are picked by few programs."""

FEW_SAMPLES = 8.0
"""Fewer samples of positive phase are few."""

LONG_SUCTION = 6.0
"""A negative phase of as many positive ones is rather a high-pass: laws have 1.8 to
4.5."""

DEEP_SUCTION = 0.1
"""And it takes as large a share of the impulse, depth times duration."""

UNTOLD = 0.05
"""A clipped peak whose ln is known no better than this is a lower bound."""


def filled_length(samples: int) -> int:
    """Return the length that a record is filled up to."""
    return max(SHORTEST, 1 << (samples - 1).bit_length())


def picks_of(
    samples: Float[Array, "lane sample"] | Float[np.ndarray, "lane sample"],
    counts: ArrayLike,
    start: Float[ArrayLike, "..."],
    step: Float[ArrayLike, "..."],
    full_scale: Float[ArrayLike, "..."] | None,
    high_pass: Float[ArrayLike, "..."] | None,
) -> Pick:
    """Return the picks of records, each number one for all or one for each.

    Args:
        samples: Of records of one length, or filled up to it with their last sample.
        counts: How many samples each has.
        start: Time of the first sample [s].
        step: From one sample to the next [s].
        full_scale: Largest size of a sample; None, or NaN: nobody said.
        high_pass: Corner of a first-order high-pass, in cycles a sample; None: there
            is none.
    """
    many, kind = jnp.shape(samples)[:1], samples.dtype

    def of_each(number):
        if isinstance(number, Tracer):
            return jnp.broadcast_to(number.astype(kind), many)
        return np.broadcast_to(np.asarray(number, kind), many)

    scale = of_each(np.nan if full_scale is None else full_scale)
    arrays = (samples, counts, of_each(start), of_each(step), scale)
    if high_pass is not None:
        arrays = (*arrays, of_each(2.0 * np.pi * high_pass))
    return in_chunks(_picks, arrays)


@kept
def _picks(samples, counts, start, step, full_scale, high_pass=None) -> Pick:
    """Pick records as `picks_of` does, with an array for each number."""
    scale = full_scale[:, None]
    told = clipped_samples(samples, counts, scale)
    clipped = jnp.where(jnp.isnan(scale), clipped_samples(samples, counts, None), told)
    return pick_of(pick_lanes(samples, clipped, counts, high_pass), start, step)


def pick_of(
    lanes: LanePicks, start: Float[Array, "..."], step: Float[Array, "..."]
) -> Pick:
    """Return picks in seconds and pascals.

    Args:
        lanes: In samples.
        start: Time of the first sample [s].
        step: From one sample to the next [s].
    """
    natural, scale = lanes.natural, lanes.scale
    nan = jnp.full_like(scale, jnp.nan)

    def where_found(value):
        return jnp.where(lanes.found, value, nan)

    seconds = jnp.broadcast_to(step, scale.shape)
    in_units = jnp.ones((*scale.shape, 8), scale.dtype).at[:, 0].set(seconds)
    found = lanes.found[:, None, None]
    covariance = jnp.where(
        found, lanes.covariance * in_units[:, :, None] * in_units[:, None, :], jnp.nan
    )
    spread = jnp.sqrt(jnp.diagonal(covariance, axis1=1, axis2=2))
    front = lanes.front.astype(scale.dtype)
    high = lanes.offset + scale * lanes.clipped_level
    low = jnp.abs(lanes.offset - scale * lanes.clipped_level)
    longer = natural.suction_duration > LONG_SUCTION * natural.duration
    # of one as shallow as noise allows the duration tells nothing
    deep = natural.suction * natural.suction_duration > DEEP_SUCTION * natural.impulse
    longer &= deep
    return Pick(
        air_arrival_s=where_found(start + step * (front + natural.arrival)),
        peak_overpressure_pa=where_found(scale * natural.peak),
        positive_duration_s=where_found(step * natural.duration),
        positive_impulse_pa_s=where_found(scale * step * natural.impulse),
        decay=where_found(natural.decay),
        rise_time_s=where_found(step * natural.rise),
        negative_pressure_pa=where_found(scale * natural.suction),
        negative_duration_s=where_found(step * natural.suction_duration),
        covariance=covariance[:, :4, :4],
        spread=spread,
        found=lanes.found,
        converged=lanes.converged,
        lower_bound=lanes.clipped & ~(spread[:, 1] < UNTOLD),
        clipped_at_pa=jnp.where(
            lanes.clipped, high, jnp.where(lanes.clipped_low, low, nan)
        ),
        under_sampled=natural.duration < FEW_SAMPLES,
        sharp=natural.rise < 1.0,
        high_passed=lanes.passed | (lanes.found & longer & ~lanes.continued),
        shifted=lanes.shifted,
        front_alone=lanes.front_alone,
        resonating=lanes.rings,
        resonance_hz=jnp.where(
            lanes.rings, lanes.frequency / (2.0 * np.pi) / seconds, jnp.nan
        ),
        drifting=lanes.drifting,
        curving=lanes.curving,
        cut_short=lanes.cut_short,
        noise_known=lanes.noise_known,
        later_arrivals_s=where_found(start + step * (front + lanes.later))[:, None],
        later_sigmas_s=where_found(
            jnp.where(jnp.isnan(lanes.later), jnp.nan, step * lanes.later_sd)
        )[:, None],
        misfit=lanes.misfit,
        noise_pa=scale * lanes.noise,
        baseline_pa=lanes.offset + scale * lanes.level,
    )
