"""The part of a blast wave that passes a vehicle within a step of its flight."""

from typing import NamedTuple

from jblast.vehicle.blast_wave import Wave
from jblast.vehicle.motion import Number, Vector


class Passage(NamedTuple):
    """The part of a wave that passes a vehicle within a step.

    Attributes:
        wave: At the vehicle.
        away: Direction from the charge.
        start_s: Time since arrival at the step's beginning.
        end_s: At its end.
        rate: Time since arrival over time: the vehicle runs from the front, or to it.
        front_speed_m_s: Over ground.
        air_density: Ambient [kg/m3].
    """

    wave: Wave
    away: Vector
    start_s: Number
    end_s: Number
    rate: Number
    front_speed_m_s: Number
    air_density: Number
