"""Simulate the flight of a vehicle, or of a batch.

The arguments are checked before anything is compiled. The backend is a JAX program, or
the same step as a Warp kernel, which keeps a whole flight in registers: on a CPU JAX is
faster, on a GPU the kernel. Only JAX has derivatives.
"""

import dataclasses
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jblast.errors import InputError, shown
from jblast.kept_programs import WIDE, kept
from jblast.vehicle.c_code import Untranslatable
from jblast.vehicle.control.position_hold import Controller, Gains, PositionHold
from jblast.vehicle.control.stability import step_limit
from jblast.vehicle.loads.blast import BlastLoad
from jblast.vehicle.loads.load import FriedlanderGust, Load, NWaveGust, Pulse, StepGust
from jblast.vehicle.quadrotor import Vehicle, floats, in_precision
from jblast.vehicle.rollout import (
    CHUNK_AXIS,
    Each,
    Flight,
    StoredRows,
    Ticks,
    fly,
    over_lanes,
    parted,
    stored_times,
    timetable,
)
from jblast.vehicle.state import State, Trajectory

STEP_S = 5e-4
"""Default step of the integrator [s].

A tenth of the shortest motor lag of the named vehicles (5 ms, Hummingbird). Steps above
2.8 lags are unstable (`control.stability`); shorter ones cost time in proportion.
"""
Wind = Callable[[Float[Array, ""], Float[Array, "3"]], Float[Array, "3"]]
VECTORS = {
    StepGust: "velocity_m_s",
    NWaveGust: "velocity_m_s",
    FriedlanderGust: "velocity_m_s",
    PositionHold: "target_m",
    BlastLoad: "wind_m_s",
}
"""Name of the field of shape (3,) without a batch, by type."""


def simulate(
    vehicle: Vehicle,
    state: State,
    *,
    duration_s: float | int,
    step_s: float | int = STEP_S,
    commands: Any = None,
    command_step_s: float | int | None = None,
    control: Controller | Each | None = None,
    wind: Wind | Each | None = None,
    loads: Sequence[Load | Pulse | Each] = (),
    ground_up_m: float | int | None = None,
    store_every: int = 1,
    backend: str = "auto",
) -> Trajectory:
    """Simulate the flight of a vehicle, or of a batch, through a wind and loads.

    The stages at both ends of a step evaluate wind, loads and commands inside it, so
    jumps at a step's ends are exact. A batch has leading axes in the state, and may
    have the same in the vehicle and the commands; wind, loads and controller are shared
    unless they are wrapped in `Each`. A vehicle that diverges does not affect others.
    The precision is that of the state.

    Args:
        vehicle: The vehicle.
        state: Initial state; the first row of the trajectory.
        duration_s: Duration; the last step is shorter if necessary.
        step_s: Step of the integrator.
        commands: Rotor speed commands, (..., time, 4) [rad/s], clipped to the motors'
            limits; surplus rows are ignored. Default without a controller: the initial
            speeds.
        command_step_s: Duration of a command, and period of a controller, for which it
            is a whole number of steps (default: one step).
        control: Controller of the rotors, instead of `commands`.
        wind: Velocity of the air, east, north, up [m/s], from time [s] and position.
        loads: Other forces: functions (time_s, state, vehicle) that return force, world
            [N], and moment, body [N m], or pulses, which return their impulse.
        ground_up_m: Height of level ground, on which a fallen vehicle rests until its
            rotors lift it; None: no ground.
        store_every: Steps between two stored rows; start and end are always stored.
        backend: "jax"; "warp", a kernel on the first GPU or else the CPU;
            "warp:DEVICE", as "warp:cuda:1"; "auto": Warp in float32 on a GPU outside of
            jit, vmap and grad, else JAX.

    Raises:
        InputError: A number, a shape or an option is invalid; the start is below
            ground; the commands end too early; the step is too large; the device is
            unsupported.

    Warns:
        UserWarning: JAX is used instead of Warp, because an operation has no C code.
    """
    duration_s, step_s = float(duration_s), float(step_s)
    command_step_s = None if command_step_s is None else float(command_step_s)
    check_choices(backend, store_every)
    check_times(duration_s, step_s, command_step_s, control is not None)
    batch, dtype = state.position_m.shape[:-1], jnp.result_type(*jax.tree.leaves(state))
    period = step_s if command_step_s is None else command_step_s
    if commands is not None:
        commands = floats(commands)
        check_commands(commands, batch, period, duration_s, control is not None)
    check_start(vehicle, state, ground_up_m)
    check_shared({"control": [control], "wind": [wind], "loads": loads}, batch)
    check_step(vehicle, control, step_s, period)

    def one_each(value: Any, alone: int) -> Any:
        """Wrap a value that has the batch's axes in front of its own."""
        return Each(value) if batch and alone else value

    flight = Flight(
        # A name is static: every vehicle would compile the program once more.
        one_each(dataclasses.replace(vehicle, name=""), vehicle.mass_kg.ndim),
        one_each(state, len(batch)),
        commands if commands is None else one_each(commands, commands.ndim - 2),
        control,
        wind,
        tuple(loads),
        None if ground_up_m is None else floats(ground_up_m),
    )
    ticks = timetable(duration_s, step_s, period, dtype)
    times = stored_times(duration_s, step_s, store_every, dtype)
    flight = in_precision(flight, dtype)
    held = period > 1.5 * step_s
    if flies_on_warp(backend, flight, dtype):
        # Warp is imported only for a kernel.
        from jblast.vehicle import kernel

        try:
            return kernel.fly_on(
                kernel.device_named(backend.partition(":")[2] or None),
                flight,
                ticks,
                times,
                jnp.asarray(period, dtype),
                batch=batch,
                store_every=store_every,
                control_held=held,
            )
        except Untranslatable as missing:
            warnings.warn(f"{missing}: JAX is used instead of Warp", stacklevel=2)
    traced = any(isinstance(x, Tracer) for x in jax.tree.leaves((flight, ticks)))
    program = _FLY_WITHIN if traced else _FLY_EACH if batch else _FLY_ONE
    rows = program(
        flight,
        ticks,
        jnp.asarray(period, dtype),
        batch=batch,
        store_every=store_every,
        control_held=held,
        devices=1 if traced else jax.local_device_count(),
    )
    return _trajectory(times, rows)


