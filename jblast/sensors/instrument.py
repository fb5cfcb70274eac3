r"""An instrument's effect on a signal: band, noise, full scale and bits.

The signal is filtered to the band between the instrument's corners, its noise is added,
and it is limited to the full scale and quantised, in this order, block by block.

Band. The filters are causal Butterworth filters. Each section is the analogue one with
its integrators replaced by trapezoidal sums (the bilinear transform, pre-warped so that
the corner keeps its frequency; Zavalishin 2012, "The Art of VA Filter Design", ch. 3
and 4). Its state is that of two integrators, $s = (s_1, s_2)$, which single precision
represents even if corners are far below the rate. A cascade of them is one linear
system,

$$s_{i+1} = A s_i + b\,x_i, \qquad y_i = c \cdot s_i + d\,x_i$$

and so are `CHUNK` samples together: a triangular matrix of the impulse response acts on
the samples, and powers of $A$ on the state. These are matrix products, with one step
per chunk.

Full scale $F$. Compressed, a signal $x$ becomes

$$y = x\,(1 + (x/F)^8)^{-1/8},$$

which is within 0.05 % of $x$ up to half of the full scale, smooth everywhere, 0.92 $F$
at the full scale and never above it.
"""

import math
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Bool, Float, Int, Key

from jblast.scene import Instrument
from jblast.sensors.samples import (
    ColouredNoise,
    coloured_noise,
    noise_block,
    noise_start,
    white_noise,
)
from jblast.types import as_float_array

CHUNK = 32
"""Samples that are filtered together: one matrix product and one step of the scan."""
SHARPNESS = 8
"""Exponent of the compression: larger is closer to clipping, smaller bends earlier. At
8 a signal of half the full scale is off by 0.05 %, below any calibration error."""
FAR_BEYOND = 1e4
"""Multiple of full scale at which a compressed signal equals it to the last bit: the
deficit is 1e-32 / 8. A larger input is limited to it, so that powers stay finite."""


class CausalFilter(NamedTuple):
    """A filter, prepared for blocks.

    Attributes:
        response: Impulse response as a triangular matrix, chunk to chunk.
        heard: Effect of the state on each sample of a chunk.
        kept: Effect of each sample of a chunk on the state after it.
        powers: $A^0$ to $A^{CHUNK}$.
    """

    response: Float[Array, "chunk chunk"]
    heard: Float[Array, "chunk state"]
    kept: Float[Array, "state chunk"]
    powers: Float[Array, "power state state"]


class Chain(NamedTuple):
    """An instrument, prepared for blocks.

    Attributes:
        instrument: Description of the instrument.
        filter: Filter of its corners, or None.
        key: Random key of its noise.
        noise: Coloured noise, or None.
    """

    instrument: Instrument
    filter: CausalFilter | None
    key: Key[Array, ""]
    noise: ColouredNoise | None


def instrument_chain(instrument: Instrument, key: Key[Array, ""]) -> Chain:
    """Return a prepared instrument; its noise depends only on the key."""
    rate = instrument.rate
    high_pass, low_pass = instrument.high_pass, instrument.low_pass
    passing = noise = None
    if high_pass is not None or low_pass is not None:
        passing = causal_filter(rate, high_pass, low_pass)
    if instrument.noise is not None and instrument.noise_slope is not None:
        noise = coloured_noise(key, rate, instrument.noise, instrument.noise_slope)
    return Chain(instrument, passing, key, noise)


