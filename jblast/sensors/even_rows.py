"""Some rows of many, taken out and put together again: in order where they lie so.

A gather or a scatter goes row by row on a CPU, at several times the price of a law; a
slice and what is put end to end are fused with what stands about them.
"""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Int

LONG = 1000
"""An array of more rows than these that is known beforehand is kept from XLA until the
program runs: it would compute with it, slowly, while it compiles."""


def opaque_constant(rows: np.ndarray) -> np.ndarray | Array:
    """Hide a long constant from XLA's constant folding (`LONG`)."""
    return lax.optimization_barrier(jnp.asarray(rows)) if rows.size > LONG else rows


def stride_of(rows: Int[np.ndarray, " some"]) -> int:
    """Return by how much each row is further than the one before; 0: not evenly."""
    if rows.size == 1:
        return 1
    steps = np.unique(np.diff(rows))
    return int(steps[0]) if steps.size == 1 and steps[0] > 0 else 0


def picked(x: Array, rows: Int[np.ndarray, " some"]) -> Array:
    """Return some rows of an array."""
    if step := stride_of(rows):
        return x[int(rows[0]) : int(rows[-1]) + 1 : step]
    return x[opaque_constant(rows)]


def joined(parts: Sequence[tuple[Int[np.ndarray, " _"], Array]], count: int) -> Array:
    """Return the sums of what parts give for each of so many rows, 0 where none does.

    Args:
        parts: Rows, each once, and what is there; of yes and no true where none gives
            one, and true where all do that give one.
        count: Of all rows.
    """
    yes = bool(parts) and parts[0][1].dtype == bool
    dtype = bool if yes else jnp.zeros(()).dtype
    parts = [(own, x.astype(dtype)) for own, x in parts]
    rows = np.concatenate([own for own, _ in parts]) if parts else np.zeros(0, int)
    if np.array_equal(np.sort(rows), np.arange(count)):
        whole = jnp.concatenate([x for _, x in parts])
        if np.array_equal(rows, np.arange(count)):
            return whole
        turns = [np.arange(n, count, len(parts)) for n in range(len(parts))]
        if count % len(parts) == 0 and np.array_equal(rows, np.concatenate(turns)):
            return jnp.stack([x for _, x in parts], axis=1).reshape(count)
        return whole[opaque_constant(np.argsort(rows))]
    whole = jnp.ones(count, bool) if yes else jnp.zeros(count)
    for own, x in parts:
        at = whole.at[opaque_constant(own)]
        whole = at.min(x) if yes else at.add(x)
    return whole