def _fly_all(
    flight: Flight,
    ticks: Ticks,
    period_s: Float[Array, ""],
    *,
    batch: tuple[int, ...],
    devices: int,
    **options: Any,
) -> StoredRows:
    """Simulate one vehicle, or each of a batch."""
    if not batch:
        return fly(flight, ticks, period_s, **options)
    lanes, shared = parted(flight, batch)

    def one(lane: Any) -> StoredRows:
        return fly(
            eqx.combine(lane, shared), ticks, period_s, axis=CHUNK_AXIS, **options
        )

    rows = over_lanes(one, lanes, devices)
    return jax.tree.map(lambda x: x.reshape(*batch, *x.shape[1:]), rows)


_FLY_ONE = kept(_fly_all, **WIDE)
_FLY_EACH = eqx.filter_jit(_fly_all, **WIDE)
_FLY_WITHIN = eqx.filter_jit(_fly_all)
"""For calls within another traced program, whose compiler options apply."""


@jax.jit
def _trajectory(time_s: Float[Array, " time"], rows: StoredRows) -> Trajectory:
    """Return the trajectory of rows of components."""

    def together(parts: tuple[Array, ...]) -> Array:
        return jnp.stack(parts, axis=-1)

    force, moment = rows.wrench
    motion = rows.motion
    return Trajectory(
        time_s,
        together(motion.position),
        together(motion.velocity),
        together(motion.quaternion),
        together(motion.body_rate),
        together(motion.rotor_speed),
        together(force),
        together(moment),
        ~rows.alive[..., -1],
    )


def check_choices(backend: str, store_every: int) -> None:
    """Reject an unsupported backend, or a stride below one.

    Raises:
        InputError: An option is invalid.
    """
    if backend not in ("auto", "jax", "warp") and not backend.startswith("warp:"):
        raise InputError(
            f"backend: expected auto, jax, warp or warp:DEVICE, got {shown(backend)}"
        )
    if store_every < 1:
        raise InputError(f"store_every: expected 1 or more steps, got {store_every}")


def check_times(
    duration_s: float, step_s: float, command_step_s: float | None, control: bool
) -> None:
    """Reject times that are not positive and control periods of fractional steps.

    Raises:
        InputError: A time is invalid.
    """
    times = {"duration_s": duration_s, "step_s": step_s}
    if command_step_s is not None:
        times["command_step_s"] = command_step_s
    for name, value in times.items():
        if not (math.isfinite(value) and value > 0):
            raise InputError(f"{name}: expected a positive time [s], got {value}")
    if control and command_step_s is not None:
        ratio = command_step_s / step_s
        # 1e-6 allows for decimal fractions, as 0.004 over 0.0005.
        if ratio < 0.5 or abs(ratio - round(ratio)) > 1e-6:
            raise InputError(
                "command_step_s: expected a whole number of steps of "
                f"{step_s:g} s for a controller, got {command_step_s:g} s"
            )


