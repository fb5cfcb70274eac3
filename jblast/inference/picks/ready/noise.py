r"""Noise of a record from its quiet part, and how it is made white.

The samples before the front, less a parabola, are an autoregression,
$n_i + \sum_k f_k n_{i-k} = e_i$ with $e$ white, by Burg's recursion (1975, "Maximum
entropy spectral analysis", Stanford): stable, and good for few samples. A reflection
coefficient that white noise would give as easily, below $2.5/\sqrt{n}$, is zero: so
white noise stays white, exactly.

A quiet part of fewer than `LEAST_QUIET` samples tells no colour: then the noise is
white, as large as the differences of neighbouring samples say, and the answer is told
to rest on that.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jblast.inference.picks.ready.bins import Bins

ORDER = 4
"""Of the autoregression."""

LEAST_QUIET = 24
"""Fewer samples before the front tell no colour of the noise."""

SIGNIFICANT = 2.5
"""Standard deviations of a reflection coefficient of white noise."""

LEAST_SIGMA = 1e-9
"""Noise is no less than this share of the largest sample."""


class Noise(NamedTuple):
    r"""What the noise of a record is.

    Attributes:
        taps: $1, f_1, \ldots$: what makes it white.
        sigma: Standard deviation of what is left then, $e$.
        marginal: Standard deviation of the noise itself.
        known: Whether there was a quiet part long enough.
        slope: Of the quiet part's drift, per sample.
    """

    taps: Float[Array, " tap"]
    sigma: Float[Array, ""]
    marginal: Float[Array, ""]
    known: Bool[Array, ""]
    slope: Float[Array, ""]


def noise_before(samples: Float[Array, " sample"], quiet: Int[Array, ""]) -> Noise:
    """Return the noise of the first samples.

    Args:
        samples: Of a record, as shares of its largest.
        quiet: How many of them came before anything else did.
    """
    n = samples.shape[0]
    index = jnp.arange(n)
    inside = (index < quiet).astype(samples.dtype)
    count = jnp.maximum(jnp.sum(inside), 1.0)
    left, slope = _less_parabola(samples, inside, count)
    taps, power = _burg(left, index, quiet, count)
    tiny = jnp.finfo(samples.dtype).tiny
    used = jnp.sum((taps[1:] != 0).astype(samples.dtype))
    # the parabola takes what is slow, of which slow noise has more than its share
    slow = power / jnp.maximum(jnp.sum(left * left) / count, tiny)
    slow = jnp.maximum(slow / jnp.square(jnp.sum(taps)), 1.0)
    freedom = jnp.maximum(count - 3.0 * slow - used, 0.3 * count)
    known = quiet >= LEAST_QUIET
    step = _least_step(samples)
    bits = step * step / 12.0
    marginal = jnp.sum(left * left) / freedom
    sigma2 = jnp.where(known, power * count / freedom, _of_differences(samples))
    taps = jnp.where(known, taps, jnp.zeros_like(taps).at[0].set(1.0))
    floor = LEAST_SIGMA**2
    sigma = jnp.sqrt(sigma2 + bits + floor)
    marginal = jnp.sqrt(jnp.where(known, marginal, sigma2) + bits + floor)
    return Noise(taps, sigma, marginal, known, slope)


def whitened(noise: Noise, samples: Float[Array, " sample"]) -> Float[Array, " sample"]:
    """Return samples through the taps; the first `ORDER` of them are of no use."""
    n = samples.shape[0]
    padded = jnp.concatenate([jnp.zeros(ORDER, samples.dtype), samples])
    total = jnp.zeros_like(samples)
    for k in range(ORDER + 1):
        total = total + noise.taps[k] * padded[ORDER - k : ORDER - k + n]
    return total


def whitened_means(
    noise: Noise,
    bins: Bins,
    means: Float[Array, " bin"],
    rings: Float[Array, " bin"] | float = 0.0,
    passed: Float[Array, " bin"] | float = 0.0,
) -> Float[Array, " bin"]:
    r"""Return means over bins through the taps.

    Exact where samples are bins of their own. In wider ones a smooth signal passes as
    $\sum_k f_k\,m(t - k) = G\,m - D\,m'$, with $G = \sum f_k$ and $D = \sum k f_k$.

    Args:
        noise: The taps.
        bins: Where the means are.
        means: All that is in them.
        rings: What of it is not smooth.
        passed: And that through the taps.
    """
    lags = np.arange(ORDER + 1).astype(means.dtype)
    gain, lag = jnp.sum(noise.taps), jnp.sum(noise.taps * lags)
    middle = bins.middle.astype(means.dtype)
    smooth = means - rings
    padded = jnp.concatenate([smooth[:1], smooth, smooth[-1:]])
    distance = np.diff(middle)
    about = np.concatenate([[distance[0]], distance, [distance[-1]]])
    slope = (padded[2:] - padded[:-2]) / (about[1:] + about[:-1]).astype(means.dtype)
    wide = gain * smooth - lag * slope + passed
    first, last = bins.single.start + ORDER, bins.single.stop
    fine = noise.taps[0] * means[first:last]
    for k in range(1, ORDER + 1):
        fine = fine + noise.taps[k] * means[first - k : last - k]
    return jnp.concatenate([wide[:first], fine, wide[last:]])


def _less_parabola(samples, inside, count):
    """Return the quiet part less a parabola, else zero; and its slope at the end."""
    n = samples.shape[0]
    x = jnp.arange(n).astype(samples.dtype) / count
    basis = jnp.stack([jnp.ones_like(x), x - 0.5, jnp.square(x - 0.5) - 1.0 / 12.0])
    masked = basis * inside[None, :]
    matrix = masked @ basis.T / count + 1e-12 * jnp.eye(3, dtype=samples.dtype)
    level = jnp.sum(samples * inside) / count
    moved = samples - level
    weights = jnp.linalg.solve(matrix, (masked @ moved)[:, None] / count)[:, 0]
    return (moved - weights @ basis) * inside, (weights[1] + weights[2]) / count


def _burg(left, index, quiet, count):
    """Return taps and power of what is left, by Burg's recursion."""
    forward, backward = left, left
    taps = jnp.zeros(ORDER + 1, left.dtype).at[0].set(1.0)
    power = jnp.sum(left * left) / count
    tiny = jnp.finfo(left.dtype).tiny
    for k in range(1, ORDER + 1):
        ahead = forward
        behind = jnp.concatenate([jnp.zeros(1, left.dtype), backward[:-1]])
        here = ((index >= k) & (index < quiet)).astype(left.dtype)
        both = jnp.sum(here * (ahead * ahead + behind * behind))
        found = -2.0 * jnp.sum(here * ahead * behind) / jnp.maximum(both, tiny)
        least = SIGNIFICANT / jnp.sqrt(count)
        reflection = jnp.where(jnp.abs(found) > least, found, 0.0)
        # turned about its own end
        turned = jnp.concatenate([taps[k::-1], taps[k + 1 :]])
        taps = taps + reflection * turned
        forward = (ahead + reflection * behind) * here
        backward = (behind + reflection * ahead) * here
        power = power * (1.0 - reflection * reflection)
    return taps, power


def _of_differences(samples):
    """Return the variance of white noise by neighbours, large differences left out."""
    size = jnp.square(samples[1:] - samples[:-1])
    mean = jnp.mean(size)
    for _ in range(3):
        near = (size <= 9.0 * mean).astype(size.dtype)
        mean = jnp.sum(near * size) / jnp.maximum(jnp.sum(near), 1.0)
    return 0.5 * mean


def _least_step(samples):
    """Return the smallest difference of neighbours, a bit if there are bits."""
    size = jax.lax.stop_gradient(jnp.abs(samples[1:] - samples[:-1]))
    some = jnp.min(jnp.where(size > 0, size, jnp.inf))
    return jnp.where(jnp.isfinite(some), some, 0.0)
