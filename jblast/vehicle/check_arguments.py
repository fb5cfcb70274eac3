"""What a flight is asked for, looked at before anything is compiled."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jblast.errors import InputError, shown
from jblast.vehicle.control.gains import Gains
from jblast.vehicle.control.position_hold import Controller, PositionHold
from jblast.vehicle.control.step_limit import step_limit
from jblast.vehicle.dynamics.integrators import INTEGRATORS
from jblast.vehicle.dynamics.state import State
from jblast.vehicle.loads.blast.load import BlastLoad
from jblast.vehicle.loads.gusts import FriedlanderGust, NWaveGust, StepGust
from jblast.vehicle.quadrotor.parameters import Vehicle
from jblast.vehicle.rollout.batching import Each, own

VECTORS = {
    StepGust: "velocity_m_s",
    NWaveGust: "velocity_m_s",
    FriedlanderGust: "velocity_m_s",
    PositionHold: "target_m",
    BlastLoad: "wind_m_s",
}
"""What has three numbers where there is no batch."""


def check_choices(integrator: str, backend: str, store_every: int) -> None:
    """Refuse an integrator or backend that is not there, or a stride below one.

    Raises:
        InputError: One of them cannot be used.
    """
    if integrator not in INTEGRATORS:
        raise InputError(
            f"integrator: expected {' or '.join(INTEGRATORS)}, got {shown(integrator)}"
        )
    if backend not in ("auto", "jax", "warp") and not backend.startswith("warp:"):
        raise InputError(
            f"backend: expected auto, jax, warp or warp:DEVICE, got {shown(backend)}"
        )
    if store_every < 1:
        raise InputError(f"store_every: expected 1 or more steps, got {store_every}")


def check_times(
    duration_s: float, step_s: float, command_step_s: float | None, control: bool
) -> None:
    """Refuse times that are not positive, or a control period of no whole steps.

    Raises:
        InputError: One of them cannot be used.
    """
    times = {"duration_s": duration_s, "step_s": step_s}
    if command_step_s is not None:
        times["command_step_s"] = command_step_s
    for name, value in times.items():
        if not (math.isfinite(value) and value > 0):
            raise InputError(f"{name}: expected a positive time [s], got {value}")
    if control and command_step_s is not None:
        ratio = command_step_s / step_s
        if ratio < 0.5 or abs(ratio - round(ratio)) > 1e-6:
            raise InputError(
                "command_step_s: a controller's answer is held for a whole number of "
                f"steps of {step_s:g} s, got {command_step_s:g} s"
            )


def check_commands(
    commands: Float[Array, "..."],
    batch: tuple[int, ...],
    command_step_s: float,
    duration_s: float,
    control: bool,
) -> None:
    """Refuse commands of a wrong shape, or that end before the flight does.

    Raises:
        InputError: They cannot be used, or there is a controller as well.
    """
    if control:
        raise InputError("commands: expected none beside a controller, got both")
    shape = commands.shape
    if len(shape) < 2 or shape[-1] != 4 or shape[:-2] not in ((), batch):
        raise InputError(
            f"commands: expected the shape (time, 4), or {(*batch, 'time', 4)}, "
            f"got {shape}"
        )
    # the commands' clock and the flight's are rounded apart
    if shape[-2] * command_step_s < duration_s * (1 - 1e-9):
        raise InputError(
            f"commands: expected {duration_s:g} s, got {shape[-2]} of "
            f"{command_step_s:g} s, which end at {shape[-2] * command_step_s:g} s"
        )
    if not isinstance(commands, Tracer) and not np.all(np.isfinite(commands)):
        raise InputError("commands: expected finite rotor speeds, got nan or inf")


def check_start(
    vehicle: Vehicle, state: State, ground_up_m: float | int | None
) -> None:
    """Refuse a start below ground, and vehicles that do not go with the states.

    Raises:
        InputError: They cannot be used.
    """
    batch = state.position_m.shape[:-1]
    if 0 in batch:
        raise InputError(f"state: expected one vehicle or more, got a batch of {batch}")
    if vehicle.mass_kg.shape not in ((), batch):
        raise InputError(
            f"vehicle: expected one, or a batch of {batch} as in the state, got "
            f"{vehicle.mass_kg.shape}"
        )
    up = state.position_m[..., 2]
    if ground_up_m is None or any(isinstance(x, Tracer) for x in (up, ground_up_m)):
        return
    if not math.isfinite(ground_up_m):
        raise InputError(f"ground_up_m: expected a height [m], got {ground_up_m}")
    lowest = float(np.min(up))
    if lowest < ground_up_m:
        raise InputError(
            f"position_m: expected a start at or above the ground, {ground_up_m:g} m, "
            f"got {lowest:g} m"
        )


def check_step(
    vehicle: Vehicle,
    control: Controller | Each | None,
    integrator: str,
    step_s: float,
    period_s: float,
) -> None:
    """Refuse a step at which the motors, or the position hold, would swing up.

    Raises:
        InputError: The step is too large.
    """
    # whoever holds by gains, as a mission does, says so by the attribute
    gains = getattr(own(control), "gains", None)
    gains = gains if isinstance(gains, Gains) else None
    if isinstance(control, Each):
        gains = None  # a batch of gains: each lane that diverges is named
    looked_at = jax.tree.leaves((vehicle.motor_lag_s, gains))
    if any(isinstance(x, Tracer) for x in looked_at):
        return
    held = max(1, round(period_s / step_s))
    lags = np.unique(np.asarray(vehicle.motor_lag_s, float))
    limit = min(step_limit(integrator, lag, gains, held) for lag in lags[[0, -1]])
    if step_s > limit:
        what = f"a motor lag of {lags[0]:g} s"
        if gains is not None:
            what += f" and a position hold asked every {period_s:g} s"
        raise InputError(
            f"step_s: {integrator} is stable up to {limit:.4g} s with {what}, "
            f"got {step_s:g} s"
        )


def check_shared(given: Mapping[str, Sequence[Any]], batch: tuple[int, ...]) -> None:
    """Refuse what is given for other vehicles than those of the batch.

    The kernel takes the last column for every vehicle that has none of its own: without
    this it would fly an `Each` of too few, and say nothing.

    Args:
        given: Winds, loads, controllers by their name.
        batch: Axes of the state.

    Raises:
        InputError: An `Each` whose arrays do not begin with the batch's axes, or one
            beside a single vehicle; or arrays for many without `Each`.
    """
    for name, values in given.items():
        for value in values:
            if not isinstance(value, Each):
                _check_alone(name, value)
                continue
            if not batch:
                raise InputError(f"{name}: expected Each beside a batch, got one state")
            for array in filter(eqx.is_array, jax.tree.leaves(value)):
                if array.shape[: len(batch)] != batch:
                    raise InputError(
                        f"{name}: expected Each of arrays that begin with {batch}, as "
                        f"the state does, got {array.shape}"
                    )


def _check_alone(name: str, value: Any) -> None:
    """Refuse what is built in and has axes of a batch.

    Raises:
        InputError: It has.
    """
    field = next((n for kind, n in VECTORS.items() if isinstance(value, kind)), None)
    if field is not None and getattr(value, field).ndim != 1:
        raise InputError(
            f"{name}: expected {field} of the shape (3,), or a batch wrapped in Each, "
            f"got {getattr(value, field).shape}"
        )
