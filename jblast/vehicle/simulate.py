"""Simulate the flight of a vehicle, or of a batch.

The arguments are checked before anything is compiled. The backend is a JAX program, or
the same step as a Warp kernel, which keeps a whole flight in registers: on a CPU JAX is
faster, on a GPU the kernel. Only JAX has derivatives.
"""

import dataclasses
import math
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jblast.errors import require, shown
from jblast.kept_programs import WIDE, kept
from jblast.vehicle.c_code import Untranslatable
from jblast.vehicle.control.position_hold import Controller, Gains
from jblast.vehicle.control.stability import step_limit
from jblast.vehicle.loads.load import Load, Pulse
from jblast.vehicle.quadrotor import Vehicle, floats, in_precision
from jblast.vehicle.rollout import (
    CHUNK_AXIS,
    Simulator,
    StoredRows,
    is_own,
    over_lanes,
    parted,
    steps_in,
    stored_times,
)
from jblast.vehicle.state import State, Trajectory

STEP_S = 5e-4
"""Default step of the integrator [s].

A tenth of the shortest motor lag of the named vehicles (5 ms, Hummingbird). Steps above
2.8 lags are unstable (`control.stability`); shorter ones cost time in proportion.
"""
Wind = Callable[[Float[Array, ""], Float[Array, "3"]], Float[Array, "3"]]


def simulate(
    vehicle: Vehicle,
    state: State,
    *,
    duration_s: float | int,
    step_s: float | int = STEP_S,
    control: Controller | None = None,
    control_period_s: float | int | None = None,
    wind: Wind | None = None,
    loads: Sequence[Load | Pulse] = (),
    ground_up_m: float | int | None = None,
    store_every: int = 1,
    backend: str = "auto",
) -> Trajectory:
    """Simulate the flight of a vehicle, or of a batch, through a wind and loads.

    The stages at both ends of a step evaluate wind and loads inside it, so jumps at a
    step's ends are exact. A batch has leading axes in the state. If all arrays of the
    vehicle, the controller, the wind or a load begin with these axes, too, each vehicle
    has its own; otherwise all share one. A vehicle that diverges does not affect
    others. The precision is that of the state.

    Args:
        vehicle: The vehicle.
        state: Initial state; the first row of the trajectory.
        duration_s: Duration; the last step is shorter if necessary.
        step_s: Step of the integrator.
        control: Controller of the rotors; without one they keep their initial speeds.
        control_period_s: Period of the controller, a whole number of steps (default:
            one step).
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
            ground; the step is too large; the device is unsupported.

    Warns:
        UserWarning: JAX is used instead of Warp, because an operation has no C code.
    """
    duration_s, step_s = float(duration_s), float(step_s)
    period_s = step_s if control_period_s is None else float(control_period_s)
    check_numbers(backend, store_every, duration_s, step_s, period_s)
    batch, dtype = state.position_m.shape[:-1], jnp.result_type(*jax.tree.leaves(state))
    check_start(vehicle, state, ground_up_m)
    held, steps = round(period_s / step_s), steps_in(duration_s, step_s)
    check_step(vehicle, control, step_s, held, batch)
    simulator = Simulator(
        # A name is static: every vehicle would compile the program once more.
        dataclasses.replace(vehicle, name=""),
        jnp.asarray(step_s),
        control,
        wind,
        tuple(loads),
        None if ground_up_m is None else floats(ground_up_m),
        held,
        1 if batch else store_every,
    )
    times = stored_times(duration_s, step_s, store_every, dtype)
    # A remainder by rounding does not make the last step shorter.
    last_s = duration_s - (steps - 1) * step_s
    last_s = step_s if abs(last_s - step_s) <= 1e-9 * step_s else last_s
    last_s = jnp.asarray(last_s)
    given = simulator, state, last_s = in_precision((simulator, state, last_s), dtype)
    options = {"steps": steps, "store_every": store_every, "batch": batch}
    traced = any(isinstance(x, Tracer) for x in jax.tree.leaves(given))
    if flies_on_warp(backend, traced, dtype):
        # Warp is imported only for a kernel.
        from jblast.vehicle import kernel

        device = kernel.device_named(backend.partition(":")[2] or None)
        try:
            return kernel.fly_on(device, simulator, state, last_s, times, **options)
        except Untranslatable as missing:
            warnings.warn(f"{missing}: JAX is used instead of Warp", stacklevel=2)
    program = _FLY_WITHIN if traced else _FLY_EACH if batch else _FLY_ONE
    devices = 1 if traced else jax.local_device_count()
    return _trajectory(times, program(*given, devices=devices, **options))


