r"""A picture without what is finer than the pixels that show it.

A picture shown smaller than it is has several texels a pixel; looked at between pixels
it would flicker. Its convolution with $[1, 2, 1]/4$, the texels then 1, 2, 4 ... apart,
has the variance $(4^n - 1)/6$ texels after $n$ times: that of a tent $2^n$ texels wide
less the one that is interpolated by. For a pixel $s$ texels wide the two next pictures
are mixed so that the variance is $(s^2 - 1)/6$ exactly: it makes the square of a disc's
radius, $R = 2\sigma$, larger by at most two thirds of a square pixel.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

LEVELS = 6
"""Of a picture of 128 texels there is one left."""


def low_passed(
    picture: Float[Array, "height width channel"], pitch: Float[Array, ""]
) -> Float[Array, "height width channel"]:
    """Return a picture without what is finer than a pixel.

    Continuous in the pitch, with a kink at the powers of two.

    Args:
        picture: Premultiplied linear light.
        pitch: Texels that a pixel is wide; up to one the picture stays as it is.
    """
    return jax.lax.cond(pitch > 1.0, _smoothed, lambda p, _: p, picture, pitch)


def _smoothed(picture, pitch):
    square = jnp.clip(jnp.square(pitch), 1.0, 4.0**LEVELS)
    found, level = jnp.zeros_like(picture), picture
    for n in range(LEVELS + 1):
        above = jnp.clip((4.0 ** (n + 1) - square) / (3.0 * 4.0**n), 0.0, 1.0)
        below = jnp.clip((square - 4.0 ** (n - 1)) / (3.0 * 4.0 ** (n - 1)), 0.0, 1.0)
        found = found + jnp.minimum(above, below) * level
        if n < LEVELS:
            level = _spread(_spread(level, 2**n, 0), 2**n, 1)
    return found


def _spread(image, step: int, axis: int):
    """Return the convolution with [1, 2, 1] / 4, so many texels apart."""
    length = image.shape[axis]
    if step >= length:
        return 0.5 * image
    room = [(0, 0)] * image.ndim
    room[axis] = (step, step)
    wide = jnp.pad(image, room)
    before = jax.lax.slice_in_dim(wide, 0, length, axis=axis)
    after = jax.lax.slice_in_dim(wide, 2 * step, 2 * step + length, axis=axis)
    return 0.5 * image + 0.25 * (before + after)
