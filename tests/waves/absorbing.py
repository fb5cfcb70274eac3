import math

import jax.numpy as jnp

from jblast.waves.propagation import TAIL_S, absorption_transfer


def absorb(samples, rate, distance, temperature, pressure, humidity):
    """Return a signal that is zero before its first sample after absorption by air."""
    # a power of two for the transform; the padding keeps the end from wrapping round
    count = 2 ** math.ceil(math.log2(len(samples) + TAIL_S * rate + 1))
    transfer = absorption_transfer(
        count, rate, distance, temperature, pressure, humidity
    )
    spectrum = jnp.fft.rfft(samples, count)
    # in the precision of the samples, whatever that of the distance
    both = spectrum * transfer.astype(spectrum.dtype)
    return jnp.fft.irfft(both, count)[: len(samples)]
