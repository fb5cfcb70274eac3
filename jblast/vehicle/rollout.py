"""The flight of one vehicle: a scan over steps, its state stored now and then."""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jblast.errors import InputError
from jblast.vehicle.dynamics import Wrench, net_wrench, rates
from jblast.vehicle.flight import Flight, Rows
from jblast.vehicle.integrators import INTEGRATORS
from jblast.vehicle.loads import Pulse, load_wrench, pulse_wrench
from jblast.vehicle.motion import (
    Four,
    Motion,
    Number,
    Vector,
    components,
    four,
    joined,
    three,
    unit,
)
from jblast.vehicle.timetable import Ticks

BLOCK = 16
"""Most steps that are taken at once: their times are small arrays (`lanes.py`), and
where no pulse comes in all of them nothing looks for one."""


class _Now(NamedTuple):
    """What is carried from step to step."""

    motion: Motion
    command: Four
    memory: PyTree[Array]
    push: Wrench
    quiet_s: tuple[Number, ...]


def fly(
    flight: Flight,
    ticks: Ticks,
    period_s: Float[Array, ""],
    *,
    integrator: str,
    store_every: int,
    control_held: bool,
    axis: str | None = None,
) -> Rows:
    """Return the stored rows of one vehicle's flight: the start, and so on to the end.

    Args:
        flight: The vehicle, its start and what acts on it.
        ticks: The steps.
        period_s: Time between two turns of the controller [s].
        integrator: "rk4" or "euler".
        store_every: Steps between rows.
        control_held: Whether there are steps at which the controller is not asked.
        axis: Of the vehicles that fly in one chunk, as `vmap` names it; None: one flies
            alone.
    """
    vehicle, step = flight.vehicle, INTEGRATORS[integrator]
    control, memory = flight.control, ()
    if control is not None:
        if hasattr(control, "ready"):
            control = control.ready(vehicle)
        memory = control.start()
    shapes = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape, x.dtype), memory)

    def rates_of(push: Wrench, time: Number, command: Four, motion: Motion) -> Motion:
        wind, load = _wind(flight, time, motion), push
        if flight.loads:
            load = load_wrench(flight.loads, time, joined(motion), vehicle, load)
        return rates(vehicle, motion, command, wind, load)

    def asked(now: _Now, tick: Ticks) -> _Now:

        def ask(now: _Now) -> _Now:
            assert control is not None
            command, memory = control(
                tick.start,
                joined(now.motion),
                vehicle,
                jax.tree.map(lambda s, n: _whole(n, s), shapes, now.memory),
                period_s,
            )
            return now._replace(
                command=four(command), memory=jax.tree.map(_numbers, memory)
            )

        turn = tick.sample if control_held else tick.step > 0
        return jax.lax.cond(turn, ask, lambda now: now, now)

    def moved(now: _Now, tick: Ticks) -> _Now:
        def stage_rates(stage: int, motion: Motion) -> Motion:
            command = now.command
            if flight.commands is not None:
                command = four(flight.commands[tick.command[stage]])
            return rates_of(now.push, tick.stages[stage], command, motion)

        motion = step(stage_rates, now.motion, tick.step)
        return now._replace(motion=_grounded(flight.ground_up_m, motion))

    def advance(now: _Now, tick: Ticks) -> tuple[_Now, None]:
        if control is not None:
            now = asked(now, tick)
        # Always taken. A branch is a program of its own, of small arrays alone, and so
        # XLA runs it in order (`lanes.py`), whatever there is around it.
        return jax.lax.cond(tick.step > 0, moved, lambda now, _: now, now, tick), None

    def pushed(now: _Now, tick: Ticks) -> tuple[_Now, None]:
        push, quiet_s = pulse_wrench(
            pulses, tick.start, tick.step, now.motion, vehicle, now.quiet_s, axis
        )
        return advance(now._replace(push=push, quiet_s=quiet_s), tick)

    def steps(one_step: Any, now: _Now, part: Ticks) -> _Now:
        # Backwards, a step is calculated again instead of being kept whole.
        again = jax.checkpoint(one_step, prevent_cse=False)
        return jax.lax.scan(again, now, part)[0]

    def few(now: _Now, part: Ticks) -> tuple[_Now, None]:
        if not now.quiet_s:
            return steps(advance, now, part), None
        end_s = part.start[-1] + part.step[-1]
        loud = end_s > functools.reduce(jnp.minimum, now.quiet_s)
        return jax.lax.cond(
            loud,
            lambda now: steps(pushed, now, part),
            lambda now: steps(advance, now._replace(push=(zero, zero)), part),
            now,
        ), None

    def stretch(now: _Now, part: Ticks) -> tuple[_Now, tuple[Motion, Wrench]]:
        size = part.step.size
        block = max(n for n in range(1, BLOCK + 1) if size % n == 0)
        blocks = jax.tree.map(lambda x: x.reshape(-1, block, *x.shape[1:]), part)
        now, _ = jax.lax.scan(few, now, blocks)
        return now, (now.motion, now.push)

    def wrench(row: tuple[Motion, Wrench], time: Number) -> Wrench:
        motion, push = row
        rate = rates_of(push, time, motion.rotor_speed, motion)
        return net_wrench(vehicle, motion, rate)

    start = components(flight.state)
    start = start._replace(quaternion=unit(start.quaternion))
    nothing = jnp.zeros_like(period_s)
    zero = (nothing, nothing, nothing)
    pulses = [load for load in flight.loads if isinstance(load, Pulse)]
    quiet_s = tuple(-jnp.inf + nothing for _ in pulses)
    now = _Now(
        start,
        start.rotor_speed,
        jax.tree.map(_numbers, memory),
        (zero, zero),
        quiet_s,
    )
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


def _numbers(array: Array) -> tuple[Array, ...]:
    """Take a small array apart, as `Motion` is."""
    return tuple(jnp.ravel(array))


def _whole(numbers: tuple[Array, ...], shape: jax.ShapeDtypeStruct) -> Array:
    """Put it together."""
    return jnp.stack(numbers).reshape(shape.shape)


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
