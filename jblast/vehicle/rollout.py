"""Flights: one step, rows of steps, a batch of rows.

In a step the controller is evaluated, pulses are added and the state is advanced. A
flight is a scan over steps that stores some of its states.

The time of a step is its number times its length. Sums of steps would drift, and in
float32 a rounded time could fall on the wrong side of a jump, so that the stages at a
step's ends are inside of it. In float32 a time past 500 s is resolved to 0.06 ms only:
the peak deviation after a blast at 1000 s is 2 % too small, at 100 s 5e-5.

One program advances a chunk of the vehicles of a batch at a time, and the chunks are
distributed over the devices. On a CPU a chunk whose state stays in the L1 cache is
fastest; a GPU processes the whole batch as one chunk.
"""

import functools
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, PartitionSpec
from jaxtyping import Array, Bool, Float, Int, PyTree

from jblast.constants import FLIGHT_GRAVITY
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
    dot,
    four,
    joined,
    three,
)

MAX_SPLIT_SIZE = 16
"""Size up to which an array of a controller's state is split into scalars.

A larger array, as a covariance, would compile for minutes (`_split`).
"""
INWARD = 1e-9
"""Distance of the first and last stage from a step's ends, as a share of the step.

It selects the side of a jump at a step's end. 1e-9 of a step changes no digit of a
flight and is above the rounding of float64 times; float32 has its own distance.
"""
STROKE_M = 0.02
"""Stroke of the landing gear [m], declared: the give of feet, arms and ground.

A landing at 0.7 m/s (PX4's MPC_LAND_SPEED) brakes at 12 m/s2.
"""
T = TypeVar("T")
CHUNK_BYTES = 512
"""Size of an array with one number per vehicle of a chunk, on a CPU.

XLA runs a loop over arrays up to this size sequentially in one thread. Larger arrays
are dispatched to a thread pool, at a cost above that of the few instructions per array.
"""
CHUNK_AXIS = "chunk"
"""Name of the axis of a chunk's vehicles."""


class StoredRows(NamedTuple):
    """Stored rows; each part is a tuple of components."""

    motion: StateComponents
    wrench: Wrench
    alive: Bool[Array, "..."]


class FlightState(NamedTuple):
    """State of a flight between two steps.

    Attributes:
        motion: State of the vehicle.
        excess: Rounding error of the rotor speeds (Kahan's sum); None in float64.
        command: Rotor speed commands [rad/s].
        memory: State of the controller.
        impulse_wrench: Mean force and moment of the pulses over the step.
        inactive_until_s: Time before which each pulse is zero.
        strongest: Strongest `impulse_wrench` since the last stored row; () if each step
            has a row or rows show the last step.
    """

    motion: StateComponents
    excess: Four | None
    command: Four
    memory: PyTree[Array]
    impulse_wrench: Wrench
    inactive_until_s: tuple[Number, ...]
    strongest: tuple[()] | Wrench = ()

    @property
    def row_wrench(self) -> Wrench:
        """Mean force and moment of the pulses that a stored row shows."""
        return self.strongest or self.impulse_wrench


class Tick(NamedTuple):
    """Times of a step.

    Attributes:
        start: Beginning [s].
        length: Length [s].
        stages: Times of the rates' evaluations: beginning, middle, end [s].
    """

    start: Number
    length: Number
    stages: Vector


def tick_of(n: Int[Array, ""], step_s: Number, length_s: Number | None = None) -> Tick:
    """Return the times of a step.

    Args:
        n: Number of the step, from 0.
        step_s: Length of the steps.
        length_s: Length of this one, if it is another.
    """
    length = step_s if length_s is None else length_s
    start = n.astype(step_s.dtype) * step_s
    # At least two roundings of the time: in float32 1e-9 of a step is lost.
    rounding = 2 * jnp.finfo(step_s.dtype).eps * (start + length)
    inward = jnp.maximum(INWARD * length, rounding)
    middle, end = start + length / 2, start + length - inward
    return Tick(start, length, (start + inward, middle, end))


