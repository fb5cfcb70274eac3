"""Flights: one step, a scan of steps, a batch of scans.

In a step the controller is evaluated, pulses are added and the state is advanced. A
flight is a scan over steps that stores some of its states.

Times are computed in float64 on the host, t = n times the step, and only then rounded
to the precision of the flight. Sums of steps would drift, and in float32 a rounded time
could fall on the wrong side of a jump. In float32 a time past 500 s is resolved to 0.06
ms only: the peak deviation after a blast at 1000 s is 2 % too small, at 100 s 5e-5.

One program advances a chunk of the vehicles of a batch at a time, and the chunks are
distributed over the devices. On a CPU a chunk whose state stays in the L1 cache is
fastest; a GPU processes the whole batch as one chunk.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, PartitionSpec
from jaxtyping import Array, Bool, Float, Int, PyTree

from jblast.errors import InputError
from jblast.vehicle.dynamics import Wrench, net_wrench, normal, rates, rk4_step
from jblast.vehicle.loads.load import Pulse, load_wrench, pulse_wrench
from jblast.vehicle.quadrotor import Vehicle
from jblast.vehicle.state import (
    Four,
    Number,
    State,
    StateComponents,
    Vector,
    components,
    four,
    joined,
    three,
)

BLOCK = 16
"""Maximum number of steps per block.

The times of a block are small arrays (`CHUNK_BYTES`), and pulses are tested once per
block. Longer blocks would evaluate pulses in more steps in which none acts.
"""
MAX_SPLIT_SIZE = 16
"""Size up to which an array of a controller's state is split into scalars.

A larger array, as a covariance, would compile for minutes (`_split`).
"""
INWARD = 1e-9
"""Distance of the first and last stage from a step's ends, as a share of the step.

It selects the side of a jump at a step's end. 1e-9 of a step changes no digit of a
flight and is above the rounding of float64 times; float32 has its own distance.
"""
T = TypeVar("T")
CHUNK_BYTES = 512
"""Size of an array with one number per vehicle of a chunk, on a CPU.

XLA runs a loop over arrays up to this size sequentially in one thread. Larger arrays
are dispatched to a thread pool, at a cost above that of the few instructions per array.
"""
CHUNK_AXIS = "chunk"
"""Name of the axis of a chunk's vehicles."""


class Flight(NamedTuple):
    """Vehicle, start and actions of one flight.

    Attributes:
        vehicle: The vehicle.
        state: Initial state.
        commands: Rotor speed commands (row, 4) [rad/s], or None.
        control: Controller, or None; without commands and controller the rotors keep
            their initial speeds.
        wind: Function of time and position to the velocity of the air (3) [m/s], or
            None.
        loads: Loads and pulses.
        ground_up_m: Height of the ground [m], or None.
    """

    vehicle: Vehicle
    state: State
    commands: Float[Array, "row 4"] | None
    control: Any
    wind: Any
    loads: tuple[Any, ...]
    ground_up_m: Float[Array, ""] | None


class StoredRows(NamedTuple):
    """Stored rows; each part is a tuple of components."""

    motion: StateComponents
    wrench: Wrench
    alive: Bool[Array, "..."]


def wind_at(flight: Flight, time: Number, motion: StateComponents) -> Vector:
    """Return the velocity of the air at a vehicle [m/s].

    Raises:
        InputError: The wind does not return three numbers.
    """
    place = jnp.stack(motion.position)
    if flight.wind is None:
        return three(jnp.zeros_like(place))
    wind = jnp.asarray(flight.wind(time, place))
    if wind.shape != (3,):
        raise InputError(
            "wind: expected a function (time_s, position_m) that returns 3 numbers, "
            f"got the shape {wind.shape}"
        )
    return three(wind.astype(place.dtype))