def _fly_all(
    simulator: Simulator,
    state: State,
    last_s: Float[Array, ""],
    *,
    batch: tuple[int, ...],
    devices: int,
    **options: Any,
) -> StoredRows:
    """Simulate one vehicle, or each of a batch."""
    if not batch:
        return simulator.rows(state, last_s, **options)
    simulator = dataclasses.replace(simulator, axis=CHUNK_AXIS)
    lanes, shared = parted(simulator, state, batch)

    def one(lane: Any) -> StoredRows:
        simulator, state = eqx.combine(lane, shared)
        return simulator.rows(state, last_s, **options)

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


def check_start(
    vehicle: Vehicle, state: State, ground_up_m: float | int | None
) -> None:
    """Reject a start below ground, and vehicles whose shape differs from the state's.

    Raises:
        InputError: The start, the vehicle or the ground is invalid.
    """
    batch, shape = state.position_m.shape[:-1], vehicle.mass_kg.shape
    require(0 not in batch, "state", "one vehicle or more", f"a batch of {batch}")
    words = f"one, or a batch of {batch} as in the state"
    require(shape in ((), batch), "vehicle", words, f"{shape}")
    up = state.position_m[..., 2]
    if ground_up_m is None or any(isinstance(x, Tracer) for x in (up, ground_up_m)):
        return
    finite, lowest = math.isfinite(ground_up_m), float(np.min(up))
    require(finite, "ground_up_m", "a height [m]", f"{ground_up_m}")
    words = f"a start at or above the ground, {ground_up_m:g} m"
    require(lowest >= ground_up_m, "position_m", words, f"{lowest:g} m")


def check_step(
    vehicle: Vehicle,
    control: Controller | None,
    step_s: float,
    held: int,
    batch: tuple[int, ...],
) -> None:
    """Reject a step at which the motors or the position controller are unstable.

    Raises:
        InputError: The step is too large.
    """
    # All controllers with gains, missions included, have this attribute. A batch of
    # gains is not checked: vehicles that diverge are reported one by one.
    gains = None if is_own(control, batch) else getattr(control, "gains", None)
    gains = gains if isinstance(gains, Gains) else None
    checked = jax.tree.leaves((vehicle.motor_lag_s, gains))
    if any(isinstance(x, Tracer) for x in checked):
        return
    lags = np.unique(np.asarray(vehicle.motor_lag_s, float))
    # The limit is monotonic in the lag without a controller; with one both extremes are
    # checked.
    limit = min(step_limit(lag, gains, held) for lag in lags[[0, -1]])
    period = f" and a position controller of period {held * step_s:g} s"
    what = f"a motor lag of {lags[0]:g} s{period if gains is not None else ''}"
    words = f"at most {limit:.4g} s, up to which RK4 is stable with {what}"
    require(step_s <= limit, "step_s", words, f"{step_s:g} s")


def flies_on_warp(backend: str, traced: bool, dtype: np.dtype) -> bool:
    """Return whether the flight uses a Warp kernel.

    Args:
        backend: "auto" (the kernel in float32 on a GPU), "jax", "warp" or
            "warp:DEVICE".
        traced: True inside jit, vmap or grad.
        dtype: Precision of the flight.

    Raises:
        InputError: Warp is requested inside jit, vmap or grad.
    """
    if backend == "auto":
        return jax.default_backend() == "gpu" and dtype == np.float32 and not traced
    words = "auto or jax inside jit, vmap or grad (Warp flights have no derivatives)"
    require(not traced or backend == "jax", "backend", words, shown(backend))
    return backend != "jax"


def check_numbers(
    backend: str, store_every: int, duration_s: float, step_s: float, period_s: float
) -> None:
    """Check options and times: a control period is a whole number of steps.

    Raises:
        InputError: One of them is invalid.
    """
    known = backend in ("auto", "jax", "warp") or backend.startswith("warp:")
    require(known, "backend", "auto, jax, warp or warp:DEVICE", shown(backend))
    require(store_every >= 1, "store_every", "1 or more steps", store_every)
    times = {"duration_s": duration_s, "step_s": step_s, "control_period_s": period_s}
    for name, value in times.items():
        positive = math.isfinite(value) and value > 0
        require(positive, name, "a positive time [s]", f"{value}")
    ratio = period_s / step_s
    # 1e-6 allows for decimal fractions, as 0.004 over 0.0005.
    whole = ratio >= 0.5 and abs(ratio - round(ratio)) <= 1e-6
    words = f"a whole number of steps of {step_s:g} s"
    require(whole, "control_period_s", words, f"{period_s:g} s")
