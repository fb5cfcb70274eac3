"""Flights of a batch: side by side in chunks, shared among the devices.

One program advances a chunk of vehicles at a time. On a CPU a chunk whose state stays
in the nearest cache is the fastest; a GPU takes the whole batch at once.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.sharding import AxisType, PartitionSpec
from jaxtyping import Array, PyTree

T = TypeVar("T")

CHUNK_BYTES = 512
"""Of one number for every vehicle of a chunk, on a CPU. XLA runs a loop over arrays up
to this size in order and in one thread; larger ones it hands from thread to thread, at
a cost above that of the few instructions that each of them takes."""
CHUNK_AXIS = "chunk"
"""Name of the axis of a chunk's vehicles."""


class Each(eqx.Module):
    """One for each vehicle of a batch: arrays of `value` begin with the batch's axes.

    Wraps a wind, a load or a controller; without it all vehicles share one.
    """

    value: Any


def own(node: Any) -> Any:
    """Return what an `Each` wraps, or the node itself."""
    return node.value if isinstance(node, Each) else node


def parted(arguments: PyTree, batch: tuple[int, ...]) -> tuple[PyTree, PyTree]:
    """Part what differs from vehicle to vehicle from what all share.

    Args:
        arguments: A PyTree, some of whose nodes are `Each`.
        batch: The batch's axes, which become one.

    Returns:
        The arrays of `Each` nodes, one axis in front, None elsewhere; and all the rest.
    """

    def of_each(keep_each: bool) -> PyTree:
        def part(node: Any) -> Any:
            if isinstance(node, Each) != keep_each and not isinstance(node, Each):
                return None
            value = own(node)
            if isinstance(node, Each):
                arrays, rest = eqx.partition(value, eqx.is_array)
                if not keep_each:
                    return rest
                count = len(batch)
                return jax.tree.map(lambda x: x.reshape(-1, *x.shape[count:]), arrays)
            return value

        return jax.tree.map(part, arguments, is_leaf=lambda x: isinstance(x, Each))

    return of_each(True), of_each(False)


def over_lanes(
    one: Callable[[PyTree], PyTree[Array]], lanes: PyTree[Array], devices: int
) -> PyTree[Array]:
    """Map a function over the first axis.

    Args:
        one: Of one lane's arguments; the chunk's axis is called `CHUNK_AXIS`.
        lanes: Arguments, a lane in each row.
        devices: Among how many the lanes are shared.
    """
    first = jax.tree.leaves(lanes)[0]
    count, most = first.shape[0], CHUNK_BYTES // first.dtype.itemsize
    if jax.default_backend() != "cpu":
        most = -(-count // devices)
    elif count < devices * most:
        devices = 1
    chunks = -(-count // (devices * most))
    size = -(-count // (devices * chunks))
    # The last lane stands in for those that fill up the last chunk.
    missing = devices * chunks * size - count

    def part(x: Array) -> Array:
        if missing:
            x = jnp.concatenate([x, jnp.repeat(x[-1:], missing, axis=0)])
        return x.reshape(devices * chunks, size, *x.shape[1:])

    def here(parts: PyTree[Array]) -> PyTree[Array]:
        return jax.lax.map(jax.vmap(one, axis_name=CHUNK_AXIS), parts)

    together = over_devices(here, jax.tree.map(part, lanes), devices)
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:])[:count], together)


def over_devices(
    function: Callable[[PyTree[Array]], T], parts: PyTree[Array], devices: int
) -> T:
    """Return what a function of some parts gives for all, shared among devices.

    Args:
        function: Of arrays whose first axis are parts; so are those that it returns.
        parts: As many for each device.
        devices: How many.
    """
    if devices == 1:
        return function(parts)
    mesh = jax.make_mesh((devices,), ("lane",), axis_types=(AxisType.Auto,))
    along = PartitionSpec("lane")
    spread = jax.shard_map(
        function, mesh=mesh, in_specs=along, out_specs=along, check_vma=False
    )
    return spread(parts)
