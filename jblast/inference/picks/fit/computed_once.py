"""What XLA would compute again wherever it is used, made so that it is computed once.

It fuses cheap and dear operations alike into the loops that use them: an exponential
into each of the seven slopes that hold it. What a loop or a product of matrices makes
it leaves alone.
"""

from collections.abc import Callable
from typing import TypeVar

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

Made = TypeVar("Made")


def in_halves(of: Callable[..., Made], x: Float[Array, " instant"]) -> Made:
    """Return a function of numbers, made by a loop over their two halves.

    Args:
        of: Elementwise; returns arrays as long as what it takes.
        x: The numbers.
    """
    count = x.shape[0]
    half = -(-count // 2)
    made = lax.map(of, jnp.pad(x, (0, 2 * half - count)).reshape(2, half))
    return jax.tree.map(lambda both: both.reshape(-1)[:count], made)
