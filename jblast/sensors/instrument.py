r"""An instrument's effect on a signal: band, noise, full scale and bits.

The signal is filtered to the band between the instrument's corners, its noise is added,
and it is limited to the full scale and quantised, in this order, block by block.

Band. The filters are causal Butterworth filters. Each section is the analogue one with
its integrators replaced by trapezoidal sums (the bilinear transform, pre-warped so that
the corner keeps its frequency; Zavalishin 2012, "The Art of VA Filter Design", ch. 3
and 4). Its state is that of two integrators, $s = (s_1, s_2)$, which single precision
represents even if corners are far below the rate. A section is a linear system,

$$s_{i+1} = A s_i + b\,x_i, \qquad y_i = c \cdot s_i + d\,x_i$$

and so are `CHUNK` samples together: a triangular matrix of the impulse response acts on
the samples, and powers of $A$ on the state. These are matrix products, with one step
per chunk. The high-pass comes first.

Full scale $F$. Compressed, a signal $x$ becomes

$$y = x\,(1 + (x/F)^8)^{-1/8},$$

which is within 0.05 % of $x$ up to half of the full scale, smooth everywhere, 0.92 $F$
at the full scale and never above it.
"""

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float, Int, Key

from jblast.errors import require
from jblast.scene import Instrument
from jblast.sensors.noise import ColouredNoise, coloured_noise, white_noise
from jblast.types import as_numbers

CHUNK = 32
"""Samples that are filtered together: one matrix product and one step of the scan. It
divides `BLOCK`."""
SHARPNESS = 8
"""Exponent of the compression: larger is closer to clipping, smaller bends earlier. At
8 a signal of half the full scale is off by 0.05 %, below any calibration error."""
FAR_BEYOND = 1e4
"""Multiple of full scale at which a compressed signal equals it to the last bit: the
deficit is 1e-32 / 8. A larger input is limited to it, so that powers stay finite."""


class Section(NamedTuple):
    """A filter of second order, prepared for blocks.

    Attributes:
        response: Impulse response as a triangular matrix, chunk to chunk.
        heard: Effect of the state on each sample of a chunk.
        kept: Effect of each sample of a chunk on the state after it.
        power: $A^{CHUNK}$, effect of the state on the state after a chunk.
    """

    response: Float[Array, "chunk chunk"]
    heard: Float[Array, "chunk state"]
    kept: Float[Array, "state chunk"]
    power: Float[Array, "state state"]

    def filtered(
        self, state: Float[Array, " state"], samples: Float[Array, " sample"]
    ) -> tuple[Float[Array, " state"], Float[Array, " sample"]]:
        """Return the next state and the filtered samples of whole chunks."""
        chunks = samples.reshape(-1, CHUNK)

        def step(state, driven):
            return self.power @ state + driven, state

        # The scan carries only the state from chunk to chunk; the samples are filtered
        # in one product for all chunks.
        state, states = lax.scan(step, state, chunks @ self.kept.T)
        return state, (chunks @ self.response.T + states @ self.heard.T).reshape(-1)


class Chain(NamedTuple):
    """An instrument, prepared for blocks.

    Attributes:
        instrument: Description of the instrument.
        sections: Filters of its corners.
        key: Random key of its noise.
        noise: Coloured noise, or None.
    """

    instrument: Instrument
    sections: tuple[Section, ...]
    key: Key[Array, ""]
    noise: ColouredNoise | None

    def start(self) -> Any:
        """Return the initial state: at rest."""
        at_rest = tuple(jnp.zeros(2, one.power.dtype) for one in self.sections)
        return at_rest, None if self.noise is None else self.noise.start()

    def recorded(
        self, state: Any, index: Int[ArrayLike, ""], samples: Float[Array, " sample"]
    ) -> tuple[Any, Float[Array, " sample"]]:
        """Return the next state and the recorded samples of a block.

        Args:
            state: State after the last block, or `start`.
            index: Index of the block, from 0.
            samples: Signal at the sensor, [BLOCK].
        """
        of_sections, of_noise = state
        after = []
        for section, own in zip(self.sections, of_sections, strict=True):
            own, samples = section.filtered(own, samples)
            after.append(own)
        if self.noise is not None:
            of_noise, noise = self.noise.drawn(of_noise, index)
            samples = samples + noise
        elif self.instrument.noise is not None:
            samples = samples + self.instrument.noise * white_noise(self.key, index)
        return (tuple(after), of_noise), limited(samples, self.instrument)


