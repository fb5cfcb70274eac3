r"""Noise of a stated level and colour, drawn block by block.

Gaussian white noise is drawn from a key and the block's index, and shaped by a filter
of `BLOCK` + 1 taps whose response is the square root of the requested spectrum. The
spectrum rises by a slope of $s$ dB per octave, $S \propto f^{s/3.01}$, above a corner,
and is flat below it. The squares of the taps add up to the square of the level, so that
the rms is the level. All random numbers depend only on a key and the index, so records
and streams of the same blocks are equal, sample for sample.
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Complex, Float, Int, Key

from jblast.types import as_float_arrays, as_numbers

BLOCK = 4096
"""Samples of a block: an FFT of twice this size is efficient, and at 48 kHz a block of
85 ms spans more than a period of `CORNER_HZ`, so that taps of a block resolve it."""
CORNER_HZ = 20.0
"""Frequency below which coloured noise is flat [Hz]: the limit of hearing, and of most
microphones. A power law down to zero would have infinite power for falling spectra."""
DB_OF_OCTAVE = 10.0 * math.log10(2.0)
"""Rise per octave of a spectrum proportional to frequency [dB]."""


class ColouredNoise(NamedTuple):
    """Noise, prepared for drawing.

    Attributes:
        key: Random key of its samples.
        response: Response of the colouring filter, at 0 to half the rate.
    """

    key: Key[Array, ""]
    response: Complex[Array, " frequency"]

    def start(self) -> Float[Array, " sample"]:
        """Return the initial state."""
        return white_noise(self.key, 0)

    def drawn(
        self, state: Float[Array, " sample"], index: Int[ArrayLike, ""]
    ) -> tuple[Float[Array, " sample"], Float[Array, " sample"]]:
        """Return the next state and the samples of a block."""
        white = white_noise(self.key, jnp.asarray(index) + 1)
        # overlap-save: the taps reach one block back, so the second half has no
        # wrap-around
        spectrum = jnp.fft.rfft(jnp.concatenate([state, white]))
        return white, jnp.fft.irfft(spectrum * self.response)[BLOCK:]


def white_noise(key: Key[Array, ""], index: Int[ArrayLike, ""]) -> Float[Array, "..."]:
    """Return a block of independent standard normal numbers [BLOCK]."""
    return jax.random.normal(jax.random.fold_in(key, index), (BLOCK,))


def power_spectrum(
    frequency: Float[ArrayLike, "..."],
    slope: Float[ArrayLike, ""],
    corner: float = CORNER_HZ,
) -> Float[Array, "..."]:
    """Return the spectrum of a colour, 1 up to the corner.

    Args:
        frequency: Frequency [Hz].
        slope: Rise above the corner [dB/octave].
        corner: Frequency at which the slope starts [Hz].
    """
    frequency, slope = as_float_arrays(frequency, slope)
    octaves = jnp.log2(jnp.maximum(frequency, corner) / corner)
    return jnp.exp2(octaves * slope / DB_OF_OCTAVE)


@eqx.filter_jit
def coloured_noise(
    key: Key[Array, ""],
    rate: float,
    level: Float[ArrayLike, ""],
    slope: Float[ArrayLike, ""],
) -> ColouredNoise:
    """Return noise of a colour, prepared for drawing.

    Args:
        key: Random key of its samples.
        rate: Sampling rate [Hz].
        level: Its rms.
        slope: Rise of its spectrum above 20 Hz [dB/octave].
    """
    frequency = jnp.linspace(0.0, 0.5 * rate, BLOCK + 1)
    amplitude = jnp.sqrt(power_spectrum(frequency, slope))
    # a rising or falling slope spans decades: scaled so that float32 keeps the small
    # end
    amplitude = amplitude / jnp.max(amplitude)
    # zero phase, shifted by half a block to be causal
    taps = jnp.roll(jnp.fft.irfft(amplitude, 2 * BLOCK), BLOCK // 2)[: BLOCK + 1]
    # a window: truncated taps would ripple about every corner of the spectrum
    taps = taps * jnp.hanning(BLOCK + 1)
    taps = as_numbers(level) * taps / jnp.sqrt(jnp.sum(taps**2))
    return ColouredNoise(key, jnp.fft.rfft(taps, 2 * BLOCK))