class FlightState(NamedTuple):
    """State of a flight between two steps.

    Attributes:
        motion: State of the vehicle.
        excess: Rounding error of the rotor speeds (Kahan's sum); None in float64.
        command: Rotor speed commands [rad/s].
        memory: State of the controller.
        impulse_wrench: Mean force and moment of the pulses over the step.
        inactive_until_s: Time before which each pulse is zero.
    """

    motion: StateComponents
    excess: Four | None
    command: Four
    memory: PyTree[Array]
    impulse_wrench: Wrench
    inactive_until_s: tuple[Number, ...]


class Ticks(NamedTuple):
    """The steps of a flight, one per row.

    Attributes:
        stages: Times of the rates' evaluations: beginning, middle, end [s].
        start: Beginning of the step [s].
        step: Length of the step [s].
        command: Row of the commands at each stage.
        sample: True if the controller is sampled at the step's beginning.
    """

    stages: Float[Array, "step 3"]
    start: Float[Array, " step"]
    step: Float[Array, " step"]
    command: Int[Array, "step 3"]
    sample: Bool[Array, " step"]


Step = Callable[[FlightState, Ticks], FlightState]


def fly(
    flight: Flight,
    ticks: Ticks,
    period_s: Float[Array, ""],
    *,
    store_every: int,
    control_held: bool,
    axis: str | None = None,
) -> StoredRows:
    """Return the stored rows of one vehicle's flight, from start to end.

    Args:
        flight: Vehicle, initial state, commands and loads.
        ticks: The steps.
        period_s: Period of the controller [s].
        store_every: Steps between rows.
        control_held: True if the controller's period is longer than a step.
        axis: Name of the `vmap` axis of a chunk of vehicles; None: a single vehicle.
    """
    one = OneStep(flight, period_s, control_held, axis)
    now = one.start()
    first = (now.motion, now.impulse_wrench)

    def advance_row(
        now: FlightState, part: Ticks
    ) -> tuple[FlightState, tuple[StateComponents, Wrench]]:
        size = part.step.size
        # The largest divisor up to BLOCK: all blocks have one length and so one
        # program.
        block = max(n for n in range(1, BLOCK + 1) if size % n == 0)
        blocks = jax.tree.map(lambda x: x.reshape(-1, block, *x.shape[1:]), part)
        now, _ = jax.lax.scan(
            lambda now, part: (_advance_block(one, now, part), None), now, blocks
        )
        return now, (now.motion, now.impulse_wrench)

    def wrench(row: tuple[StateComponents, Wrench], time: Number) -> Wrench:
        motion, impulse_wrench = row
        rate = one.rates(impulse_wrench, time, motion.rotor_speed, motion)
        return net_wrench(flight.vehicle, motion, rate)

    count = ticks.step.size // store_every
    even = count * store_every
    whole = jax.tree.map(
        lambda x: x[:even].reshape(count, store_every, *x.shape[1:]), ticks
    )
    now, between = jax.lax.scan(advance_row, now, whole)
    parts = [jax.tree.map(lambda x: x[None], first), between]
    times = [ticks.stages[:1, 0], whole.stages[:, -1, 2]]
    if even < ticks.step.size:
        _, end = advance_row(now, jax.tree.map(lambda x: x[even:], ticks))
        parts.append(jax.tree.map(lambda x: x[None], end))
        times.append(ticks.stages[-1:, 2])
    rows = jax.tree.map(lambda *x: jnp.concatenate(x), *parts)
    # Of the stored rows only, not of every step.
    forces = jax.vmap(wrench)(rows, jnp.concatenate(times))
    # A vehicle that diverged once stays lost, even if its numbers become finite again.
    lost = ~jnp.isfinite(sum(jax.tree.leaves((rows, forces))))
    alive = jnp.cumsum(lost) == 0
    ended = jax.tree.map(lambda x: jnp.where(alive, x, jnp.nan), (rows[0], forces))
    return StoredRows(ended[0], ended[1], alive)


