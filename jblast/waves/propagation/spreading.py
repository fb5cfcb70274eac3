r"""How the level of sound falls because its energy spreads over a growing surface.

A loss is counted from the level that the charge would have at the reference range
$R_0$ in free air: the same level for both bursts, so that their losses compare. Linear
sound; the peak of a shock falls faster (`weak_shock`).
"""

import math

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.types import as_float_arrays
from jblast.waves.arguments import checked

HEMISPHERE_GAIN = 10.0 * math.log10(2.0)
"""Twice the intensity, root two in amplitude: 3.01 dB."""


@checked
def spherical_spreading_loss(
    slant_range: Float[ArrayLike, "..."],
    reference_range: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the loss of level of a source in free air [dB].

    $$L = 20 \lg (R/R_0)$$

    from amplitude as $1/R$: 6.02 dB each doubling. Below zero inside $R_0$.

    Args:
        slant_range: Range $R$ [m], positive.
        reference_range: Range $R_0$ where the level is known [m], positive.
    """
    slant_range, reference_range = as_float_arrays(slant_range, reference_range)
    return 20.0 * jnp.log10(slant_range / reference_range)


@checked
def hemispherical_spreading_loss(
    slant_range: Float[ArrayLike, "..."],
    reference_range: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the loss of level of a source on hard ground [dB].

    $$L = 20 \lg (R/R_0) - 10 \lg 2$$

    The same energy passes through half the sphere, so everywhere the level is 3.01 dB
    higher than that of the same source in free air. A level measured at $R_0$ on the
    ground has that gain in it already: then take `spherical_spreading_loss`. Ground
    that absorbs or moves keeps some of the gain, and a blast shares its own between
    pressure and duration: W counts as 2 W, the peak gains 2 dB, not 3.

    Args:
        slant_range: Range $R$ [m], positive.
        reference_range: Range $R_0$ of the level in free air [m], positive.
    """
    return spherical_spreading_loss(slant_range, reference_range) - HEMISPHERE_GAIN
