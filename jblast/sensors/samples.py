r"""Records and streams of samples from the same blocks, and their noise.

An instrument is a function of a block: its setup, the state after the last block (of
filters and noise) and the block's index give the next state and the samples. A record
consists of the first samples of consecutive blocks. A stream is the same blocks without
end, cut into packets of another size. All random numbers depend only on a key and the
index, so record and stream are equal, sample for sample.

Noise has a stated level and colour. Gaussian white noise is drawn from a key and the
block's index, and shaped by a filter of `BLOCK` + 1 taps whose response is the square
root of the requested spectrum. The spectrum rises by a slope of $s$ dB per octave,
$S \propto f^{s/3.01}$, above a corner, and is flat below it. The squares of the taps
add up to the square of the level, so that the rms is the level.
"""

import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from itertools import count
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, ArrayLike, Complex, Float, Int, Key

from jblast.types import as_float_array, as_float_arrays

BLOCK = 4096
"""Samples of a block: an FFT of twice this size is efficient, and at 48 kHz a block of
85 ms spans more than a period of `CORNER_HZ`, so that taps of a block resolve it."""
LARGEST_RATE = 2**31 // BLOCK
"""Largest whole rate [Hz] at which the start of a block is exact in 32-bit integers."""
Step = Callable[[Any, Any, Any], tuple[Any, Any]]
"""(setup, state, index) -> (next state, samples [BLOCK]); pure."""
CORNER_HZ = 20.0
"""Frequency below which coloured noise is flat [Hz]: the limit of hearing, and of most
microphones. A power law down to zero would have infinite power for falling spectra."""
DB_OF_OCTAVE = 10.0 * math.log10(2.0)
"""Rise per octave of a spectrum proportional to frequency [dB]."""


class Packet(NamedTuple):
    """Consecutive samples of a stream.

    Attributes:
        number: Number of the packet, from 0.
        first_sample: Number of its first sample, from the start of the stream.
        start_s: Start of that sample [s]; from whole numbers, so errors do not add up.
        samples: Samples in the unit of the sensor.
    """

    number: int
    first_sample: int
    start_s: float
    samples: Float[np.ndarray, " sample"]


def sample_count(duration_s: float, rate: float) -> int:
    """Return the number of samples of a record.

    Raises:
        ValueError: The duration is negative or not finite.
    """
    if not 0 <= duration_s < math.inf:
        raise ValueError(
            f"duration_s: expected a finite time of 0 s or more, got {duration_s:g} s"
        )
    return round(duration_s * rate)


