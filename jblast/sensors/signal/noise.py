r"""Noise of a stated level and colour, block by block.

Gaussian white noise is drawn from a key and the block's index, and shaped by a filter
of `BLOCK` + 1 taps whose response is the square root of the spectrum asked for. The
spectrum rises by a slope of $s$ dB an octave, $S \propto f^{s/3.01}$, above a corner,
and is flat below it; the squares of the taps add up to the level's, so that the rms is
the level.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Complex, Float, Int, Key

from jblast.sensors.signal.blocks import BLOCK
from jblast.types import as_float_array, as_float_arrays

CORNER_HZ = 20.0
"""Below it coloured noise is flat [Hz]: where hearing, and most microphones, begin."""

DB_OF_OCTAVE = 10.0 * math.log10(2.0)
"""By how much a spectrum proportional to frequency rises in an octave [dB]."""


class ColouredNoise(NamedTuple):
    """Noise that is set up to be drawn.

    Attributes:
        key: What its samples are drawn from.
        response: Of the filter that colours it, at 0 to half the rate.
    """

    key: Key[Array, ""]
    response: Complex[Array, " frequency"]


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
        corner: Where it starts [Hz].
    """
    frequency, slope = as_float_arrays(frequency, slope)
    octaves = jnp.log2(jnp.maximum(frequency, corner) / corner)
    return jnp.exp2(octaves * slope / DB_OF_OCTAVE)


def coloured_noise(
    key: Key[Array, ""],
    rate: float,
    level: Float[ArrayLike, ""],
    slope: Float[ArrayLike, ""],
) -> ColouredNoise:
    """Set noise of a colour up.

    Args:
        key: What its samples are drawn from.
        rate: Samples a second [Hz].
        level: Its rms.
        slope: Rise of its spectrum above 20 Hz [dB/octave].
    """
    frequency = jnp.linspace(0.0, 0.5 * rate, BLOCK + 1)
    amplitude = jnp.sqrt(power_spectrum(frequency, slope))
    amplitude = amplitude / jnp.max(amplitude)
    taps = jnp.roll(jnp.fft.irfft(amplitude, 2 * BLOCK), BLOCK // 2)[: BLOCK + 1]
    taps = taps * jnp.hanning(BLOCK + 1)  # without it, ripples about every corner
    taps = as_float_array(level) * taps / jnp.sqrt(jnp.sum(taps**2))
    return ColouredNoise(key, jnp.fft.rfft(taps, 2 * BLOCK))


def noise_start(noise: ColouredNoise) -> Float[Array, " sample"]:
    """Return the state that coloured noise starts with."""
    return white_noise(noise.key, 0)


def noise_block(
    noise: ColouredNoise, state: Float[Array, " sample"], index: Int[ArrayLike, ""]
) -> tuple[Float[Array, " sample"], Float[Array, " sample"]]:
    """Return the next state and a block of coloured noise."""
    white = white_noise(noise.key, jnp.asarray(index) + 1)
    spectrum = jnp.fft.rfft(jnp.concatenate([state, white]))
    return white, jnp.fft.irfft(spectrum * noise.response)[BLOCK:]
