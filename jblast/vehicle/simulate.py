"""Fly a vehicle, or a batch of them."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, Float

from jblast.kept_programs import WIDE, kept
from jblast.vehicle.backend import flies_on_warp
from jblast.vehicle.check_arguments import (
    check_choices,
    check_commands,
    check_shared,
    check_start,
    check_step,
    check_times,
)
from jblast.vehicle.control.position_hold import Controller
from jblast.vehicle.dynamics.state import State, Trajectory
from jblast.vehicle.loads.load import Load, Pulse
from jblast.vehicle.quadrotor.numbers import floats, in_precision
from jblast.vehicle.quadrotor.parameters import Vehicle
from jblast.vehicle.rollout.batching import CHUNK_AXIS, Each, over_lanes, parted
from jblast.vehicle.rollout.flight import Flight, StoredRows
from jblast.vehicle.rollout.scan import fly
from jblast.vehicle.rollout.timetable import Ticks, stored_times, timetable

STEP_S = 5e-4
"""Step of the integrator where nothing is said [s]."""

Wind = Callable[[Float[Array, ""], Float[Array, "3"]], Float[Array, "3"]]


def simulate(
    vehicle: Vehicle,
    state: State,
    *,
    duration_s: float | int,
    step_s: float | int = STEP_S,
    integrator: str = "rk4",
    commands: Any = None,
    command_step_s: float | int | None = None,
    control: Controller | Each | None = None,
    wind: Wind | Each | None = None,
    loads: Sequence[Load | Pulse | Each] = (),
    ground_up_m: float | int | None = None,
    store_every: int = 1,
    backend: str = "auto",
) -> Trajectory:
    """Fly a vehicle through a wind and loads.

    Stages at both ends of a step see wind, loads and commands from inside it, so what
    jumps at an edge of a step is taken exactly. A batch has leading axes in the state,
    and may have the same in the vehicle and the commands; wind, loads and controller
    are shared unless they are wrapped in `Each`. A vehicle that diverges ends its own
    flight only. The precision is that of the state.

    Args:
        vehicle: The vehicle.
        state: Where it starts; the first row of the answer.
        duration_s: How long it flies; the last step is shorter if need be.
        step_s: Of the integrator.
        integrator: "rk4", or "euler", which is semi-implicit.
        commands: Rotor speeds asked for, (..., time, 4) [rad/s], clipped to what the
            motors can do; a surplus is ignored. With neither commands nor controller
            the speeds of the start are asked for.
        command_step_s: How long a command is held, a controller's too, for which it is
            a whole number of steps; one step where nothing is said.
        control: What commands the rotors, in place of `commands`.
        wind: Velocity of the air, east, north, up [m/s], from time [s] and position.
        loads: Other forces: functions (time_s, state, vehicle) that give force, world
            [N], and moment, body [N m], or pulses that tell their impulse.
        ground_up_m: Height of level ground, on which a vehicle that falls stays lying
            until its rotors lift it; None: no ground.
        store_every: Steps between two stored rows; start and end are always stored.
        backend: "jax"; "warp", a kernel on the first GPU or else the CPU;
            "warp:DEVICE", as "warp:cuda:1"; "auto": Warp in float32 on a GPU, else
            JAX. Derivatives, and winds, loads and controllers in Python, are JAX's.

    Raises:
        InputError: A number, a shape or a choice cannot be used; the start is below
            ground; the commands end too early; the step is too large; there is no such
            device.

    Warns:
        UserWarning: JAX flies in place of Warp.
    """
    duration_s, step_s = float(duration_s), float(step_s)
    command_step_s = None if command_step_s is None else float(command_step_s)
    check_choices(integrator, backend, store_every)
    check_times(duration_s, step_s, command_step_s, control is not None)
    batch, dtype = state.position_m.shape[:-1], jnp.result_type(*jax.tree.leaves(state))
    period = step_s if command_step_s is None else command_step_s
    if commands is not None:
        commands = floats(commands)
        check_commands(commands, batch, period, duration_s, control is not None)
    check_start(vehicle, state, ground_up_m)
    check_shared({"control": [control], "wind": [wind], "loads": loads}, batch)
    check_step(vehicle, control, integrator, step_s, period)

    def one_each(value: Any, alone: int) -> Any:
        """Wrap a value that has the batch's axes in front of its own."""
        return Each(value) if batch and alone else value

    flight = Flight(
        # a name would compile the program once more for each vehicle
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
    if flies_on_warp(backend, flight, dtype):
        from jblast.vehicle.warp.flight import KernelFlight

        flown = KernelFlight(
            flight,
            ticks,
            times,
            period,
            batch=batch,
            integrator=integrator,
            store_every=store_every,
            device=backend.partition(":")[2] or None,
        )
        flown.fly()
        return flown.trajectory()
    traced = any(isinstance(x, Tracer) for x in jax.tree.leaves((flight, ticks)))
    program = _FLY_WITHIN if traced else _FLY_EACH if batch else _FLY_ONE
    rows = program(
        flight,
        ticks,
        jnp.asarray(period, dtype),
        batch=batch,
        integrator=integrator,
        store_every=store_every,
        control_held=period > 1.5 * step_s,
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
    """Fly one vehicle, or each of a batch."""
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
"""Within another program, which has options of its own."""


@jax.jit
def _trajectory(time_s: Float[Array, " time"], rows: StoredRows) -> Trajectory:
    """Put the components of the rows together."""

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
