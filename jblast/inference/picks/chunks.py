"""Records of a batch in chunks, over all devices: what is in hand stays in cache.

Each device runs a program of its own, side by side: partitioned as one program, the
small systems of equations of the search would be gathered from all devices.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
from jax.core import Tracer

LANES = (4, 32)
"""Records that are picked together: the least that suffices. Another number would be
another program."""

Made = TypeVar("Made")


def in_chunks(made_of: Callable[..., Made], arrays: tuple[Any, ...]) -> Made:
    """Return what a function makes of each record of a batch.

    Args:
        made_of: Of some records: takes and returns arrays with a first axis of lanes;
            compiled.
        arrays: Of all of them.
    """
    count = arrays[0].shape[0]
    each = next((lanes for lanes in LANES if lanes >= count), LANES[-1])
    chunks = -(-count // each)
    filled = tuple(_filled(x, chunks, each) for x in arrays)
    if any(isinstance(x, Tracer) for x in arrays):
        made = jax.lax.map(lambda one: made_of(*one), filled)
        return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:])[:count], made)
    devices = jax.devices()
    # none is waited for before the next has begun
    parts = []
    for k in range(chunks):
        device = devices[k % len(devices)]
        parts.append(made_of(*(jax.device_put(x[k], device) for x in filled)))
    parts = jax.device_put(parts, devices[0])
    return jax.tree.map(lambda *x: jnp.concatenate(x)[:count], *parts)


def _filled(x, chunks: int, each: int):
    """Return lanes by chunk, the last one again where there are none."""
    x = jnp.asarray(x)
    spare = chunks * each - x.shape[0]
    last = jnp.broadcast_to(x[-1:], (spare, *x.shape[1:]))
    return jnp.concatenate([x, last]).reshape(chunks, each, *x.shape[1:])
