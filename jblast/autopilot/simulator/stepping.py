"""One turn of a vehicle that somebody else flies: told, then moved by what is asked.

The equations, pulses and steps are those of `vehicle.simulate`: a flight by the same
rotor speeds is the same flight.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray

from jblast.autopilot.simulator.geodesy import Origin
from jblast.autopilot.simulator.readings import readings_of
from jblast.sensors.carried.suite import Held, Suite
from jblast.vehicle import State
from jblast.vehicle.dynamics.components import four, joined
from jblast.vehicle.rollout.flight import Flight
from jblast.vehicle.rollout.step import Now, OneStep
from jblast.vehicle.rollout.timetable import INWARD, Ticks

PERIOD_S = 0.004
"""Of a turn: PX4's simulators send 250 samples a second."""


class Carried(NamedTuple):
    """What is carried from turn to turn.

    Attributes:
        now: The vehicle and what acts on it.
        before: Its state a turn ago.
        held: What its instruments keep.
    """

    now: Now
    before: State
    held: Held


class Turns(eqx.Module):
    """The turns of one vehicle.

    Attributes:
        flight: The vehicle, its start, wind and loads; without a controller.
        suite: Its instruments.
        origin: Where the scene lies.
        key: Of the instruments' draws.
    """

    flight: Flight
    suite: Suite
    origin: Origin
    key: PRNGKeyArray

    def start(self) -> Carried:
        """Return what there is before the first turn."""
        state = self.flight.state
        return Carried(self._step().start(), state, self.suite.start(self.key, state))

    def reported(
        self, carried: Carried, turn: Int[Array, ""], world_turn: Int[Array, ""]
    ) -> tuple[Carried, Float[Array, " number"]]:
        """Return what is carried on from a turn, and what is told at it.

        Args:
            carried: From the turn before.
            turn: Counted since the instruments were switched on.
            world_turn: Counted since the clock of the blasts goes.

        Returns:
            The numbers of `Readings`, then the state: position, velocity, quaternion,
            body rate, rotor speeds.
        """
        state = joined(carried.now.motion)
        period = jnp.asarray(PERIOD_S, float)
        time_s = jnp.asarray(world_turn, float) * period
        sample, held = self.suite(
            self.key, turn, carried.held, carried.before, state, time_s, period
        )
        reported = readings_of(
            self.origin,
            sample,
            state,
            self.suite.wind_m_s,
            self.suite.ground_temperature_k,
            self.suite.gps.noise(),
        )
        numbers = jnp.concatenate(
            [*map(jnp.ravel, reported), *map(jnp.ravel, _of(state))]
        )
        return Carried(carried.now, state, held), numbers

    def moved(
        self,
        carried: Carried,
        world_turn: Int[Array, ""],
        speeds_rad_s: Float[Array, "4"],
    ) -> Carried:
        """Return what there is after a turn.

        Args:
            carried: As `reported` left it.
            world_turn: Counted since the clock of the blasts goes.
            speeds_rad_s: Asked of the rotors.
        """
        start = jnp.asarray(world_turn, float) * PERIOD_S
        inward = jnp.maximum(
            INWARD * PERIOD_S, 2 * np.finfo(float).eps * (start + PERIOD_S)
        )
        stages = start + jnp.stack([inward, 0.5 * PERIOD_S, PERIOD_S - inward])
        none = jnp.zeros((3,), jnp.int32)
        length = jnp.asarray(PERIOD_S, float)
        tick = Ticks(stages, start, length, none, jnp.asarray(True))
        now = carried.now._replace(command=four(speeds_rad_s))
        return carried._replace(now=self._step().advance_pushed(now, tick))

    def _step(self) -> OneStep:
        period = jnp.asarray(PERIOD_S, float)
        return OneStep(self.flight, period, "rk4", False, None)


class Programs(NamedTuple):
    """The turns of one vehicle, compiled; both return what is carried and told next.

    Attributes:
        first: Takes nothing.
        after: Takes what is carried, the turn, the world's turn, whether the vehicle
            moves, and its rotor speeds.
    """

    first: Callable[[], tuple[Carried, Array]]
    after: Callable[..., tuple[Carried, Array]]


def programs(turns: Turns) -> Programs:
    """Compile the turns of a vehicle, before anybody waits.

    Arrays are the programs' arguments: another scene of the same shape takes no other.
    """
    arrays, rest = eqx.partition(turns, eqx.is_array)

    def first(arrays: Turns) -> tuple[Carried, Array]:
        own = eqx.combine(arrays, rest)
        return own.reported(own.start(), jnp.asarray(0), jnp.asarray(0))

    def after(
        arrays: Turns, carried: Carried, turn: Any, world: Any, goes: Any, speeds: Any
    ) -> tuple[Carried, Array]:
        own = eqx.combine(arrays, rest)
        moved = own.moved(carried, world, speeds)
        carried = jax.tree.map(lambda a, b: jnp.where(goes, a, b), moved, carried)
        return own.reported(carried, turn + 1, world + jnp.asarray(goes, int))

    begin, goes_on = jax.jit(first), jax.jit(after)
    carried, _ = begin(arrays)
    goes_on(arrays, carried, 0, 0, False, np.zeros(4))
    return Programs(partial(begin, arrays), partial(goes_on, arrays))


def _of(state: State) -> tuple[Array, ...]:
    return (
        *(state.position_m, state.velocity_m_s, state.quaternion),
        *(state.body_rate_rad_s, state.rotor_speed_rad_s),
    )
