r"""Linear light as a picture shows it: exposure by the level of light, and highlights.

Events are computed from linear light, without either.

Highlights. A picture cannot show light above full scale. Channels that are clipped one
by one change their hue: orange light becomes yellow, then white. Here all channels are
divided by the greatest, $p$, and mixed with white the more, the brighter they are:

$$c' = g\,\frac{c}{p} + 1 - g, \qquad g = \frac{1}{K_d\,(p - 1) + 1}, \qquad p > 1$$

This is the PBR Neutral curve of the Khronos Group with the start of compression
$K_s = 1$ and without its correction for reflections: light up to full scale is shown as
it is, so that frames remain measurements.

Exposure. The mean level of a picture follows the level of light. The key, the grey that
is shown for the mean luminance $Y$ [cd/m2], is

$$\alpha(Y) = 1.03 - \frac{2}{2 + \log_{10}(Y + 1)}$$

References:
    Khronos Group (2024), Khronos PBR Neutral Tone Mapper, specification
    (github.com/KhronosGroup/ToneMapping).
    Krawczyk, Myszkowski and Seidel (2005), Lightness perception in tone reproduction
    for high dynamic range images. Computer Graphics Forum 24(3): 635, eq. 11.
"""

import math
from typing import Any

import jax.numpy as jnp
import numpy as np

DESATURATION = 0.15
"""$K_d$ of the specification: at eight times full scale half of a colour is white."""

FULL_SUN = 3e4
"""Luminance of a white wall for which pictures have a gain of 1 [cd/m2]."""


def toned(light: Any) -> Any:
    """Return linear light within 0 to 1 that keeps its hue.

    Args:
        light: Grey or red, green, blue in the last axis, full scale 1; an array of
            NumPy or of JAX.

    Returns:
        An array of the same kind; light from 0 to 1 is unchanged.
    """
    xp: Any = np if isinstance(light, np.ndarray) else jnp
    light = xp.maximum(light, 0.0)
    peak = xp.maximum(light.max(axis=-1, keepdims=True), 1.0)
    part = 1.0 / (DESATURATION * (peak - 1.0) + 1.0)
    return part * (light / peak) + (1.0 - part)


def picture_gain(illuminance: float) -> float:
    """Return the gain of a picture of a scene, 1 in full sun.

    Args:
        illuminance: Of a level surface, by sky and sun [lx].
    """
    return _key(illuminance / math.pi) / _key(FULL_SUN)


def _key(luminance: float) -> float:
    return 1.03 - 2.0 / (2.0 + math.log10(luminance + 1.0))
