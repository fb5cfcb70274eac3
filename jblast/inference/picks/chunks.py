"""Records of a batch in chunks, over all devices: what is in hand stays in cache.

Each device runs a program of its own, side by side: partitioned as one program, the
small systems of equations of the search would be gathered from all devices.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
from jax.core import Tracer

from jblast.kept_programs import kept

LANES = 32
"""Records that are picked together."""

Made = TypeVar("Made")


def in_chunks(made_of: Callable[..., Made], arrays: tuple[Any, ...]) -> Made:
    """Return what a function makes of each record of a batch.

    Args:
        made_of: Of some records: takes and returns arrays with a first axis of lanes.
        arrays: Of all of them.
    """
    count = arrays[0].shape[0]
    traced = any(isinstance(x, Tracer) for x in arrays)
    devices = jax.devices()[:1] if traced or count <= LANES else jax.devices()
    each = min(LANES, 1 << (max(count, 1) - 1).bit_length())
    chunks = -(-count // (each * len(devices)))
    filled = [_filled(x, (len(devices), chunks, each)) for x in arrays]
    if traced:
        parts = [_mapped(made_of, *(x[0] for x in filled))]
    else:
        # none is waited for before the next has begun
        parts = [
            _mapped(made_of, *(jax.device_put(x[k], device) for x in filled))
            for k, device in enumerate(devices)
        ]
        parts = jax.device_put(parts, devices[0])
    flat = [jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), one) for one in parts]
    return jax.tree.map(lambda *x: jnp.concatenate(x)[:count], *flat)


def _filled(x, shape: tuple[int, int, int]):
    """Return lanes by device and chunk, the last one again where there are none."""
    x = jnp.asarray(x)
    spare = shape[0] * shape[1] * shape[2] - x.shape[0]
    last = jnp.broadcast_to(x[-1:], (spare, *x.shape[1:]))
    return jnp.concatenate([x, last]).reshape(*shape, *x.shape[1:])


@kept
def _mapped(made_of: Callable[..., Any], *arrays: Any) -> Any:
    """Go through chunks one by one."""
    return jax.lax.map(lambda one: made_of(*one), arrays)
