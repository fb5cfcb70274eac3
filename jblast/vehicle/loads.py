"""Loads on a vehicle beside air and weight, and the step's share of a short pulse.

A load is a function of time and state. A pulse tells its impulse between two times
instead: what falls into a step acts there as a constant force, so that the impulse is
whole whatever the step, even where the pulse is shorter.
"""

from typing import Protocol, runtime_checkable

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.vehicle.dynamics import Wrench
from jblast.vehicle.motion import Number, Vector, add, three
from jblast.vehicle.parameters import Vehicle
from jblast.vehicle.state import State


@runtime_checkable
class Load(Protocol):
    """A force that varies slowly within a step, jumps at a step's edges aside."""

    def __call__(
        self, time_s: Float[Array, ""], state: State, vehicle: Vehicle
    ) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        """Return force, world [N], and moment about the centre of mass, body [N m]."""
        ...


@runtime_checkable
class Pulse(Protocol):
    """A force that may come and go within a step."""

    def impulse(
        self,
        start_s: Float[Array, ""],
        end_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
    ) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        """Return what it gives between two times to a vehicle in a state.

        Returns:
            Impulse, world [N s], and angular impulse, body [N m s].
        """
        ...


def load_wrench(
    loads: tuple[Load | Pulse, ...],
    time_s: Number,
    state: State,
    vehicle: Vehicle,
    start: Wrench,
) -> Wrench:
    """Sum of the loads at a time, added to what is there."""
    for load in loads:
        if not isinstance(load, Pulse):
            start = _plus(start, load(time_s, state, vehicle), 1.0)
    return start


def pulse_wrench(
    loads: tuple[Load | Pulse, ...],
    start_s: Number,
    step_s: Number,
    state: State,
    vehicle: Vehicle,
) -> Wrench:
    """Mean over a step of the pulses, from the state at its beginning."""
    zero = three(jnp.zeros_like(state.position_m))
    total: Wrench = (zero, zero)
    for load in loads:
        if isinstance(load, Pulse):
            given = load.impulse(start_s, start_s + step_s, state, vehicle)
            total = _plus(total, given, 1 / step_s)
    return total


def _plus(
    total: Wrench,
    given: tuple[Float[Array, "3"], Float[Array, "3"]],
    scale: float | Number,
) -> Wrench:
    """Add what a load gave, scaled; in the precision of the flight."""
    dtype = total[0][0].dtype

    def scaled(vector: Float[Array, "3"]) -> Vector:
        x, y, z = three(vector.astype(dtype))
        return x * scale, y * scale, z * scale

    return add(total[0], scaled(given[0])), add(total[1], scaled(given[1]))
