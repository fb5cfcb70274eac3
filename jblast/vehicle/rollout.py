"""The flight of one vehicle: a scan over steps, its state stored now and then."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree

from jblast.errors import InputError
from jblast.vehicle.dynamics import Wrench, inverse_inertia, net_wrench, rates
from jblast.vehicle.integrators import INTEGRATORS
from jblast.vehicle.loads import load_wrench, pulse_wrench
from jblast.vehicle.motion import (
    Motion,
    Number,
    Vector,
    components,
    joined,
    three,
    unit,
)
from jblast.vehicle.parameters import Vehicle
from jblast.vehicle.state import State
from jblast.vehicle.timetable import Ticks


class Flight(NamedTuple):
    """What belongs to one vehicle's flight.

    Attributes:
        vehicle: The vehicle.
        state: Its start.
        commands: Rotor speeds (row, 4) [rad/s], or None.
        control: What commands the rotors instead, or None; with neither they keep the
            speeds of the start.
        wind: Velocity of the air (3) [m/s] at a time and place, or None.
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


class Rows(NamedTuple):
    """Stored rows, each part a tuple of components."""

    motion: Motion
    wrench: Wrench
    alive: Bool[Array, "..."]


class _Now(NamedTuple):
    """What is carried from step to step."""

    motion: Motion
    command: Float[Array, "4"]
    memory: PyTree[Array]
    push: Wrench


def fly(
    flight: Flight,
    ticks: Ticks,
    period_s: Float[Array, ""],
    *,
    integrator: str,
    store_every: int,
    control_held: bool,
) -> Rows:
    """Return the stored rows of one vehicle's flight: the start, and so on to the end.

    Args:
        flight: The vehicle, its start and what acts on it.
        ticks: The steps.
        period_s: Time between two turns of the controller [s].
        integrator: "rk4" or "euler".
        store_every: Steps between rows.
        control_held: Whether there are steps at which the controller is not asked.
    """
    vehicle, step = flight.vehicle, INTEGRATORS[integrator]
    inverse = inverse_inertia(vehicle)

    def rates_of(push: Wrench, time: Number, command: Array, motion: Motion) -> Motion:
        wind, load = _wind(flight, time, motion), push
        if flight.loads:
            load = load_wrench(flight.loads, time, joined(motion), vehicle, load)
        return rates(vehicle, inverse, motion, command, wind, load)

    def asked(now: _Now, tick: Ticks) -> _Now:
        control = flight.control
        assert control is not None

        def ask(now: _Now) -> _Now:
            command, memory = control(
                tick.start, joined(now.motion), vehicle, now.memory, period_s
            )
            return now._replace(command=command, memory=memory)

        if not control_held:
            return ask(now)
        return jax.lax.cond(tick.sample, ask, lambda now: now, now)

    def advance(now: _Now, tick: Ticks) -> tuple[_Now, None]:
        if flight.control is not None:
            now = asked(now, tick)
        if flight.loads:
            push = pulse_wrench(
                flight.loads, tick.start, tick.step, joined(now.motion), vehicle
            )
            now = now._replace(push=push)

        def stage_rates(stage: int | Array, motion: Motion) -> Motion:
            command = now.command
            if flight.commands is not None:
                command = flight.commands[tick.command[stage]]
            return rates_of(now.push, tick.stages[stage], command, motion)

        motion = step(stage_rates, now.motion, tick.step)
        return now._replace(motion=_grounded(flight.ground_up_m, motion)), None

    def stretch(now: _Now, part: Ticks) -> tuple[_Now, tuple[Motion, Wrench]]:
        # Backwards, a step is calculated again instead of being kept whole.
        again = jax.checkpoint(advance, prevent_cse=False)
        now, _ = jax.lax.scan(again, now, part)
        return now, (now.motion, now.push)

    def wrench(row: tuple[Motion, Wrench], time: Number) -> Wrench:
        motion, push = row
        rate = rates_of(push, time, jnp.stack(motion.rotor_speed), motion)
        return net_wrench(vehicle, motion, rate)

    start = components(flight.state)
    start = start._replace(quaternion=unit(start.quaternion))
    zero = three(jnp.zeros_like(flight.state.position_m))
    memory = () if flight.control is None else flight.control.start()
    now = _Now(start, flight.state.rotor_speed_rad_s, memory, (zero, zero))
    first = (now.motion, now.push)

    count = ticks.step.size // store_every
    even = count * store_every
    whole = jax.tree.map(
        lambda x: x[:even].reshape(count, store_every, *x.shape[1:]), ticks
    )
    now, between = jax.lax.scan(stretch, now, whole)
    parts = [jax.tree.map(lambda x: x[None], first), between]
    times = [ticks.stages[:1, 0], whole.stages[:, -1, 2]]
    if even < ticks.step.size:
        _, end = stretch(now, jax.tree.map(lambda x: x[even:], ticks))
        parts.append(jax.tree.map(lambda x: x[None], end))
        times.append(ticks.stages[-1:, 2])
    rows = jax.tree.map(lambda *x: jnp.concatenate(x), *parts)
    forces = jax.vmap(wrench)(rows, jnp.concatenate(times))
    # what has once diverged stays lost, wherever its numbers go
    lost = ~jnp.isfinite(sum(jax.tree.leaves((rows, forces))))
    alive = jnp.cumsum(lost) == 0
    ended = jax.tree.map(lambda x: jnp.where(alive, x, jnp.nan), (rows[0], forces))
    return Rows(ended[0], ended[1], alive)


def _wind(flight: Flight, time: Number, motion: Motion) -> Vector:
    """Velocity of the air at a vehicle [m/s]."""
    place = jnp.stack(motion.position)
    if flight.wind is None:
        return three(jnp.zeros_like(place))
    wind = jnp.asarray(flight.wind(time, place))
    if wind.shape != (3,):
        raise InputError(
            "wind: expected a function (time_s, position_m) that gives 3 numbers, got "
            f"one that gives the shape {wind.shape}"
        )
    return three(wind.astype(place.dtype))


def _grounded(ground: Float[Array, ""] | None, motion: Motion) -> Motion:
    """Stop a vehicle that goes into the ground: it lies where it fell."""
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