def block_start(
    index: Int[ArrayLike, ""], rate: float
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return the start of a block since the first one [s]: whole seconds and remainder.

    Two numbers, because after minutes single precision no longer resolves one sample.
    Subtract the first from a time, then the second.
    """
    index = jnp.asarray(index)
    # the general case: one rounded product, whose error does not accumulate
    if rate != int(rate) or rate > LARGEST_RATE:
        start = index.astype(float) * (BLOCK / rate)
        whole = jnp.floor(start)
        return whole, start - whole
    whole_rate = int(rate)
    # `rate` blocks last exactly BLOCK seconds, so the index is reduced modulo the rate
    cycle, place = index // whole_rate, (index % whole_rate).astype(jnp.uint32)
    sample = place * np.uint32(BLOCK)
    whole = cycle.astype(float) * BLOCK + (sample // np.uint32(whole_rate)).astype(
        float
    )
    return whole, (sample % np.uint32(whole_rate)).astype(float) / whole_rate


def first_samples(
    step: Step, setup: Any, state: Any, n: int
) -> Float[Array, " sample"]:
    """Return the first samples of a signal.

    Args:
        step: Function of one block.
        setup: Setup of the instrument.
        state: Initial state.
        n: Number of samples.
    """
    _, samples = blocks(step, setup, state, jnp.arange(-(-n // BLOCK)))
    return samples.reshape(-1)[:n]


def packets(
    step: Step,
    setup: Any,
    state: Any,
    rate: float,
    *,
    packet_s: float | None = None,
    packets_hz: float | None = None,
    start_s: float = 0.0,
    run_blocks: Callable[[Any, Any, Int[np.ndarray, " block"]], Any] | None = None,
) -> Iterator[Packet]:
    """Yield the samples of a signal in packets, without end, in constant memory.

    If a packet's duration is no whole number of samples, its size varies by one:
    packet k starts with the first sample at or after k durations.

    Args:
        step: Function of one block.
        setup: Setup of the instrument.
        state: Initial state.
        rate: Sampling rate [Hz].
        packet_s: Duration of a packet [s]; or
        packets_hz: packets per second [Hz].
        start_s: Start of the first sample [s].
        run_blocks: Function of setup, state and indices of blocks in place of `blocks`.

    Raises:
        ValueError: Both or none of the durations are given, or a packet has no sample.
    """
    size = _packet_size(rate, packet_s, packets_hz)
    made_by = run_blocks or partial(blocks, step)

    # a nested generator, so that the arguments above are checked at the call already
    def run(state: Any) -> Iterator[Packet]:
        """Make blocks when they are needed."""
        parts: list[np.ndarray] = []
        numbers, first, waiting = count(), 0, 0
        for index in count():
            last = math.ceil((index + 1) * size)
            while waiting < last - first:
                block = np.array([next(numbers)])
                state, samples = made_by(setup, state, block)
                parts.append(np.asarray(samples).reshape(-1))
                waiting += BLOCK
            made = np.concatenate(parts)
            # a fraction: sums of a float step would drift over hours
            start = Fraction(start_s) + first / _exact(rate)
            yield Packet(index, first, float(start), made[: last - first])
            parts, waiting = [made[last - first :]], waiting - (last - first)
            first = last

    return run(state)


def _packet_size(
    rate: float, packet_s: float | None, packets_hz: float | None
) -> Fraction:
    """Return the samples of a packet as an exact fraction."""
    # one of the two defines the other
    if (packet_s is None) == (packets_hz is None):
        raise ValueError("expected either packet_s or packets_hz, got both or none")
    name = "packets_hz" if packet_s is None else "packet_s"
    given = packets_hz if packet_s is None else packet_s
    if given is None or not 0 < given < math.inf:
        raise ValueError(f"{name}: expected a positive finite number, got {given}")
    size = _exact(rate) * (1 / _exact(given) if packet_s is None else _exact(given))
    if size < 1:
        raise ValueError(
            f"{name}: expected one or more samples per packet at {rate:g} Hz, "
            f"got {given:g}"
        )
    return size


def _exact(number: float) -> Fraction:
    """Return a number as it is written: 0.1 is exactly a tenth."""
    return Fraction(repr(float(number)))


@eqx.filter_jit
def blocks(
    step: Step, setup: Any, state: Any, indices: Int[ArrayLike, " block"]
) -> tuple[Any, Float[Array, "block sample"]]:
    """Run the instrument over some blocks; compiled once for each number of blocks."""
    return lax.scan(lambda state, index: step(setup, state, index), state, indices)


class ColouredNoise(NamedTuple):
    """Noise, prepared for drawing.

    Attributes:
        key: Random key of its samples.
        response: Response of the colouring filter, at 0 to half the rate.
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
        corner: Frequency at which the slope starts [Hz].
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
    taps = as_float_array(level) * taps / jnp.sqrt(jnp.sum(taps**2))
    return ColouredNoise(key, jnp.fft.rfft(taps, 2 * BLOCK))


def noise_start(noise: ColouredNoise) -> Float[Array, " sample"]:
    """Return the initial state of coloured noise."""
    return white_noise(noise.key, 0)


def noise_block(
    noise: ColouredNoise, state: Float[Array, " sample"], index: Int[ArrayLike, ""]
) -> tuple[Float[Array, " sample"], Float[Array, " sample"]]:
    """Return the next state and a block of coloured noise."""
    white = white_noise(noise.key, jnp.asarray(index) + 1)
    # overlap-save: the taps reach one block back, so the second half has no wrap-around
    spectrum = jnp.fft.rfft(jnp.concatenate([state, white]))
    return white, jnp.fft.irfft(spectrum * noise.response)[BLOCK:]