class Simulator(eqx.Module):
    """Steps of one vehicle.

    Attributes:
        vehicle: The vehicle.
        step_s: Length of the steps [s].
        control: Controller, or None; the rotors then keep their speeds.
        wind: Function of time and position to the velocity of the air (3) [m/s], or
            None.
        loads: Loads and pulses.
        ground_up_m: Height of the ground [m], or None.
        held: Steps per evaluation of the controller.
        row_steps: Steps of a row that shows the strongest of their pulses.
        axis: Name of the `vmap` axis of a chunk of vehicles; None: a single vehicle.
    """

    vehicle: Vehicle
    step_s: Float[Array, ""]
    control: Any = None
    wind: Any = None
    loads: tuple[Any, ...] = ()
    ground_up_m: Float[Array, ""] | None = None
    held: int = eqx.field(static=True, default=1)
    row_steps: int = eqx.field(static=True, default=1)
    axis: str | None = eqx.field(static=True, default=None)

    def start(self, state: State) -> FlightState:
        """Return the state of the flight before the first step."""
        motion = normal(components(state))
        zero = jnp.zeros_like(self.step_s)
        single = zero.dtype == jnp.float32
        none: Wrench = ((zero, zero, zero), (zero, zero, zero))
        return FlightState(
            motion,
            (zero, zero, zero, zero) if single else None,
            motion.rotor_speed,
            jax.tree.map(_split, self._memory()),
            none,
            tuple(-jnp.inf + zero for _ in self._pulses()),
            none if self.row_steps > 1 and self._pulses() else (),
        )

    def step(
        self,
        now: FlightState,
        n: Int[Array, ""],
        *,
        command: Four | None = None,
        length_s: Number | None = None,
    ) -> FlightState:
        """Take a step.

        Args:
            now: State before the step.
            n: Number of the step, from 0.
            command: Rotor speed commands instead of the controller's [rad/s].
            length_s: Length of the step, if it is another than that of all.
        """
        tick = tick_of(n, self.step_s, length_s)
        now = self.pushed(now, tick)
        if now.strongest:
            force, least = now.impulse_wrench[0], now.strongest[0]
            new = (n % self.row_steps == 0) | (dot(force, force) > dot(least, least))
            choose = functools.partial(jnp.where, new)
            strongest = jax.tree.map(choose, now.impulse_wrench, now.strongest)
            now = now._replace(strongest=strongest)
        if command is not None:
            now = now._replace(command=command)
        elif self.control is not None:
            now = self._controlled(now, n, tick)
        return self.moved(now, tick)

    def step_of(
        self, now: FlightState, n: Int[Array, ""], steps: Any, last_s: Number
    ) -> FlightState:
        """Take step `n` of a flight of `steps`, the last of which has another length.

        Args:
            now: State before the step.
            n: Number of the step.
            steps: Number of steps.
            last_s: Length of the last one.
        """
        return self.step(
            now, n, length_s=jnp.where(n == steps - 1, last_s, self.step_s)
        )

    def pushed(self, now: FlightState, tick: Tick) -> FlightState:
        """Return the state with the wrench of the pulses in a step."""
        impulse_wrench, inactive_until_s = pulse_wrench(
            self._pulses(),
            tick.start,
            tick.length,
            now.motion,
            self.vehicle,
            now.inactive_until_s,
            self.axis,
        )
        return now._replace(
            impulse_wrench=impulse_wrench, inactive_until_s=inactive_until_s
        )

    def moved(self, now: FlightState, tick: Tick) -> FlightState:
        """Advance the state of the vehicle, with a command and a wrench of pulses."""

        def move(now: FlightState, tick: Tick) -> FlightState:
            def stage_rates(stage: int, motion: StateComponents) -> StateComponents:
                time = tick.stages[stage]
                return self.rates(now.impulse_wrench, time, now.command, motion)

            gain = rk4_step(stage_rates, now.motion, tick.length)
            motion, excess = _sum(now.motion, now.excess, gain)
            motion = _grounded(
                self.ground_up_m, now.motion, normal(motion), tick.length
            )
            return now._replace(motion=motion, excess=excess)

        # The condition is always true. A branch is a separate program of small arrays,
        # which XLA therefore runs sequentially (`CHUNK_BYTES`).
        return jax.lax.cond(tick.length > 0, move, lambda now, _: now, now, tick)

    def rates(
        self,
        impulse_wrench: Wrench,
        time: Number,
        command: Four,
        motion: StateComponents,
    ) -> StateComponents:
        """Return the rates of a state at a time."""
        place, wind = jnp.stack(motion.position), jnp.zeros(3, time.dtype)
        if self.wind is not None:
            wind = jnp.asarray(self.wind(time, place)).astype(time.dtype)
        load = impulse_wrench
        if self.loads:
            load = load_wrench(self.loads, time, joined(motion), self.vehicle, load)
        return rates(self.vehicle, motion, command, three(wind, "wind"), load)

    def wrench(
        self, motion: StateComponents, impulse_wrench: Wrench, n: Int[Array, ""]
    ) -> Wrench:
        """Return total force and moment after `n` steps: before a jump at their end."""
        first, last = (tick_of(k, self.step_s) for k in (0 * n, n - 1))
        time = jnp.where(n > 0, last.stages[2], first.stages[0])
        rate = self.rates(impulse_wrench, time, motion.rotor_speed, motion)
        return net_wrench(self.vehicle, motion, rate)

    def rows(
        self, state: State, last_s: Number, *, steps: int, store_every: int
    ) -> StoredRows:
        """Return the stored rows of a flight, from start to end.

        Args:
            state: Initial state.
            last_s: Length of the last step.
            steps: Number of steps.
            store_every: Steps between rows.
        """

        def advance(now: FlightState, n: Int[Array, ""]) -> tuple[FlightState, None]:
            return self.step_of(now, n, steps, last_s), None

        # The backward pass recomputes a step instead of storing its numbers.
        advance = jax.checkpoint(advance, prevent_cse=False)

        def advance_row(
            now: FlightState, numbers: Int[Array, " step"]
        ) -> tuple[FlightState, tuple[StateComponents, Wrench]]:
            now, _ = jax.lax.scan(advance, now, numbers)
            return now, (now.motion, now.row_wrench)

        now = self.start(state)
        first = (now.motion, now.row_wrench)
        even = steps // store_every * store_every
        numbers = jnp.arange(steps, dtype=jnp.int32)
        whole = numbers[:even].reshape(-1, store_every)
        now, between = jax.lax.scan(advance_row, now, whole)
        parts = [jax.tree.map(lambda x: x[None], first), between]
        taken = [*range(0, even + 1, store_every)]
        if even < steps:
            _, end = advance_row(now, numbers[even:])
            parts.append(jax.tree.map(lambda x: x[None], end))
            taken.append(steps)
        motion, pulses = jax.tree.map(lambda *x: jnp.concatenate(x), *parts)
        # Of the stored rows only, not of every step.
        forces = jax.vmap(self.wrench)(motion, pulses, jnp.asarray(taken, jnp.int32))
        # A vehicle that diverged once stays lost, even if its numbers become finite
        # again.
        lost = ~jnp.isfinite(sum(jax.tree.leaves((motion, pulses, forces))))
        alive = jnp.cumsum(lost) == 0
        ended = jax.tree.map(lambda x: jnp.where(alive, x, jnp.nan), (motion, forces))
        return StoredRows(ended[0], ended[1], alive)

    def _pulses(self) -> list[Pulse]:
        return [load for load in self.loads if isinstance(load, Pulse)]

    def _memory(self) -> PyTree[Array]:
        return () if self.control is None else self.control.start()

    def _controlled(
        self, now: FlightState, n: Int[Array, ""], tick: Tick
    ) -> FlightState:
        """Return the state with a new command if the controller is evaluated."""

        def sampled(now: FlightState) -> FlightState:
            command, memory = self.control(
                tick.start,
                joined(now.motion),
                self.vehicle,
                jax.tree.map(lambda s, n: _joined(n, s), self._memory(), now.memory),
                self.held * self.step_s,
            )
            return now._replace(
                command=four(command, "control"), memory=jax.tree.map(_split, memory)
            )

        turn = n % self.held == 0 if self.held > 1 else tick.length > 0
        return jax.lax.cond(turn, sampled, lambda now: now, now)


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
    ground: Float[Array, ""] | None,
    before: StateComponents,
    motion: StateComponents,
    length: Number,
) -> StateComponents:
    r"""Stop a vehicle that descends to the ground; it rests at its position.

    The landing gear has a stroke $s$ above the position at rest. A vehicle that sinks
    at $v$ is brought to rest on its remaining height $h$ by the constant acceleration
    $v^2/2h$, at most $v^2/2s$; one slower than $\sqrt{2gh}$ falls freely. Its other
    velocities and its body rate decrease in the same proportion.

    Args:
        ground: Height of the ground.
        before: State at the beginning of the step.
        motion: State at its end without the ground.
        length: Length of the step.
    """
    if ground is None:
        return motion
    height, speed = before.position[2] - ground, -before.velocity[2]
    falls = (speed > 0) & (height > 0)
    # Guards of the quotients: a division by zero would give NaN gradients.
    height, speed = jnp.where(falls, height, 1), jnp.where(falls, speed, 1)
    brakes = (height - speed * length < STROKE_M) & (
        speed * speed > 2 * FLIGHT_GRAVITY * height
    )
    left = jnp.maximum(1 - length * speed / (2 * height), 0)
    # The ground only pushes: rotors may lift the vehicle more than that.
    held = falls & brakes & (motion.velocity[2] < -left * speed)
    way = jnp.minimum(length, 2 * height / speed) * (1 + left) / 2

    def braked(free: Vector, slow: Iterable[Number]) -> Vector:
        a, b, c = (jnp.where(held, x, y) for x, y in zip(slow, free, strict=True))
        return a, b, c

    velocity = braked(motion.velocity, [left * v for v in before.velocity])
    body_rate = braked(motion.body_rate, [left * w for w in before.body_rate])
    places = zip(before.position, before.velocity, strict=True)
    x, y, z = braked(motion.position, [at + v * way for at, v in places])
    below = z < ground
    still = below & (velocity[2] < 0)

    def stopped(vector: Vector) -> Vector:
        a, b, c = (jnp.where(still, 0, part) for part in vector)
        return a, b, c

    return motion._replace(
        position=(x, y, jnp.where(below, ground, z)),
        velocity=stopped(velocity),
        body_rate=stopped(body_rate),
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


def is_own(value: Any, batch: tuple[int, ...]) -> bool:
    """Return whether each vehicle of a batch has a value of its own.

    It has if all arrays of the value begin with the batch's axes; otherwise all
    vehicles share one.
    """
    arrays = [x for x in jax.tree.leaves(value) if eqx.is_array(x)]
    begin = [x.shape[: len(batch)] == batch for x in arrays]
    return bool(batch and arrays) and all(begin)


def parted(
    simulator: Simulator, state: State, batch: tuple[int, ...]
) -> tuple[PyTree, PyTree]:
    """Separate the arrays of single vehicles from shared values (`is_own`).

    Args:
        simulator: Steps of a batch.
        state: Initial states.
        batch: Axes of the batch, which become one.

    Returns:
        Arrays of single vehicles with one leading axis, None elsewhere; and the rest.
    """
    values = (simulator, state)
    containers = (values, simulator, simulator.loads)
    own = jax.tree.map(
        lambda value: eqx.is_array if is_own(value, batch) else False,
        values,
        is_leaf=lambda x: not any(x is part for part in containers),
    )
    lanes, shared = eqx.partition(values, own)
    size = len(batch)
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[size:]), lanes), shared


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
