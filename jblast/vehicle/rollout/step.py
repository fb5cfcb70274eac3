"""One step of a flight: the controller asked, pulses taken in, the state moved on."""

from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jblast.vehicle.dynamics.components import (
    Four,
    Number,
    StateComponents,
    Vector,
    components,
    four,
    joined,
)
from jblast.vehicle.dynamics.equations import Wrench, rates
from jblast.vehicle.dynamics.integrators import INTEGRATORS, normal
from jblast.vehicle.loads.load import Pulse, load_wrench, pulse_wrench
from jblast.vehicle.rollout.flight import Flight, wind_at
from jblast.vehicle.rollout.timetable import Ticks

MOST_APART = 16
"""Numbers of an array that a controller remembers one by one."""


class Now(NamedTuple):
    """What is carried from step to step.

    Attributes:
        motion: The state.
        excess: By how much the rotors' speeds are too large, as their sums were
            rounded; None in float64.
        command: Rotor speeds asked for [rad/s].
        memory: The controller's.
        impulse_wrench: Mean of the pulses over the step.
        inactive_until_s: Until when each pulse gives nothing.
    """

    motion: StateComponents
    excess: Four | None
    command: Four
    memory: PyTree[Array]
    impulse_wrench: Wrench
    inactive_until_s: tuple[Number, ...]


@dataclass(frozen=True, eq=False)
class OneStep:
    """What a vehicle's steps have in common.

    Attributes:
        flight: The vehicle, its start and what acts on it; its controller is ready.
        period_s: Time between two turns of the controller [s].
        integrator: "rk4" or "euler".
        control_held: Whether there are steps at which the controller is not asked.
        axis: Of the vehicles that fly in one chunk, as `vmap` names it; None: one flies
            alone.
    """

    flight: Flight
    period_s: Float[Array, ""]
    integrator: str
    control_held: bool
    axis: str | None

    def start(self) -> Now:
        """Return what there is before the first step."""
        motion = normal(components(self.flight.state))
        zero = jnp.zeros_like(self.period_s)
        single = zero.dtype == jnp.float32
        return Now(
            motion,
            (zero, zero, zero, zero) if single else None,
            motion.rotor_speed,
            jax.tree.map(_numbers, self._memory()),
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

    def advance(self, now: Now, tick: Ticks) -> Now:
        """Take a step."""
        if self.flight.control is not None:
            now = self._asked(now, tick)
        # Always taken. A branch is a program of its own, of small arrays alone, and so
        # XLA runs it in order (`batching.py`), whatever there is around it.
        return jax.lax.cond(tick.step > 0, self.moved, lambda now, _: now, now, tick)

    def advance_pushed(self, now: Now, tick: Ticks) -> Now:
        """Take a step in which a pulse may come."""
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

    def _asked(self, now: Now, tick: Ticks) -> Now:
        """Ask the controller, if it is its turn."""

        def ask(now: Now) -> Now:
            command, memory = self.flight.control(
                tick.start,
                joined(now.motion),
                self.flight.vehicle,
                jax.tree.map(lambda s, n: _whole(n, s), self._memory(), now.memory),
                self.period_s,
            )
            return now._replace(
                command=four(command), memory=jax.tree.map(_numbers, memory)
            )

        turn = tick.sample if self.control_held else tick.step > 0
        return jax.lax.cond(turn, ask, lambda now: now, now)

    def moved(self, now: Now, tick: Ticks) -> Now:
        """Take a step with the command as it is, in the branch that one stands in."""
        flight = self.flight

        def stage_rates(stage: int, motion: StateComponents) -> StateComponents:
            command = now.command
            if flight.commands is not None:
                command = four(flight.commands[tick.command[stage]])
            return self.rates(now.impulse_wrench, tick.stages[stage], command, motion)

        gain = INTEGRATORS[self.integrator](stage_rates, now.motion, tick.step)
        motion, excess = _sum(now.motion, now.excess, gain)
        motion = _grounded(flight.ground_up_m, normal(motion))
        return now._replace(motion=motion, excess=excess)


def _sum(
    motion: StateComponents, excess: Four | None, gain: StateComponents
) -> tuple[StateComponents, Four | None]:
    """Add what a step gives; to the rotors by Kahan's sum.

    Of all numbers theirs grow the least in a step for their size: at steps of 0.1 ms
    what rounds away takes a flight 2 mm off in 2.5 s, this sum 0.2 mm.
    """
    total = jax.tree.map(jnp.add, motion, gain)
    if excess is None:
        return total, None
    was = motion.rotor_speed
    gained = [
        g - jax.lax.stop_gradient(e)
        for g, e in zip(gain.rotor_speed, excess, strict=True)
    ]
    a, b, c, d = (x + g for x, g in zip(was, gained, strict=True))
    i, j, k, m = (
        (new - x) - g for new, x, g in zip((a, b, c, d), was, gained, strict=True)
    )
    return total._replace(rotor_speed=(a, b, c, d)), (i, j, k, m)


def _numbers(array: Array) -> tuple[Array, ...]:
    """Take a small array apart, as `StateComponents` is; a matrix stays whole.

    A covariance taken apart is a program of thousands of instructions, which takes
    minutes to compile.
    """
    return (array,) if array.size > MOST_APART else tuple(jnp.ravel(array))


def _whole(numbers: tuple[Array, ...], like: Array) -> Array:
    """Put it together."""
    if like.size > MOST_APART:
        return numbers[0]
    return jnp.stack(numbers).reshape(like.shape)


def _grounded(
    ground: Float[Array, ""] | None, motion: StateComponents
) -> StateComponents:
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
