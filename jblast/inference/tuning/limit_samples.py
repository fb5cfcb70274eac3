r"""Samples at a recorder's limit: what stands there is known by all others alone.

With $K$ the inverse covariance of the noise, a circulant of $1/S(f)$, what was left at
some samples $a$ is likeliest, the others $b$ given, at

$$x_a = -K_{aa}^{-1} K_{ab}\,x_b$$

so that least squares of the filled record are those of the others: no sample counts
that holds nothing. A line between the samples before and after would count two of them
as often as there are samples between.
"""

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Int

MOST = 2048
"""Samples that are filled so; of more the matrix takes too long."""
TOGETHER = 64
"""Records share programs whose samples at the limit are as many of these."""


def padded_places(clipped: Bool[np.ndarray, " sample"]) -> Int[np.ndarray, " limit"]:
    """Return which samples are to be filled; none if they are too many.

    Behind them stand some past the end of the record, which are left out.
    """
    places = np.flatnonzero(clipped)
    if places.size > MOST or places.size == clipped.size:
        return np.zeros(0, int)
    more = -places.size % TOGETHER
    return np.pad(places, (0, more), constant_values=clipped.size)


def filling(
    places: Int[Array, " limit"], sd: Float[Array, " frequency"], count: int
) -> Float[Array, "limit limit"]:
    r"""Return $K_{aa}^{-1}$.

    Args:
        places: Samples at the limit.
        sd: Of the noise's Fourier coefficients; infinite where they are not looked at.
        count: Samples of the record.
    """
    if not places.size:
        return jnp.zeros((0, 0), sd.dtype)
    kernel = jnp.fft.irfft(jnp.square(1.0 / sd), count)
    inside = places < count
    both = inside[:, None] & inside[None, :]
    between = (places[:, None] - places[None, :]) % count
    own = kernel[0] * jnp.eye(places.size, dtype=sd.dtype)
    return jnp.linalg.inv(jnp.where(both, kernel[between], own))


def filled(
    left: Float[Array, " sample"],
    places: Int[Array, " limit"],
    sd: Float[Array, " frequency"],
    held: Float[Array, "limit limit"],
) -> Float[Array, " sample"]:
    """Return what is left, at samples at the limit what all others make likeliest.

    Args:
        left: What is left of a tapered record.
        places: Samples at the limit.
        sd: Of the noise's Fourier coefficients; infinite where they are not looked at.
        held: From `filling`.
    """
    if not places.size:
        return left
    others = left.at[places].set(0.0, mode="drop")
    of, share = jnp.fft.rfft(others), jnp.square(1.0 / sd)
    pulls = jnp.fft.irfft(lax.complex(share * of.real, share * of.imag), left.size)
    pulls = pulls.at[places].get(mode="fill", fill_value=0.0)
    return others.at[places].set(-held @ pulls, mode="drop")
