r"""Records and streams of samples, made of the same blocks, and their noise.

An instrument is a function of a block: its setup, the state that the last block left
(of filters and of noise) and the block's index give the next state and the samples. A
record is the first samples of such blocks in a row. A stream is the same blocks without
end, cut into packets of another size. All random numbers depend on a key and the index
alone. So the two are equal, sample for sample.

Noise has a stated level and colour. Gaussian white noise is drawn from a key and the
block's index, and shaped by a filter of `BLOCK` + 1 taps whose response is the square
root of the requested spectrum. The spectrum rises by a slope of $s$ dB an octave,
$S \propto f^{s/3.01}$, above a corner, and is flat below it. The squares of the taps
add up to the square of the level, so that the rms is the level.
"""

import math
from collections.abc import Callable, Iterator
from fractions import Fraction
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
"""Samples of a block."""
LARGEST_RATE = 2**31 // BLOCK
"""Up to this whole rate [Hz] the start of a block is exact in 32-bit integers."""
Step = Callable[[Any, Any, Any], tuple[Any, Any]]
"""(setup, state, index) -> (next state, samples [BLOCK]); pure."""
CORNER_HZ = 20.0
"""Below it coloured noise is flat [Hz]: where hearing, and most microphones, begin."""
DB_OF_OCTAVE = 10.0 * math.log10(2.0)
"""By how much a spectrum proportional to frequency rises in an octave [dB]."""


class Packet(NamedTuple):
    """Some samples in a row of a stream.

    Attributes:
        number: Of the packet, from 0.
        first_sample: Number of its first sample, from the start of the stream.
        start_s: When that one begins [s]; from whole numbers, so nothing adds up.
        samples: In the unit of the sensor.
    """

    number: int
    first_sample: int
    start_s: float
    samples: Float[np.ndarray, " sample"]


def sample_count(duration_s: float, rate: float) -> int:
    """Return how many samples a record of some duration has.

    Raises:
        ValueError: The duration is negative or not finite.
    """
    if not 0 <= duration_s < math.inf:
        raise ValueError(
            f"duration_s must be finite and not negative, got {duration_s:g} s"
        )
    return round(duration_s * rate)


