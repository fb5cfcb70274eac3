"""Records of a batch in chunks, over all devices: what is in hand stays in cache.

Each device runs a program of its own, side by side: partitioned as one program, the
small systems of equations of the search would be gathered from all devices.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import numpy as np
from jax.core import Tracer

LANES = 32
"""Records that are picked together. Another number would be another program."""

Made = TypeVar("Made")


def in_chunks(made_of: Callable[..., Made], arrays: tuple[Any, ...]) -> Made:
    """Return what a function makes of each record of a batch.

    Args:
        made_of: Of some records: takes and returns arrays with a first axis of lanes;
            compiled. Of lanes that are all zeros nothing is asked.
        arrays: Of all of them.
    """
    if any(isinstance(x, Tracer) for x in arrays):
        return made_of(*arrays)
    count = arrays[0].shape[0]
    chunks = max(-(-count // LANES), 1)  # of no record, too, to tell of what shape
    filled = tuple(_filled(np.asarray(x), chunks) for x in arrays)
    devices = jax.devices()
    # none is waited for before the next has begun
    parts = []
    for k in range(chunks):
        device = devices[k % len(devices)]
        parts.append(made_of(*(jax.device_put(x[k], device) for x in filled)))
    # by NumPy, which compiles nothing for another number of records
    parts = jax.tree.map(np.asarray, parts)
    return jax.tree.map(lambda *x: jax.device_put(np.concatenate(x)[:count]), *parts)


def _filled(x: np.ndarray, chunks: int) -> np.ndarray:
    """Return lanes by chunk, zeros where there are none."""
    none = np.zeros((chunks * LANES - x.shape[0], *x.shape[1:]), x.dtype)
    return np.concatenate([x, none]).reshape(chunks, LANES, *x.shape[1:])
