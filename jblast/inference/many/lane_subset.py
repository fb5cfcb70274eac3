"""Some lanes of a batch: which, taken out, and put back."""

from typing import TypeVar

import jax
import numpy as np
from jaxtyping import Array, Bool, Int

LEAST = 16
"""Fewer lanes are filled up to so many."""

Tree = TypeVar("Tree")


def lanes_where(wanted: Bool[Array, " lane"]) -> Int[np.ndarray, " some"]:
    """Return which lanes; the last again, so that few sizes are ever compiled."""
    lanes = np.flatnonzero(np.asarray(wanted))
    if lanes.size == 0:
        return lanes
    size = max(LEAST, 1 << (lanes.size - 1).bit_length())
    return np.pad(lanes, (0, size - lanes.size), mode="edge")


@jax.jit
def picked(tree: Tree, lanes) -> Tree:
    """Pick lanes of arrays whose last axis is the lane."""
    return jax.tree.map(lambda x: x[..., lanes], tree)


@jax.jit
def put(onto: Tree, new: Tree, lanes) -> Tree:
    """Put lanes in their places."""
    return jax.tree.map(lambda a, b: a.at[..., lanes].set(b), onto, new)
