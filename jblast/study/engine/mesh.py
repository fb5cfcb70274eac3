"""Devices among which samples are shared."""

import jax
import numpy as np
from jax.sharding import AxisType, Mesh

from jblast.errors import InputError

LANES = "lanes"
"""Axis of the mesh along which samples are shared."""


def mesh_of(devices: int | None = None) -> Mesh:
    """Return a mesh of the local devices, or of the first few.

    Raises:
        InputError: There are not as many.
    """
    there = jax.local_devices()
    if devices is not None and not 1 <= devices <= len(there):
        raise InputError(
            f"devices: expected a whole number from 1 to {len(there)}, which this "
            f"machine has, got {devices}"
        )
    return Mesh(np.array(there[:devices]), (LANES,), axis_types=(AxisType.Auto,))