@dataclass(frozen=True, eq=False)
class OneStep:
    """Steps of one vehicle.

    Attributes:
        flight: Vehicle, initial state, commands and loads.
        period_s: Period of the controller [s].
        control_held: True if the controller's period is longer than a step.
        axis: Name of the `vmap` axis of a chunk of vehicles; None: a single vehicle.
    """

    flight: Flight
    period_s: Float[Array, ""]
    control_held: bool
    axis: str | None

    def start(self) -> FlightState:
        """Return the state of the flight before the first step."""
        motion = normal(components(self.flight.state))
        zero = jnp.zeros_like(self.period_s)
        single = zero.dtype == jnp.float32
        return FlightState(
            motion,
            (zero, zero, zero, zero) if single else None,
            motion.rotor_speed,
            jax.tree.map(_split, self._memory()),
            ((zero, zero, zero), (zero, zero, zero)),
            tuple(-jnp.inf + zero for _ in self._pulses()),
        )

    def rates(
        self,
        impulse_wrench: Wrench,
        time: Number,
        command: Four,
        motion: StateComponents,
    ) -> StateComponents:
        """Return the rates of a state at a time."""
        flight = self.flight
        wind, load = wind_at(flight, time, motion), impulse_wrench
        if flight.loads:
            load = load_wrench(flight.loads, time, joined(motion), flight.vehicle, load)
        return rates(flight.vehicle, motion, command, wind, load)

    def advance(self, now: FlightState, tick: Ticks) -> FlightState:
        """Take a step."""
        if self.flight.control is not None:
            now = self._controlled(now, tick)
        # The condition is always true. A branch is a separate program of small arrays,
        # which XLA therefore runs sequentially (`CHUNK_BYTES`).
        return jax.lax.cond(tick.step > 0, self.moved, lambda now, _: now, now, tick)

    def advance_pushed(self, now: FlightState, tick: Ticks) -> FlightState:
        """Take a step in which a pulse may act."""
        impulse_wrench, inactive_until_s = pulse_wrench(
            self._pulses(),
            tick.start,
            tick.step,
            now.motion,
            self.flight.vehicle,
            now.inactive_until_s,
            self.axis,
        )
        now = now._replace(
            impulse_wrench=impulse_wrench, inactive_until_s=inactive_until_s
        )
        return self.advance(now, tick)

    def _pulses(self) -> list[Pulse]:
        return [load for load in self.flight.loads if isinstance(load, Pulse)]

    def _memory(self) -> PyTree[Array]:
        control = self.flight.control
        return () if control is None else control.start()

    def _controlled(self, now: FlightState, tick: Ticks) -> FlightState:
        """Return the state with a new command if the controller is sampled."""

        def sampled(now: FlightState) -> FlightState:
            command, memory = self.flight.control(
                tick.start,
                joined(now.motion),
                self.flight.vehicle,
                jax.tree.map(lambda s, n: _joined(n, s), self._memory(), now.memory),
                self.period_s,
            )
            return now._replace(
                command=four(command), memory=jax.tree.map(_split, memory)
            )

        turn = tick.sample if self.control_held else tick.step > 0
        return jax.lax.cond(turn, sampled, lambda now: now, now)

    def moved(self, now: FlightState, tick: Ticks) -> FlightState:
        """Take a step with the current command; the body of `advance`'s branch."""
        flight = self.flight

        def stage_rates(stage: int, motion: StateComponents) -> StateComponents:
            command = now.command
            if flight.commands is not None:
                command = four(flight.commands[tick.command[stage]])
            return self.rates(now.impulse_wrench, tick.stages[stage], command, motion)

        gain = rk4_step(stage_rates, now.motion, tick.step)
        motion, excess = _sum(now.motion, now.excess, gain)
        motion = _grounded(flight.ground_up_m, normal(motion))
        return now._replace(motion=motion, excess=excess)


def _advance_block(one: OneStep, now: FlightState, part: Ticks) -> FlightState:
    """Take a block of steps; pulses are evaluated only if one may act in it."""
    if not now.inactive_until_s:
        return _steps(one.advance, now, part)
    end_s = part.start[-1] + part.step[-1]
    active = end_s > functools.reduce(jnp.minimum, now.inactive_until_s)
    none = jax.tree.map(jnp.zeros_like, now.impulse_wrench)
    return jax.lax.cond(
        active,
        lambda now: _steps(one.advance_pushed, now, part),
        lambda now: _steps(one.advance, now._replace(impulse_wrench=none), part),
        now,
    )


