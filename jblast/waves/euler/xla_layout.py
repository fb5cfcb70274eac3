"""Materialise intermediates, so that XLA does not recompute them.

XLA fuses what it can, and what is shifted by a cell afterwards it works out again for
each neighbour that asks. On a CPU that is several times slower where fluxes become
differences over cells. A barrier is not enough there: it is gone before fusion begins,
and what remains in memory is what is joined of parts, ends and all. A GPU gains by
working things out again forward, but loses, as a CPU does, in the reverse pass, where
cells gather from faces.
"""

from typing import TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array

T = TypeVar("T")


def materialized(values: T) -> T:
    """Return the values, put into memory; on other machines than a CPU, backward only.

    Args:
        values: Arrays.
    """
    if jax.default_backend() == "cpu":
        return jax.lax.optimization_barrier(values)
    return jax.tree.map(
        lambda x: _backward(x) if jnp.issubdtype(x.dtype, jnp.floating) else x, values
    )


def worked_out_faces() -> slice:
    """Return at which faces fluxes are worked out: on a CPU at the two ends too.

    There they are dropped, for cutting the ends off first would undo the joining.
    """
    return slice(None) if jax.default_backend() == "cpu" else slice(1, -1)


@jax.custom_jvp
def _backward(values: Array) -> Array:
    return values


@_backward.defjvp
def _backward_jvp(primals, tangents):
    # The transpose of a barrier is a barrier, so reverse mode has it too.
    return primals[0], jax.lax.optimization_barrier(tangents[0])
