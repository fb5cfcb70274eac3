"""What a flight is made of, and what is kept of it."""

from typing import Any, NamedTuple

from jaxtyping import Array, Bool, Float

from jblast.vehicle.dynamics import Wrench
from jblast.vehicle.motion import Motion
from jblast.vehicle.parameters import Vehicle
from jblast.vehicle.state import State


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
