r"""One image over another, and between linear light and sRGB.

Alpha is laid over in linear light (Porter and Duff 1984, "over"):

$$\alpha = \alpha_1 + (1 - \alpha_1)\,\alpha_2, \qquad
\alpha\,C = \alpha_1 C_1 + (1 - \alpha_1)\,\alpha_2 C_2$$
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


def over(
    layer: Float[Array, "... 4"], background: Float[Array, "... channel"]
) -> Float[Array, "... channel"]:
    """Lay a layer over a background.

    Args:
        layer: Red, green, blue in linear light and straight alpha.
        background: The same, or opaque with three channels.

    Returns:
        As many channels as the background has; black where nothing is to be seen.
    """
    behind = background if background.shape[-1] == 4 else opaque(background)
    seen = over_premultiplied(premultiplied(layer), premultiplied(behind))
    return straight(seen) if background.shape[-1] == 4 else seen[..., :3]


def over_premultiplied(
    layer: Float[Array, "... 4"], background: Float[Array, "... 4"]
) -> Float[Array, "... 4"]:
    """Lay a layer over a background, both with colours times their alpha."""
    return layer + (1.0 - layer[..., 3:]) * background


def laid_over(
    seen: list[tuple[Float[Array, "4 row column"], Float[Array, ""]]],
) -> Float[Array, "4 row column"]:
    """Return premultiplied layers over each other, by how far away each is.

    Args:
        seen: Layers, channels first, and their distances in one unit.
    """
    layers, distances = zip(*seen, strict=True)
    if len(layers) == 1:
        return layers[0]
    stack = jnp.stack(layers)
    order = jnp.argsort(jnp.stack(distances), descending=True)
    whole = stack[order[0]]
    for nearer in order[1:]:
        layer = stack[nearer]
        whole = layer + (1.0 - layer[3])[None] * whole
    return whole


def opaque(image: Float[Array, "... 3"]) -> Float[Array, "... 4"]:
    """Return an image with alpha 1."""
    return jnp.concatenate([image, jnp.ones_like(image[..., :1])], axis=-1)


def premultiplied(image: Float[Array, "... 4"]) -> Float[Array, "... 4"]:
    """Return an image of straight alpha with its colours times their alpha."""
    alpha = image[..., 3:]
    return jnp.concatenate([image[..., :3] * alpha, alpha], axis=-1)


def straight(image: Float[Array, "... 4"]) -> Float[Array, "... 4"]:
    """Return an image of premultiplied alpha with straight; black where alpha is 0."""
    alpha = image[..., 3:]
    seen = alpha > 0
    colour = jnp.where(seen, image[..., :3] / jnp.where(seen, alpha, 1.0), 0.0)
    return jnp.concatenate([colour, alpha], axis=-1)


def srgb_to_linear(value: Any) -> Any:
    """Return the linear light of sRGB values; both have 1 for full scale.

    Negative values, and those above 1, go on along the same curve.

    Args:
        value: An array of NumPy or of JAX; the answer is of the same kind.

    References:
        IEC 61966-2-1.
    """
    xp = _namespace(value)
    bent = value > 0.04045
    above = ((xp.where(bent, value, 1.0) + 0.055) / 1.055) ** 2.4
    return xp.where(bent, above, value / 12.92)


def linear_to_srgb(light: Any) -> Any:
    """Return the sRGB values of linear light; the inverse of `srgb_to_linear`."""
    xp = _namespace(light)
    bent = light > 0.0031308
    above = 1.055 * xp.where(bent, light, 1.0) ** (1 / 2.4) - 0.055
    return xp.where(bent, above, 12.92 * light)


def _namespace(value: Any) -> Any:
    """Return NumPy for what is NumPy's, JAX for all else."""
    return np if isinstance(value, np.ndarray | np.generic) else jnp