def _steps(step: Step, now: FlightState, part: Ticks) -> FlightState:
    # The backward pass recomputes a step instead of storing its intermediate values.
    again = jax.checkpoint(lambda now, tick: (step(now, tick), None), prevent_cse=False)
    return jax.lax.scan(again, now, part)[0]


def _sum(
    motion: StateComponents, excess: Four | None, gain: StateComponents
) -> tuple[StateComponents, Four | None]:
    """Add the increment of a step; the rotor speeds by Kahan's sum in float32.

    Rotor speeds have the smallest increments relative to their size. At steps of 0.1 ms
    plain sums have an error of 2 mm after 2.5 s of flight, this sum 0.2 mm.
    """
    total = jax.tree.map(jnp.add, motion, gain)
    if excess is None:
        return total, None
    was = motion.rotor_speed
    gained = [
        # The rounding error is a constant for derivatives: differentiated, the
        # compensation would cancel the gradient.
        g - jax.lax.stop_gradient(e)
        for g, e in zip(gain.rotor_speed, excess, strict=True)
    ]
    a, b, c, d = (x + g for x, g in zip(was, gained, strict=True))
    i, j, k, m = (
        (new - x) - g for new, x, g in zip((a, b, c, d), was, gained, strict=True)
    )
    return total._replace(rotor_speed=(a, b, c, d)), (i, j, k, m)


def _split(array: Array) -> tuple[Array, ...]:
    """Split a small array into scalars, like `StateComponents`; keep a large one.

    A covariance split into scalars is a program of thousands of instructions, which
    takes minutes to compile.
    """
    return (array,) if array.size > MAX_SPLIT_SIZE else tuple(jnp.ravel(array))


def _joined(numbers: tuple[Array, ...], like: Array) -> Array:
    """Undo `_split`: return an array of the shape of `like`."""
    if like.size > MAX_SPLIT_SIZE:
        return numbers[0]
    return jnp.stack(numbers).reshape(like.shape)


def _grounded(
    ground: Float[Array, ""] | None, motion: StateComponents
) -> StateComponents:
    """Stop a vehicle that descends below the ground; it rests at its position."""
    if ground is None:
        return motion
    below = motion.position[2] < ground
    x, y, z = motion.position
    still = below & (motion.velocity[2] < 0)

    def stopped(vector: Vector) -> Vector:
        a, b, c = (jnp.where(still, 0, part) for part in vector)
        return a, b, c

    return motion._replace(
        position=(x, y, jnp.where(below, ground, z)),
        velocity=stopped(motion.velocity),
        body_rate=stopped(motion.body_rate),
    )


def timetable(
    duration_s: float, step_s: float, command_step_s: float, dtype: np.dtype
) -> Ticks:
    """Return the steps of a flight; the last may be shorter.

    Args:
        duration_s: Duration of the flight.
        step_s: Step of the integrator.
        command_step_s: Duration of a command.
        dtype: Precision of the flight: the stages at a step's ends are at least two
            roundings of the time inside the step.
    """
    count = steps_in(duration_s, step_s)
    start = np.arange(count) * step_s
    length = np.full(count, step_s)
    # A remainder by rounding does not make the last step shorter.
    if abs(count * step_s - duration_s) > 1e-9 * step_s:
        length[-1] = duration_s - start[-1]
    stages = start[:, None] + length[:, None] * np.array([INWARD, 0.5, 1 - INWARD])
    # Inside the step, so that rounding at its end cannot select the next command.
    command = np.floor(stages / command_step_s).astype(np.int32)
    # -1 is no row: the controller is sampled at the first step.
    before = np.concatenate([[-1], command[:-1, 1]])
    rounding = 2 * np.finfo(dtype).eps * (start + length)
    inward = np.maximum(INWARD * length, rounding)
    stages[:, 0] = start + inward
    stages[:, 2] = start + length - inward
    return Ticks(
        jnp.asarray(stages, dtype),
        jnp.asarray(start, dtype),
        jnp.asarray(length, dtype),
        jnp.asarray(command),
        jnp.asarray(command[:, 1] != before),
    )


