"""A picture's light at places between its pixels."""

import jax
import jax.numpy as jnp
from jax.scipy.ndimage import map_coordinates
from jaxtyping import Array, Float


def resampled(
    picture: Float[Array, "height width channel"],
    x: Float[Array, "row column"],
    y: Float[Array, "row column"],
) -> Float[Array, "channel row column"]:
    """Return a premultiplied picture at places between its pixels; beyond it nothing.

    Bilinear, and linear to nothing within a pixel of the edge. A picture that is shown
    several times smaller needs several rays a pixel.
    """
    height, width = picture.shape[:2]
    at = [jnp.clip(y, -2.0, height + 1.0), jnp.clip(x, -2.0, width + 1.0)]

    def one(channel):
        return map_coordinates(channel, at, order=1, mode="constant")

    return jax.vmap(one, in_axes=-1)(picture)
