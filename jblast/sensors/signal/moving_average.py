r"""The averaging filter of the thesis, which smooths what the ground radiates.

A sample becomes the mean of those about it: of an odd number of them, $f_s / (2 f_c)$
or one more, and fewer than that at the ends, where only what there is is averaged. It
is not causal, so a front is heard half a window before it comes; beside it stands
`causal_filter.py`. Nor is $f_c$ its corner: it loses 3 dB at $0.886 f_c$, and all of
$2 f_c$.

Parab's thesis, algorithm 2, lines 33 to 36; that the window is odd, and that $f_c$ is
25 Hz, is read from the public plugin.
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.types import as_float_array

CUTOFF_HZ = 25.0
"""The plugin's $f_c$ [Hz]."""


def averaged_samples(rate: float, cutoff: float = CUTOFF_HZ) -> int:
    """Return how many samples are averaged: odd.

    Args:
        rate: Samples a second $f_s$ [Hz].
        cutoff: $f_c$ [Hz], positive.

    Raises:
        ValueError: The cut-off is not positive.
    """
    if not cutoff > 0:
        raise ValueError(f"cutoff must be positive, got {cutoff:g} Hz")
    return int(rate / (2 * cutoff)) // 2 * 2 + 1


def moving_average(
    samples: Float[ArrayLike, " sample"],
    rate: float,
    cutoff: float = CUTOFF_HZ,
) -> Float[Array, " sample"]:
    """Return the mean of the samples about each.

    Args:
        samples: Of a signal.
        rate: Samples a second [Hz].
        cutoff: What the thesis calls cut-off $f_c$ [Hz].
    """
    samples = as_float_array(samples)
    n, half = samples.shape[0], averaged_samples(rate, cutoff) // 2
    # no running sum: in single precision it loses a quiet end behind a loud start
    window = jnp.ones(2 * half + 1, samples.dtype)
    sums = jnp.convolve(jnp.pad(samples, half), window, mode="valid")
    place = jnp.arange(n)
    counted = jnp.minimum(place, half) + jnp.minimum(n - 1 - place, half) + 1
    return sums / counted.astype(samples.dtype)
