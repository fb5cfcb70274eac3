"""What an instrument makes of the signal at its place, block by block.

The signal loses what is slower and faster than the instrument's corners, gains its
noise, is held to its full scale and rounded to its bits, in this order.
"""

from typing import Any, NamedTuple

from jaxtyping import Array, ArrayLike, Float, Int, Key

from jblast.scene import Instrument
from jblast.sensors.signal.causal_filter import (
    CausalFilter,
    causal_filter,
    filter_block,
    filter_start,
)
from jblast.sensors.signal.noise import (
    ColouredNoise,
    coloured_noise,
    noise_block,
    noise_start,
    white_noise,
)
from jblast.sensors.signal.quantise import quantised, saturated


class Chain(NamedTuple):
    """An instrument that is set up.

    Attributes:
        instrument: What it does.
        filter: Of its corners, if it has any.
        key: What its noise is drawn from.
        noise: That noise, if it has a colour.
    """

    instrument: Instrument
    filter: CausalFilter | None
    key: Key[Array, ""]
    noise: ColouredNoise | None


def instrument_chain(instrument: Instrument, key: Key[Array, ""]) -> Chain:
    """Set an instrument up; its noise comes from the key alone."""
    rate = instrument.rate
    high_pass, low_pass = instrument.high_pass, instrument.low_pass
    passing = noise = None
    if high_pass is not None or low_pass is not None:
        passing = causal_filter(rate, high_pass, low_pass)
    if instrument.noise is not None and instrument.noise_slope is not None:
        noise = coloured_noise(key, rate, instrument.noise, instrument.noise_slope)
    return Chain(instrument, passing, key, noise)


def chain_start(chain: Chain) -> Any:
    """Return the state that an instrument starts with: at rest."""
    return (
        None if chain.filter is None else filter_start(chain.filter),
        None if chain.noise is None else noise_start(chain.noise),
    )


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
    of_filter, of_noise = state
    if chain.filter is not None:
        of_filter, samples = filter_block(chain.filter, of_filter, samples)
    if chain.noise is not None:
        of_noise, noise = noise_block(chain.noise, of_noise, index)
        samples = samples + noise
    elif chain.instrument.noise is not None:
        samples = samples + chain.instrument.noise * white_noise(chain.key, index)
    written = quantised(saturated(samples, chain.instrument), chain.instrument)
    return (of_filter, of_noise), written