def block_start(
    index: Int[ArrayLike, ""], rate: float
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return when a block starts, counted from the first [s]: whole seconds, and rest.

    Two numbers, because single precision does not resolve one sample from the next in
    one that counts minutes: subtract the first from a time, then the second.
    """
    index = jnp.asarray(index)
    if rate != int(rate) or rate > LARGEST_RATE:
        start = index.astype(float) * (BLOCK / rate)
        whole = jnp.floor(start)
        return whole, start - whole
    whole_rate = int(rate)
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
        step: The instrument, of one block.
        setup: What it was set up with.
        state: What it starts with.
        n: How many samples.
    """
    _, samples = _blocks(step, setup, state, jnp.arange(-(-n // BLOCK)))
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
) -> Iterator[Packet]:
    """Yield the samples of a signal in packets, for ever, in constant memory.

    Where no whole number of samples makes a packet, its size varies by one, so that
    packet k starts with the first sample at or past k times its duration.

    Args:
        step: The instrument, of one block.
        setup: What it was set up with.
        state: What it starts with.
        rate: Samples a second [Hz].
        packet_s: Duration of a packet [s]; or
        packets_hz: packets a second [Hz].
        start_s: When the first sample begins [s].

    Raises:
        ValueError: Both durations are given or none, or a packet has no sample.
    """
    size = _packet_size(rate, packet_s, packets_hz)

    def run(state: Any) -> Iterator[Packet]:
        """Make blocks as they are needed."""
        ring: Ring | None = None
        blocks, first = count(), 0
        for index in count():
            last = math.ceil((index + 1) * size)
            while ring is None or ring.waiting < last - first:
                block = jnp.asarray([next(blocks)])
                state, samples = _blocks(step, setup, state, block)
                made = np.asarray(samples).reshape(-1)
                ring = ring or Ring(math.ceil(size) + 1 + BLOCK, made.dtype)
                ring.write(made)
            start = Fraction(start_s) + first / _exact(rate)
            yield Packet(index, first, float(start), ring.read(last - first))
            first = last

    return run(state)


def _packet_size(
    rate: float, packet_s: float | None, packets_hz: float | None
) -> Fraction:
    """Return the samples of a packet, as exactly as its duration was written."""
    if (packet_s is None) == (packets_hz is None):
        raise ValueError("expected either packet_s or packets_hz")
    name = "packets_hz" if packet_s is None else "packet_s"
    given = packets_hz if packet_s is None else packet_s
    if given is None or not 0 < given < math.inf:
        raise ValueError(f"{name} must be positive and finite, got {given}")
    size = _exact(rate) * (1 / _exact(given) if packet_s is None else _exact(given))
    if size < 1:
        raise ValueError(
            f"{name} must leave a packet one sample or more at {rate:g} Hz, "
            f"got {given:g}"
        )
    return size


def _exact(number: float) -> Fraction:
    """Return a number as it is written: 0.1 is a tenth, not the float nearest to it."""
    return Fraction(repr(float(number)))


@eqx.filter_jit
def _blocks(
    step: Step, setup: Any, state: Any, indices: Int[Array, " block"]
) -> tuple[Any, Float[Array, "block sample"]]:
    """Run the instrument over some blocks; compiled once for each number of them."""
    return lax.scan(lambda state, index: step(setup, state, index), state, indices)


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


class Ring:
    """Samples between their producer and their consumer.

    Attributes:
        waiting: How many samples were written and not yet read.
    """

    def __init__(self, capacity: int, dtype: np.dtype | type = float):
        """Make an empty buffer for a number of samples."""
        if capacity < 1:
            raise ValueError(f"capacity must be one sample or more, got {capacity}")
        self._samples = np.zeros(capacity, dtype)
        self._first = 0
        self.waiting = 0

    @property
    def capacity(self) -> int:
        """Number of samples that fit in."""
        return self._samples.size

    def write(self, samples: Float[np.ndarray, " sample"]) -> None:
        """Append samples.

        Raises:
            ValueError: They do not fit; nothing is written then.
        """
        if self.waiting + samples.size > self.capacity:
            raise ValueError(
                f"expected at most {self.capacity - self.waiting} samples, which is "
                f"what fits, got {samples.size}"
            )
        at = (self._first + self.waiting + np.arange(samples.size)) % self.capacity
        self._samples[at] = samples
        self.waiting += samples.size

    def add(self, at: int, samples: Float[np.ndarray, " sample"]) -> None:
        """Add to samples that wait.

        Args:
            at: How many samples from the oldest the first one is.
            samples: What to add.

        Raises:
            ValueError: Some of them would not be among those that wait.
        """
        if at < 0 or at + samples.size > self.waiting:
            raise ValueError(
                f"expected samples within the {self.waiting} that wait, got "
                f"{samples.size} at {at}"
            )
        places = (self._first + at + np.arange(samples.size)) % self.capacity
        self._samples[places] += samples

    def read(self, count: int) -> Float[np.ndarray, " sample"]:
        """Take the oldest samples out.

        Raises:
            ValueError: There are fewer; nothing is taken then.
        """
        samples = self.peek(count)
        self._first = (self._first + count) % self.capacity
        self.waiting -= count
        return samples

    def peek(self, count: int) -> Float[np.ndarray, " sample"]:
        """Copy the oldest samples and leave them in.

        Raises:
            ValueError: There are fewer.
        """
        if not 0 <= count <= self.waiting:
            raise ValueError(
                f"expected 0 to {self.waiting} samples, which is what waits, "
                f"got {count}"
            )
        return self._samples[(self._first + np.arange(count)) % self.capacity]