def check_commands(
    commands: Float[Array, "..."],
    batch: tuple[int, ...],
    command_step_s: float,
    duration_s: float,
    control: bool,
) -> None:
    """Reject commands of a wrong shape, or shorter than the flight.

    Raises:
        InputError: The commands are invalid, or there is a controller as well.
    """
    if control:
        raise InputError("commands: expected commands or a controller, got both")
    shape = commands.shape
    if len(shape) < 2 or shape[-1] != 4 or shape[:-2] not in ((), batch):
        raise InputError(
            f"commands: expected the shape (time, 4), or {(*batch, 'time', 4)}, "
            f"got {shape}"
        )
    # Both products are rounded: 1e-9 allows for commands of exactly the flight's
    # length.
    if shape[-2] * command_step_s < duration_s * (1 - 1e-9):
        raise InputError(
            f"commands: expected {duration_s:g} s, got "
            f"{shape[-2] * command_step_s:g} s ({shape[-2]} of {command_step_s:g} s)"
        )
    if not isinstance(commands, Tracer) and not np.all(np.isfinite(commands)):
        raise InputError("commands: expected finite rotor speeds, got nan or inf")


def check_start(
    vehicle: Vehicle, state: State, ground_up_m: float | int | None
) -> None:
    """Reject a start below ground, and vehicles whose shape differs from the state's.

    Raises:
        InputError: The start, the vehicle or the ground is invalid.
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
    step_s: float,
    period_s: float,
) -> None:
    """Reject a step at which the motors or the position controller are unstable.

    Raises:
        InputError: The step is too large.
    """
    # All controllers with gains, missions included, have this attribute. A batch of
    # gains is not checked: vehicles that diverge are reported one by one.
    gains = None if isinstance(control, Each) else getattr(control, "gains", None)
    gains = gains if isinstance(gains, Gains) else None
    checked = jax.tree.leaves((vehicle.motor_lag_s, gains))
    if any(isinstance(x, Tracer) for x in checked):
        return
    held = max(1, round(period_s / step_s))
    lags = np.unique(np.asarray(vehicle.motor_lag_s, float))
    # The limit is monotonic in the lag without a controller; with one both extremes are
    # checked.
    limit = min(step_limit(lag, gains, held) for lag in lags[[0, -1]])
    if step_s > limit:
        what = f"a motor lag of {lags[0]:g} s"
        if gains is not None:
            what += f" and a position controller of period {period_s:g} s"
        raise InputError(
            f"step_s: RK4 is stable up to {limit:.4g} s with {what}, got {step_s:g} s"
        )


def check_shared(given: Mapping[str, Sequence[Any]], batch: tuple[int, ...]) -> None:
    """Reject winds, loads and controllers of another batch than the state's.

    Args:
        given: Winds, loads and controllers by argument name.
        batch: Axes of the state.

    Raises:
        InputError: The arrays of an `Each` do not begin with the batch's axes, or an
            `Each` comes with a single vehicle, or a batch of arrays without `Each`.
    """
    # Unchecked, the kernel would read beyond the end of an `Each` of too few values.
    for name, values in given.items():
        for value in values:
            if not isinstance(value, Each):
                field = next(
                    (n for kind, n in VECTORS.items() if isinstance(value, kind)), None
                )
                if field is not None and getattr(value, field).ndim != 1:
                    raise InputError(
                        f"{name}: expected {field} of the shape (3,), or a batch "
                        f"wrapped in Each, got {getattr(value, field).shape}"
                    )
                continue
            if not batch:
                raise InputError(f"{name}: expected a batch for Each, got one state")
            for array in filter(eqx.is_array, jax.tree.leaves(value)):
                if array.shape[: len(batch)] != batch:
                    raise InputError(
                        f"{name}: expected Each of arrays that begin with {batch}, as "
                        f"the state does, got {array.shape}"
                    )


def flies_on_warp(backend: str, flight: Flight, dtype: np.dtype) -> bool:
    """Return whether the flight uses a Warp kernel.

    Args:
        backend: "auto" (the kernel in float32 on a GPU), "jax", "warp" or
            "warp:DEVICE".
        flight: The flight.
        dtype: Precision of the flight.

    Raises:
        InputError: Warp is requested inside jit, vmap or grad.
    """
    traced = any(isinstance(x, Tracer) for x in jax.tree.leaves(flight))
    if backend == "auto":
        return jax.default_backend() == "gpu" and dtype == np.float32 and not traced
    if traced and backend != "jax":
        raise InputError(
            f"backend: expected auto or jax inside jit, vmap or grad, got {backend!r} "
            "(Warp flights have no derivatives)"
        )
    return backend != "jax"
