"""Records of a batch in chunks, over all devices: what is in hand stays in cache."""

from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
from jax.core import Tracer
from jax.sharding import AxisType, PartitionSpec

LANES = 32
"""Records that are picked together, on each device."""

Made = TypeVar("Made")


def in_chunks(made_of: Callable[..., Made], arrays: tuple[Any, ...]) -> Made:
    """Return what a function makes of each record of a batch.

    Args:
        made_of: Of some records: takes and returns arrays with a first axis of lanes.
        arrays: Of all of them.
    """
    count = arrays[0].shape[0]
    traced = any(isinstance(x, Tracer) for x in arrays)
    devices = 1 if traced or count <= LANES else len(jax.devices())
    program = _program(made_of, devices)
    each = min(LANES, 1 << (max(count, 1) - 1).bit_length())
    block = each * devices
    chunks = -(-count // block)
    # few sizes are compiled: of a long batch, blocks of as many chunks at a time
    filled = [_filled(x, chunks * block, (chunks * devices, each)) for x in arrays]
    made = program(*filled)
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:])[:count], made)


def _filled(x, size: int, shape: tuple[int, int]):
    """Return lanes in chunks, the last one again where there are none."""
    x = jnp.asarray(x)
    last = jnp.broadcast_to(x[-1:], (size - x.shape[0], *x.shape[1:]))
    return jnp.concatenate([x, last]).reshape(*shape, *x.shape[1:])


@cache
def _program(made_of: Callable[..., Any], devices: int) -> Callable[..., Any]:
    """Return what goes through chunks one by one, on each device its share."""

    def here(*arrays):
        return jax.lax.map(lambda one: made_of(*one), arrays)

    if devices == 1:
        return jax.jit(here)
    mesh = jax.make_mesh((devices,), ("lane",), axis_types=(AxisType.Auto,))
    lane = PartitionSpec("lane")
    return jax.jit(
        jax.shard_map(here, mesh=mesh, in_specs=lane, out_specs=lane, check_vma=False)
    )