def chain_start(chain: Chain) -> Any:
    """Return the initial state of an instrument: at rest."""
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
    """Return the next state and the recorded samples of a block.

    Args:
        chain: The instrument.
        state: State after the last block, or `chain_start`.
        index: Index of the block, from 0.
        samples: Signal at the sensor, [BLOCK].
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


def causal_filter(
    rate: float,
    high_pass: Float[ArrayLike, ""] | None = None,
    low_pass: Float[ArrayLike, ""] | None = None,
) -> CausalFilter:
    """Return a Butterworth filter of second order with -3 dB at each corner.

    Args:
        rate: Sampling rate [Hz].
        high_pass: Corner below which it attenuates [Hz], or None.
        low_pass: Corner above which it attenuates [Hz], or None.

    Raises:
        ValueError: A corner is not between zero and half the rate. Corners are not
            checked inside `jit`.
    """
    # an empty system passes its input: sections are appended to it
    a, b, c, d = (
        jnp.zeros((0, 0)),
        jnp.zeros((0, 1)),
        jnp.zeros((1, 0)),
        jnp.ones((1, 1)),
    )
    for name, corner in (("high_pass", high_pass), ("low_pass", low_pass)):
        if corner is None:
            continue
        if not isinstance(corner, Tracer) and not np.all(
            (np.asarray(corner) > 0) & (np.asarray(corner) < rate / 2)
        ):
            raise ValueError(
                f"{name}: expected a corner above 0 and below half the rate of "
                f"{rate:g} Hz, got {float(np.asarray(corner)):g} Hz"
            )
        # the tangent pre-warps the corner, which the bilinear transform would shift
        gain = jnp.tan(jnp.pi / rate * as_float_array(corner))
        a2, b2, c2, d2 = _two_poles(gain, name)
        # in series: the system so far feeds the section
        nothing = jnp.zeros((a.shape[0], a2.shape[0]))
        a = jnp.block([[a, nothing], [b2 @ c, a2]])
        b = jnp.concatenate([b, b2 @ d])
        c, d = jnp.concatenate([d2 @ c, c2], axis=1), d2 @ d
    return _in_chunks(a, b, c, d)


def filter_start(filtering: CausalFilter) -> Float[Array, " state"]:
    """Return the initial state of a filter: at rest."""
    return jnp.zeros_like(filtering.heard[0])


def filter_block(
    filtering: CausalFilter,
    state: Float[Array, " state"],
    samples: Float[Array, " sample"],
) -> tuple[Float[Array, " state"], Float[Array, " sample"]]:
    """Return the next state and a filtered block of any length.

    Args:
        filtering: The filter.
        state: State after the last block, or `filter_start`.
        samples: Signal.
    """
    n = samples.shape[0]
    # the remainder is shorter than a chunk and takes the leading part of its matrices
    whole = n - n % CHUNK
    chunks = samples[:whole].reshape(-1, CHUNK)

    def step(state, driven):
        return filtering.powers[CHUNK] @ state + driven, state

    # The scan carries only the state from chunk to chunk; the samples are filtered in
    # one product for all chunks.
    state, states = lax.scan(step, state, chunks @ filtering.kept.T)
    filtered = chunks @ filtering.response.T + states @ filtering.heard.T
    rest = samples[whole:]
    if not (left := n - whole):
        return state, filtered.reshape(-1)
    end = filtering.response[:left, :left] @ rest + filtering.heard[:left] @ state
    state = filtering.powers[left] @ state + filtering.kept[:, CHUNK - left :] @ rest
    return state, jnp.concatenate([filtered.reshape(-1), end])


def _two_poles(gain, name: str):
    """Return $A, b, c, d$ of a second-order section."""
    damping = math.sqrt(2.0)  # 1/Q of a Butterworth filter
    a1 = 1.0 / (1.0 + gain * (gain + damping))
    a2 = gain * a1
    a3 = gain * a2
    # outputs of the two integrators half a step later (Zavalishin's v1 and v2)
    band, low = jnp.stack([a1, -a2]), jnp.stack([a2, 1.0 - a3])
    a = 2.0 * jnp.stack([band, low]) - jnp.eye(2)
    b = 2.0 * jnp.stack([a2, a3])[:, None]
    if name == "low_pass":
        return a, b, low[None, :], a3[None, None]
    c = -(damping * band + low)
    return a, b, c[None, :], (1.0 - damping * a2 - a3)[None, None]


def _in_chunks(a, b, c, d) -> CausalFilter:
    """Return a system's matrices for `CHUNK` samples together."""
    _, powers = lax.scan(
        lambda power, _: (a @ power, power), jnp.eye(a.shape[0]), length=CHUNK + 1
    )
    heard = (c @ powers[:CHUNK])[:, 0, :]
    after = jnp.concatenate([d[0], heard[: CHUNK - 1] @ b[:, 0]])
    lag = np.arange(CHUNK)[:, None] - np.arange(CHUNK)[None, :]
    # Toeplitz and causal: no sample depends on later ones
    response = jnp.where(lag >= 0, after[np.maximum(lag, 0)], 0.0)
    kept = (powers[:CHUNK] @ b)[::-1, :, 0].T
    return CausalFilter(response, heard, kept, powers)


class Clipping(NamedTuple):
    """Saturation of a record.

    Attributes:
        clipped: True if any of its samples saturated; its peak is then a lower bound.
        level: Largest recorded magnitude; infinite if there is no limit.
    """

    clipped: Bool[Array, "..."]
    level: Float[Array, ""]


def saturated(
    samples: Float[Array, "..."], instrument: Instrument
) -> Float[Array, "..."]:
    """Return samples limited to the instrument's full scale."""
    full_scale = instrument.full_scale
    if full_scale is None:
        return samples
    if instrument.saturation == "clip":
        return jnp.clip(samples, -full_scale, full_scale)
    share = jnp.clip(samples / full_scale, -FAR_BEYOND, FAR_BEYOND)
    # scaled by the larger of both, so that all powers stay within single precision
    large = lax.stop_gradient(jnp.maximum(jnp.abs(share), 1.0))
    small = share / large
    power = small**SHARPNESS + large**-SHARPNESS
    return full_scale * small * power ** (-1 / SHARPNESS)


def quantised(
    samples: Float[Array, "..."], instrument: Instrument
) -> Float[Array, "..."]:
    """Return samples as whole numbers of the instrument's smallest step.

    Codes range from -2^(bits-1) to 2^(bits-1) - 1, so the largest sample is one step
    below the full scale. The derivative is that of the signal before rounding: the true
    one is zero nearly everywhere.
    """
    if instrument.bits is None or instrument.full_scale is None:
        return samples
    codes = 2.0 ** (instrument.bits - 1)
    step = instrument.full_scale / codes
    limited = jnp.clip(samples, -instrument.full_scale, instrument.full_scale - step)
    # Straight-through derivative: the true one would hide the signal from a fit.
    return limited + lax.stop_gradient(step * jnp.round(limited / step) - limited)


def clipping(
    samples: Float[Array, "*batch sample"], instrument: Instrument
) -> Clipping:
    """Return whether a record saturated, and the level at which it does.

    A compressed record saturated where the signal exceeded the full scale.

    Args:
        samples: Recorded samples.
        instrument: Instrument that recorded them.
    """
    if instrument.full_scale is None:
        never = jnp.zeros(samples.shape[:-1], bool)
        return Clipping(never, jnp.full((), jnp.inf, samples.dtype))
    level = instrument.full_scale
    if instrument.saturation == "compress":
        # the output for an input of exactly the full scale
        level = level * 2.0 ** (-1 / SHARPNESS)
    if instrument.bits is not None:
        level = level - instrument.full_scale / 2.0 ** (instrument.bits - 1)
    # within 4 ulp: the limit itself is rounded when a sample is written
    beyond = jnp.abs(samples) >= level * (1 - 4 * jnp.finfo(samples.dtype).eps)
    return Clipping(jnp.any(beyond, axis=-1), level)