def instrument_chain(instrument: Instrument, key: Key[Array, ""]) -> Chain:
    """Return a prepared instrument; its noise depends only on the key.

    Raises:
        InputError: A corner is not below half the rate. Corners are not checked
            inside `jit`.
    """
    sections = []
    for name in ("high_pass", "low_pass"):
        corner = getattr(instrument, name)
        if corner is None:
            continue
        if not isinstance(corner, Tracer):
            require(
                corner < instrument.rate / 2,
                name,
                f"a corner below half the rate of {instrument.rate:g} Hz",
                f"{corner:g} Hz",
            )
        sections.append(_section(instrument.rate, corner, name))
    noise = None
    if instrument.noise is not None and instrument.noise_slope is not None:
        noise = coloured_noise(
            key, instrument.rate, instrument.noise, instrument.noise_slope
        )
    return Chain(instrument, tuple(sections), key, noise)


@eqx.filter_jit
def _section(rate: float, corner: Float[ArrayLike, ""], name: str) -> Section:
    """Return a Butterworth filter of second order with -3 dB at its corner."""
    damping = math.sqrt(2.0)  # 1/Q of a Butterworth filter
    # the tangent pre-warps the corner, which the bilinear transform would shift
    gain = jnp.tan(jnp.pi / rate * as_numbers(corner))
    a1 = 1.0 / (1.0 + gain * (gain + damping))
    a2 = gain * a1
    a3 = gain * a2
    # outputs of the two integrators half a step later (Zavalishin's v1 and v2)
    band, low = jnp.stack([a1, -a2]), jnp.stack([a2, 1.0 - a3])
    a = 2.0 * jnp.stack([band, low]) - jnp.eye(2)
    b = 2.0 * jnp.stack([a2, a3])
    c, d = low, a3
    if name == "high_pass":
        c, d = -(damping * band + low), 1.0 - damping * a2 - a3
    last, powers = lax.scan(
        lambda power, _: (a @ power, power), jnp.eye(2, dtype=a.dtype), length=CHUNK
    )
    heard = c @ powers
    after = jnp.concatenate([d[None], heard[:-1] @ b])
    lag = np.arange(CHUNK)[:, None] - np.arange(CHUNK)[None, :]
    # Toeplitz and causal: no sample depends on later ones
    response = jnp.where(lag >= 0, after[np.maximum(lag, 0)], 0.0)
    return Section(response, heard, (powers @ b)[::-1].T, last)


def limited(
    samples: Float[Array, "..."], instrument: Instrument
) -> Float[Array, "..."]:
    """Return samples within the instrument's full scale, as multiples of its step.

    Codes range from -2^(bits-1) to 2^(bits-1) - 1, so the largest sample is one step
    below the full scale. The derivative is that of the signal before rounding: the true
    one is zero nearly everywhere.
    """
    full_scale = instrument.full_scale
    if full_scale is None:
        return samples
    if instrument.saturation == "compress":
        share = jnp.clip(samples / full_scale, -FAR_BEYOND, FAR_BEYOND)
        # scaled by the larger of both, so that all powers stay within single precision
        large = lax.stop_gradient(jnp.maximum(jnp.abs(share), 1.0))
        small = share / large
        power = small**SHARPNESS + large**-SHARPNESS
        samples = full_scale * small * power ** (-1 / SHARPNESS)
    return quantised(samples, full_scale, instrument.bits)


def quantised(
    samples: Float[Array, "..."], full_scale: Float[Array, ""], bits: int | None
) -> Float[Array, "..."]:
    """Return clipped samples, as multiples of the step of a converter if it has bits.

    Args:
        samples: The samples.
        full_scale: Largest magnitude.
        bits: Bits of the converter, or None.
    """
    if bits is None:
        return jnp.clip(samples, -full_scale, full_scale)
    step = full_scale / 2.0 ** (bits - 1)
    samples = jnp.clip(samples, -full_scale, full_scale - step)
    # Straight-through derivative: the true one would hide the signal from a fit.
    return samples + lax.stop_gradient(step * jnp.round(samples / step) - samples)


def clipping_level(instrument: Instrument) -> float:
    """Return the largest recorded magnitude; infinite if there is no limit.

    A compressed record saturated where the signal exceeded the full scale.
    """
    if instrument.full_scale is None:
        return math.inf
    return float(limited(jnp.asarray(instrument.full_scale), instrument))
