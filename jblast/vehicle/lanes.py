"""Flights of a batch: side by side in chunks, shared among the devices.

One program advances a chunk of vehicles at a time. On a CPU a chunk whose state stays
in the nearest cache is the fastest; a GPU takes the whole batch at once.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.sharding import AxisType, PartitionSpec
from jaxtyping import Array, PyTree

CHUNK = 128
"""Vehicles of a chunk on a CPU."""


class Each(eqx.Module):
    """One for each vehicle of a batch: arrays of `value` begin with the batch's axes.

    Wraps a wind, a load or a controller; without it all vehicles share one.
    """

    value: Any


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
            value = node.value if isinstance(node, Each) else node
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
        one: Of one lane's arguments.
        lanes: Arguments, a lane in each row.
        devices: Among how many the lanes are shared.
    """
    count = jax.tree.leaves(lanes)[0].shape[0]
    chunk = CHUNK if jax.default_backend() == "cpu" else count

    def here(lanes: PyTree[Array]) -> PyTree[Array]:
        if jax.tree.leaves(lanes)[0].shape[0] <= chunk:
            return jax.vmap(one)(lanes)
        return jax.lax.map(one, lanes, batch_size=chunk)

    if devices == 1 or count < devices * chunk:
        return here(lanes)
    # The last lane stands in for those that the devices lack.
    missing = -count % devices
    filled = jax.tree.map(
        lambda x: jnp.concatenate([x, jnp.repeat(x[-1:], missing, axis=0)]), lanes
    )
    mesh = jax.make_mesh((devices,), ("lane",), axis_types=(AxisType.Auto,))
    along = PartitionSpec("lane")
    spread = jax.shard_map(
        here, mesh=mesh, in_specs=along, out_specs=along, check_vma=False
    )
    return jax.tree.map(lambda x: x[:count], spread(filled))
