"""A batch of lanes cut among devices, a chunk on each at a time."""

from collections.abc import Callable
from typing import TypeVar

import jax
from jaxtyping import Array, PyTree

from jblast.errors import InputError
from jblast.vehicle.rollout.batching import over_devices

T = TypeVar("T")

CHUNK = 1024
"""Lanes that a processor takes through all their steps before it takes the next: the
state of more does not stay in its cache, of fewer a block of those in a blast or at a
beginning is mostly empty."""


def in_chunks(
    function: Callable[[PyTree[Array]], T],
    lanes: PyTree[Array],
    chunk: int,
    devices: int,
) -> T:
    """Return what a function of a chunk of lanes gives for all of them.

    Args:
        function: Of arrays whose first axis are the lanes of a chunk; so are those that
            it returns.
        lanes: Of all.
        chunk: Lanes of a chunk.
        devices: Among how many chunks are shared.

    Raises:
        InputError: Lanes do not go up in chunks, or chunks in devices.
    """
    count = jax.tree.leaves(lanes)[0].shape[0]
    if count < 1 or count % (chunk * devices):
        raise InputError(
            f"lanes: expected a multiple of {chunk} times {devices} devices, got "
            f"{count:,}"
        )
    parts = jax.tree.map(lambda x: x.reshape(-1, chunk, *x.shape[1:]), lanes)

    def here(parts: PyTree[Array]) -> PyTree[Array]:
        return jax.lax.map(function, parts)

    found = over_devices(here, parts, devices)
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), found)
