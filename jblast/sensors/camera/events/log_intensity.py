r"""Input of an event pixel: the logarithm of linear light, with a floor.

$$L = \ln \max(I, I_\mathrm{dark})$$

for light $I$, full scale 1. The floor $I_\mathrm{dark}$ depends on the source:

- Files of $b$ bits: half a step, $0.5 / (2^b - 1)$. A value of 0 is at most that.
- Floats have no step. Their floor is the dark level of a pixel, `DARKEST`.

References:
    Lichtsteiner, Posch and Delbruck (2008), A 128 x 128 120 dB 15 us latency
    asynchronous temporal contrast vision sensor. IEEE J. Solid-State Circuits 43(2):
    566, table 1.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jblast.sensors.camera.image.compositing import srgb_to_linear

DARKEST = 1e-6
"""Dark level of floats, as a fraction of full scale: 120 dB below it, the range of the
sensor of Lichtsteiner et al. (0.1 lux in a scene of 100,000 lux). Changes of darker
light give no events; a lower level gives events of light that its dark current hides.
"""


def darkest_of(bits: int | None) -> float:
    """Return the floor of files with a bit depth, full scale 1; None is floats."""
    return DARKEST if bits is None else 0.5 / ((1 << bits) - 1)


EIGHT_BITS = darkest_of(8)
"""The floor of grey values and colours of 8 bits."""


def log_intensity(
    light: Float[ArrayLike, "..."], darkest: float = DARKEST
) -> Float[Array, "..."]:
    """Return the logarithm of linear light, full scale 1, not below the floor.

    Args:
        light: Linear light, full scale 1.
        darkest: The floor, as a fraction of full scale (`darkest_of`).
    """
    return jnp.log(jnp.maximum(jnp.asarray(light), darkest))


def grey_table(
    *, srgb: bool = False, darkest: float = EIGHT_BITS
) -> Float[np.ndarray, "256"]:
    """Return the logarithm of each of the 256 grey values of an 8-bit image.

    Args:
        srgb: Whether the values are sRGB (IEC 61966-2-1) and not linear light.
        darkest: The floor, as a fraction of full scale.
    """
    return np.log(np.maximum(_grey_light(srgb), darkest))


def count_below(frames: np.ndarray, darkest: float, *, srgb: bool = False) -> int:
    """Return the number of values darker than a floor.

    Args:
        frames: Grey values of 8 bits, or linear light, full scale 1.
        darkest: The floor, as a fraction of full scale.
        srgb: Whether values of 8 bits are sRGB.
    """
    if frames.dtype == np.uint8:
        return int(np.count_nonzero(frames < (_grey_light(srgb) < darkest).sum()))
    return int(np.count_nonzero(frames < darkest))


def _grey_light(srgb: bool) -> Float[np.ndarray, "256"]:
    value = np.arange(256) / 255.0
    return srgb_to_linear(value) if srgb else value