def stored_times(
    duration_s: float, step_s: float, store_every: int, dtype: np.dtype
) -> Float[Array, " time"]:
    """Times of the stored rows: start, every `store_every` steps, and end [s]."""
    count = steps_in(duration_s, step_s)
    inner = np.arange(0, count, store_every) * step_s
    return jnp.asarray(np.append(inner, duration_s), dtype)


def steps_in(duration_s: float, step_s: float) -> int:
    """Return the number of steps in a duration, including a shorter last one."""
    ratio = duration_s / step_s
    # A ratio above an integer by rounding only does not give another step.
    return max(1, int(np.ceil(ratio - 1e-9 * max(1.0, ratio))))


class Each(eqx.Module):
    """A value per vehicle of a batch: its arrays begin with the batch's axes.

    It wraps a wind, a load or a controller; without `Each` all vehicles share one.
    """

    value: Any


def own(node: Any) -> Any:
    """Return the value of an `Each`, or the node itself."""
    return node.value if isinstance(node, Each) else node


def parted(arguments: PyTree, batch: tuple[int, ...]) -> tuple[PyTree, PyTree]:
    """Separate the arrays of single vehicles from shared values.

    Args:
        arguments: PyTree with some nodes wrapped in `Each`.
        batch: Axes of the batch, which become one.

    Returns:
        The arrays of `Each` nodes with one leading axis, None elsewhere; and the rest.
    """

    def of_each(keep_each: bool) -> PyTree:
        def part(node: Any) -> Any:
            if not isinstance(node, Each):
                return None if keep_each else node
            arrays, rest = eqx.partition(node.value, eqx.is_array)
            if not keep_each:
                return rest
            count = len(batch)
            return jax.tree.map(lambda x: x.reshape(-1, *x.shape[count:]), arrays)

        return jax.tree.map(part, arguments, is_leaf=lambda x: isinstance(x, Each))

    return of_each(True), of_each(False)


def over_lanes(
    one: Callable[[PyTree], PyTree[Array]], lanes: PyTree[Array], devices: int
) -> PyTree[Array]:
    """Map a function over the first axis.

    Args:
        one: Function of one lane's arguments; the chunk's axis is `CHUNK_AXIS`.
        lanes: Arguments, one lane per row.
        devices: Number of devices.
    """
    first = jax.tree.leaves(lanes)[0]
    count, most = first.shape[0], CHUNK_BYTES // first.dtype.itemsize
    if jax.default_backend() != "cpu":
        most = -(-count // devices)
    elif count < devices * most:
        devices = 1
    chunks = -(-count // (devices * most))
    size = -(-count // (devices * chunks))
    # Chunks have one size, so one program: the last chunk is padded with the last lane.
    missing = devices * chunks * size - count

    def part(x: Array) -> Array:
        if missing:
            x = jnp.concatenate([x, jnp.repeat(x[-1:], missing, axis=0)])
        return x.reshape(devices * chunks, size, *x.shape[1:])

    def here(parts: PyTree[Array]) -> PyTree[Array]:
        return jax.lax.map(jax.vmap(one, axis_name=CHUNK_AXIS), parts)

    together = over_devices(here, jax.tree.map(part, lanes), devices)
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:])[:count], together)


def over_devices(
    function: Callable[[PyTree[Array]], T], parts: PyTree[Array], devices: int
) -> T:
    """Map a function over parts, distributed over devices.

    Args:
        function: Function of arrays with parts along the first axis, which it keeps.
        parts: Arrays; their first axis is a multiple of `devices`.
        devices: Number of devices.
    """
    if devices == 1:
        return function(parts)
    mesh = jax.make_mesh((devices,), ("lane",), axis_types=(AxisType.Auto,))
    along = PartitionSpec("lane")
    spread = jax.shard_map(
        function, mesh=mesh, in_specs=along, out_specs=along, check_vma=False
    )
    return spread(parts)
