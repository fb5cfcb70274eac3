"""A record made ready for the fit: its means over bins, whitened, and weights."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from jblast.inference.picks.ready.bins import Bins, bins_within, means_in_bins
from jblast.inference.picks.ready.front import Front, first_front
from jblast.inference.picks.ready.noise import ORDER, Noise, noise_before, whitened
from jblast.inference.picks.ready.start import BEFORE, Bank, start_of
from jblast.inference.picks.unknowns import CENTRE, Form

REACH = 4.5
"""The stretch that is fitted ends as many durations behind the front: past the negative
phase of the priors."""

LONGER = 24.0 / REACH
"""And of the stretch over which a high-pass is looked for: one with its corner at the
inverse of the duration shortens the positive phase fivefold, and this is 4.5 of the
durations before it."""

LEAST_REACH = 48
"""And at least as many samples."""


SHORTER = 0.5
"""A drift may pass for a suction, and a pulse and its suction for a longer pulse: a
second search begins from one of this share of the duration at most."""


class Case(NamedTuple):
    """One record for the fit. Integers are kept as floats, which have a zero slope.

    Attributes:
        white: Whitened means, in standard deviations.
        weight: Bins' weights: square root of their samples over sigma, zero: unused.
        noise: What made them white.
        level: Size that clipped bins have [share of the largest].
        clipped: +1 where the pressure was at least the level, -1 at most minus it.
        span: Half of the stretch, for the drift [samples].
        middle: Its middle [samples].
        centre: Where the unknowns are believed to be.
        rings: 1 where the sensor rings, else 0.
        follows: 1 where a further front does, else 0.
        passed: 1 where an untold high-pass is looked for, else 0.
        shifted: 1 where the baseline steps at the front, else 0.
        form: Formulas of the pulse.
        high_pass: Corner of a high-pass [1/sample]; None: there is none.
        hold: How much more firmly than believed ln duration stands at its centre.
    """

    white: Float[Array, " bin"]
    weight: Float[Array, " bin"]
    noise: Noise
    level: Float[Array, " bin"]
    clipped: Float[Array, " bin"]
    span: Float[Array, ""]
    middle: Float[Array, ""]
    centre: Float[Array, " unknown"]
    rings: Float[Array, ""]
    follows: Float[Array, ""]
    passed: Float[Array, ""]
    shifted: Float[Array, ""]
    form: Form
    high_pass: Float[Array, ""] | None
    hold: Float[Array, ""]


class Prepared(NamedTuple):
    """A case, and what it was made of.

    Attributes:
        case: For the fit.
        whole: The same over a stretch longer by `LONGER`.
        net: Net impulse over that [share of the largest, samples].
        net_sd: Its standard deviation; infinite where the record ends within the usual
            stretch, which may hold too little of the tail.
        start: Unknowns to begin with.
        shorter: Those of a pulse shorter by `SHORTER` or more.
        continued: Those of a pulse that continues below zero.
        front: As seen at first.
        offset: What was taken off the samples.
        scale: And what they were then divided by.
        clipped_at: Largest size of a clipped sample [share of the largest].
    """

    case: Case
    whole: Case
    net: Float[Array, ""]
    net_sd: Float[Array, ""]
    start: Float[Array, " unknown"]
    shorter: Float[Array, " unknown"]
    continued: Float[Array, " unknown"]
    front: Front
    offset: Float[Array, ""]
    scale: Float[Array, ""]
    clipped_at: Float[Array, ""]


def prepared(
    bins: Bins,
    bank: Bank,
    samples: Float[Array, " sample"],
    clipped: Float[Array, " sample"],
    count: Int[Array, ""],
    high_pass: Float[Array, ""] | None,
    longest: Float[ArrayLike, ""] = np.inf,
) -> Prepared:
    """Make a record ready.

    Args:
        bins: About the front.
        bank: To begin with.
        samples: Overpressure, finite.
        clipped: +1 where a sample is a lower bound, -1 an upper one, else 0.
        count: How many samples are the record's: the last of those repeats behind it.
        high_pass: Corner of a first-order high-pass [1/sample].
        longest: Duration of the longest pulse to begin with [samples].
    """
    front = first_front(lax.stop_gradient(samples - samples[0]))
    offset = _mean_of_first(samples, jnp.maximum(front.sample - 2, 1))
    moved = samples - offset
    scale = jnp.max(jnp.abs(moved))
    scale = jnp.where(scale > 0, scale, 1.0)
    share = moved / scale
    means = means_in_bins(bins, share, front.sample)
    start, duration = start_of(bank, lax.stop_gradient(means), longest)
    shorter, _ = start_of(bank, lax.stop_gradient(means), SHORTER * duration)
    continued, _ = start_of(bank, lax.stop_gradient(means), longest, continued=True)
    toe = 3.0 + 1.5 * jnp.exp(start[4]) + 0.02 * duration
    kept = jnp.maximum(front.sample - toe.astype(front.sample.dtype), front.sample // 2)
    noise = noise_before(share, kept)
    before = jnp.maximum(BEFORE * duration, 64.0).astype(front.sample.dtype)
    reach = jnp.maximum(REACH * duration, LEAST_REACH)
    first = jnp.maximum(front.sample - before, ORDER)
    bound, unusable = _clipped_bins(bins, clipped, front.sample)
    white = means_in_bins(bins, whitened(noise, share), front.sample)
    root = np.sqrt(bins.width).astype(samples.dtype)

    def until(reach):
        """Return the case of a stretch, and where that ends."""
        last = jnp.minimum(front.sample + reach.astype(front.sample.dtype), count)
        used = bins_within(bins, front.sample, first, last)
        weight = jnp.where(used & ~unusable, root / noise.sigma, 0.0)
        case = Case(
            white=weight * white,
            weight=weight,
            noise=noise,
            level=jnp.abs(means),
            clipped=jnp.where(used, bound, 0.0),
            span=0.5 * (last - first).astype(samples.dtype),
            middle=0.5 * (last + first).astype(samples.dtype)
            - front.sample.astype(samples.dtype),
            centre=jnp.asarray(CENTRE, samples.dtype),
            rings=jnp.zeros_like(scale),
            follows=jnp.zeros_like(scale),
            passed=jnp.zeros_like(scale),
            shifted=jnp.zeros_like(scale),
            form=Form(jnp.zeros_like(scale), jnp.zeros_like(scale)),
            high_pass=high_pass,
            hold=jnp.zeros_like(scale),
        )
        return case, last

    (case, last), (whole, end) = until(reach), until(LONGER * reach)
    index = jnp.arange(samples.shape[0])
    behind = (index >= kept) & (index < end)
    net = jnp.sum(jnp.where(behind, lax.stop_gradient(share), 0.0))
    length, quiet = ((end - kept).astype(scale.dtype), kept.astype(scale.dtype))
    # noise of zero frequency, over the stretch and of the zero before it
    slow = noise.sigma / jnp.abs(jnp.sum(noise.taps))
    net_sd = slow * jnp.sqrt(length + length * length / jnp.maximum(quiet, 1.0))
    net_sd = jnp.where(last < count, lax.stop_gradient(net_sd), jnp.inf)
    held = jnp.max(jnp.abs(share * clipped))
    starts = start, shorter, continued
    return Prepared(case, whole, net, net_sd, *starts, front, offset, scale, held)


def _mean_of_first(samples, count):
    """Return the mean of the first samples."""
    inside = (jnp.arange(samples.shape[0]) < count).astype(samples.dtype)
    first = samples[0]
    return first + jnp.sum((samples - first) * inside) / count.astype(samples.dtype)


def _clipped_bins(
    bins: Bins, clipped: Float[Array, " sample"], front: Int[Array, ""]
) -> tuple[Float[Array, " bin"], Bool[Array, " bin"]]:
    """Return which bins bound the pressure, and which cannot be whitened."""
    whole = means_in_bins(bins, clipped, front)
    bound = jnp.where(jnp.abs(whole) > 1.0 - 1e-6, jnp.sign(whole), 0.0)
    size = jnp.abs(clipped)
    near = size
    for k in range(1, ORDER + 1):
        near = jnp.maximum(near, jnp.concatenate([jnp.zeros(k, size.dtype), size[:-k]]))
    return bound, means_in_bins(bins, near, front) > 1e-9
