"""Which machinery flies a batch: programs of JAX, or a kernel of Warp.

On a CPU a program of JAX is the faster, on a GPU a kernel, which holds a whole flight
in registers. Only JAX has derivatives, and only JAX flies winds, loads and controllers
written in Python.
"""

import warnings

import jax
import numpy as np
from jax.core import Tracer

from jblast.errors import InputError
from jblast.vehicle.control.position_hold import PositionHold
from jblast.vehicle.loads.blast.load import BlastLoad
from jblast.vehicle.loads.gusts import FriedlanderGust, NWaveGust, StepGust
from jblast.vehicle.rollout.batching import own
from jblast.vehicle.rollout.flight import Flight

BUILT_IN = {
    "wind": (StepGust, NWaveGust, FriedlanderGust),
    "control": (PositionHold,),
    "loads": (BlastLoad,),
}
"""What the kernel knows."""


def flies_on_warp(backend: str, flight: Flight, dtype: np.dtype) -> bool:
    """Return whether the kernel flies; where JAX has to instead, a warning says so.

    Args:
        backend: "auto" (the kernel in float32 on a GPU), "jax", "warp" or
            "warp:DEVICE".
        flight: All of it.
        dtype: Its precision.

    Raises:
        InputError: Warp is asked for inside jit, vmap or grad.
    """
    if backend == "jax" or (backend == "auto" and jax.default_backend() != "gpu"):
        return False
    traced = any(isinstance(x, Tracer) for x in jax.tree.leaves(flight))
    if traced and backend == "auto":
        return False
    if traced:
        raise InputError(
            f"backend: expected auto or jax inside jit, vmap or grad, got {backend!r}, "
            "which has no derivatives"
        )
    unknown = _unknown(flight)
    if backend == "auto" and dtype != np.float32:
        unknown = f"precision {dtype.name}"
    if unknown:
        warnings.warn(f"{unknown}: flown by JAX, not by Warp", stacklevel=3)
    return not unknown


def _unknown(flight: Flight) -> str:
    """Return what the kernel cannot fly, in words; "" if nothing."""
    given = {"wind": [flight.wind], "control": [flight.control], "loads": flight.loads}
    for name, values in given.items():
        for value in map(own, values):
            if value is not None and not isinstance(value, BUILT_IN[name]):
                return f"{name} of the type {type(value).__name__}"
            if isinstance(value, PositionHold) and value.gains.motor_lead is not None:
                return "control with a motor_lead"
    return ""
