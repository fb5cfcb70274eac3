"""What an instrument makes of the signal at its place, block by block.

The signal loses what is slower and faster than the instrument's corners, gains its
noise, is held to its full scale and rounded to its bits, in this order.
"""

from typing import Any, NamedTuple

from jaxtyping import Array, ArrayLike, Float, Int, Key

from jblast.scene import Instrument
from jblast.sensors.signal.noise import (
    ColouredNoise,
    coloured_noise,
    noise_block,
    noise_start,
)
from jblast.sensors.signal.quantise import quantised, saturated


class Chain(NamedTuple):
    """An instrument that is set up.

    Attributes:
        instrument: What it does.
        noise: Its own noise, if it has any.
    """

    instrument: Instrument
    noise: ColouredNoise | None


def instrument_chain(instrument: Instrument, key: Key[Array, ""]) -> Chain:
    """Set an instrument up; its noise comes from the key alone."""
    if instrument.noise is None:
        return Chain(instrument, None)
    level, slope = instrument.noise, instrument.noise_slope
    return Chain(instrument, coloured_noise(key, instrument.rate, level, slope))


def chain_start(chain: Chain) -> Any:
    """Return the state that an instrument starts with: at rest."""
    return None if chain.noise is None else noise_start(chain.noise)


def chain_block(
    chain: Chain,
    state: Any,
    index: Int[ArrayLike, ""],
    samples: Float[Array, " sample"],
) -> tuple[Any, Float[Array, " sample"]]:
    """Return the next state, and what is written down of a block.

    Args:
        chain: The instrument.
        state: What the last block left, or `chain_start`.
        index: Of the block, from 0.
        samples: Of the signal at its place, [BLOCK].
    """
    if chain.noise is not None:
        state, noise = noise_block(chain.noise, state, index)
        samples = samples + noise
    return state, quantised(saturated(samples, chain.instrument), chain.instrument)
