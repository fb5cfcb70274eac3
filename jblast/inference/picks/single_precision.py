"""Numbers in single precision, twice as fast: enough to choose where a search begins.

What is tried there differs by far more than is rounded; the search itself, and all that
is told of where it ends, is in the precision of the record.
"""

from typing import TypeVar

import jax
import jax.numpy as jnp

Numbers = TypeVar("Numbers")


def in_single(numbers: Numbers) -> Numbers:
    """Return the arrays of a tree in single precision; what is no number as it is.

    Args:
        numbers: The tree.
    """

    def single(x):
        return x.astype(jnp.float32) if jnp.issubdtype(x.dtype, jnp.floating) else x

    return jax.tree.map(single, numbers)
