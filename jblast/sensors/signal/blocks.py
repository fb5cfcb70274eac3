"""Records and streams of samples, both made of the same blocks.

An instrument is a function of a block: what it was set up with, the state that the last
block left (of filters, of noise) and the block's index give the next state and the
samples. A record is the first samples of such blocks in a row; a stream is the same
blocks, for ever, cut into packets of another size. Whatever is random depends on a key
and the index alone. So the two are equal, sample for sample.
"""

import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from itertools import count
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, ArrayLike, Float, Int

from jblast.sensors.signal.ring import Ring

BLOCK = 4096
"""Samples of a block."""

LARGEST_RATE = 2**31 // BLOCK
"""Up to this whole rate [Hz] the start of a block is exact in 32-bit integers."""

Step = Callable[[Any, Any, Any], tuple[Any, Any]]
"""(setup, state, index) -> (next state, samples [BLOCK]); pure."""


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

    Two numbers, because single precision cannot tell one sample from the next in one
    that counts minutes: subtract the first from a time, then the second.
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
