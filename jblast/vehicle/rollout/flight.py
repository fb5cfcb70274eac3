"""What a flight is made of, and what is kept of it."""

from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.errors import InputError
from jblast.vehicle.dynamics.components import Number, StateComponents, Vector, three
from jblast.vehicle.dynamics.equations import Wrench
from jblast.vehicle.dynamics.state import State
from jblast.vehicle.quadrotor.parameters import Vehicle


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


class StoredRows(NamedTuple):
    """Stored rows, each part a tuple of components."""

    motion: StateComponents
    wrench: Wrench
    alive: Bool[Array, "..."]


def wind_at(flight: Flight, time: Number, motion: StateComponents) -> Vector:
    """Return the velocity of the air at a vehicle [m/s].

    Raises:
        InputError: The wind does not give three numbers.
    """
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
