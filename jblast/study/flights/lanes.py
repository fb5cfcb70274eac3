"""Lanes of a batch of flights: taken out of it, and chunks of them put together."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from jblast.scene import Scene
from jblast.study.flights.records import Flown


def lanes_of(scenes: Scene, lanes: Int[np.ndarray, " lane"]) -> Scene:
    """Return some of a batch of scenes."""
    return jax.tree.map(lambda x: x[lanes], scenes)


def joined(parts: list[Flown], vehicles: int) -> Flown:
    """Put chunks together, without what filled up the last.

    Args:
        parts: What became of each chunk.
        vehicles: How many there are.
    """
    if vehicles == 1:
        return parts[0]

    def whole(*chunks: Array) -> Array:
        return jnp.concatenate(chunks)[:vehicles]

    return Flown(
        jax.tree.map(whole, *(part.metrics for part in parts)),
        jax.tree.map(whole, *(part.encounter for part in parts)),
        jax.tree.map(whole, *(part.exposure for part in parts)),
        whole(*(part.error_at_blast_m for part in parts)),
        whole(*(part.lost for part in parts)),
        None,
        jax.tree.map(whole, *(part.thrown for part in parts)),
    )
