r"""Full scale and bits: what of a signal can be written down.

Compressed, a signal $x$ becomes $x\,(1 + (x/F)^8)^{-1/8}$: within 0.05 % of itself up
to half of the full scale $F$, smooth everywhere, 0.92 $F$ at the full scale and never
beyond it.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float

from jblast.scene import Instrument

SHARPNESS = 8
"""Exponent of the compression."""

FAR_BEYOND = 1e4
"""Full scales at which a compressed signal is the full scale to the last bit."""


class Clipping(NamedTuple):
    """Whether a record saturated.

    Attributes:
        clipped: Whether any of its samples did: its peak is a lower bound then.
        level: Magnitude up to which a signal is written down; infinite: any.
    """

    clipped: Bool[Array, "..."]
    level: Float[Array, ""]


def saturated(
    samples: Float[Array, "..."], instrument: Instrument
) -> Float[Array, "..."]:
    """Return samples as large as the instrument can have them."""
    full_scale = instrument.full_scale
    if full_scale is None:
        return samples
    if instrument.saturation == "clip":
        return jnp.clip(samples, -full_scale, full_scale)
    share = jnp.clip(samples / full_scale, -FAR_BEYOND, FAR_BEYOND)
    # scaled by the larger of both, for powers that stay within single precision
    large = lax.stop_gradient(jnp.maximum(jnp.abs(share), 1.0))
    small = share / large
    power = small**SHARPNESS + large**-SHARPNESS
    return full_scale * small * power ** (-1 / SHARPNESS)


def quantised(
    samples: Float[Array, "..."], instrument: Instrument
) -> Float[Array, "..."]:
    """Return samples as whole numbers of the instrument's smallest step.

    Codes go from -2^(bits-1) to 2^(bits-1) - 1, so the largest sample is a step below
    the full scale. The slope is that of the signal, as if nothing were rounded: the
    true one is zero nearly everywhere and of no use.
    """
    if instrument.bits is None or instrument.full_scale is None:
        return samples
    codes = 2.0 ** (instrument.bits - 1)
    step = instrument.full_scale / codes
    limited = jnp.clip(samples, -instrument.full_scale, instrument.full_scale - step)
    return limited + lax.stop_gradient(step * jnp.round(limited / step) - limited)


def clipping(
    samples: Float[Array, "*batch sample"], instrument: Instrument
) -> Clipping:
    """Return whether a record saturated, and at what magnitude.

    A compressed one did where the signal was beyond the full scale.

    Args:
        samples: As the instrument wrote them.
        instrument: What wrote them.
    """
    if instrument.full_scale is None:
        never = jnp.zeros(samples.shape[:-1], bool)
        return Clipping(never, jnp.full((), jnp.inf, samples.dtype))
    level = instrument.full_scale
    if instrument.saturation == "compress":
        level = level * 2.0 ** (-1 / SHARPNESS)
    if instrument.bits is not None:
        level = level - instrument.full_scale / 2.0 ** (instrument.bits - 1)
    beyond = jnp.abs(samples) >= level * (1 - 4 * jnp.finfo(samples.dtype).eps)
    return Clipping(jnp.any(beyond, axis=-1), level)
