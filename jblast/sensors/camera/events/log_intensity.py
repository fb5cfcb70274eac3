r"""What an event pixel senses: the logarithm of linear light, with a floor.

$$L = \ln(\max(v, 0.5) / 255)$$

for a grey value $v$ of 0 to 255, the same for light $v / 255$ as a float. The floor is
half a grey step: where 8 bits say 0 they know no more.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jblast.sensors.camera.image.compositing import srgb_to_linear

DARKEST = 0.5 / 255.0
"""The floor, as a fraction of full scale."""


def log_intensity(light: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
    """Return the logarithm of linear light, full scale 1, not below the floor."""
    return jnp.log(jnp.maximum(jnp.asarray(light), DARKEST))


def grey_table(*, srgb: bool = False) -> Float[np.ndarray, "256"]:
    """Return the logarithm of each of the 256 grey values of an 8-bit image.

    Args:
        srgb: Whether the values are sRGB (IEC 61966-2-1) and not linear light.
    """
    value = np.arange(256) / 255.0
    light = srgb_to_linear(value) if srgb else value
    return np.log(np.maximum(light, DARKEST))
