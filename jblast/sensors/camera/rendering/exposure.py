"""The light that a frame gathers while the shutter is open."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


def exposed(
    instant: Callable[[Float[Array, ""]], Float[Array, "height width channel"]],
    time: Float[Array, ""],
    exposure: Float[Array, ""],
    parts: int,
    nothing: Float[Array, "height width channel"],
) -> Float[Array, "height width channel"]:
    """Return the mean of instants in the middles of equal parts of an exposure.

    Args:
        instant: Returns what is seen at a time [s].
        time: When it begins [s].
        exposure: How long it lasts [s].
        parts: How many.
        nothing: An image of zeros.
    """

    def add(total, part):
        return total + instant(time + part * exposure), None

    middles = (jnp.arange(parts, dtype=time.dtype) + 0.5) / parts
    return jax.lax.scan(add, nothing, middles)[0] / parts
