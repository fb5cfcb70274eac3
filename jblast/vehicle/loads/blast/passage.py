"""The part of a blast wave that passes a vehicle within a step of its flight."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import AIR_HEAT_CAPACITY_RATIO
from jblast.vehicle.dynamics.components import Number, Vector, three
from jblast.vehicle.dynamics.state import State
from jblast.vehicle.loads.blast.burst import Blast, Surroundings
from jblast.vehicle.loads.blast.wave import Wave


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


def blast_passage(
    blast: Blast,
    air: Surroundings,
    start_s: Float[Array, ""],
    end_s: Float[Array, ""],
    state: State,
    acceleration: Float[Array, "3"],
) -> Passage:
    """Return the part of a wave that passes within a step.

    Args:
        blast: The charge.
        air: What its wave goes through.
        start_s: When the step begins.
        end_s: When it ends.
        state: Of the vehicle at its beginning.
        acceleration: Of the vehicle without the blast, world [m/s2].
    """
    step = end_s - start_s
    way = (state.velocity_m_s + acceleration * step / 2) * step
    places = jnp.stack([state.position_m, state.position_m + way])
    came = blast.time_s + blast.travel_time_s(air, places)
    first, last = start_s - came[0], end_s - came[1]
    met = jnp.clip(-first / (last - first), 0, 1)
    # From where the front meets it to where half of the positive phase is over, or to
    # the step's end: the drag is that of the middle.
    half = blast.wave(air, state.position_m + met * way).duration_s / 2
    left = jnp.minimum(1, met + half / step)
    place = state.position_m + (met + left) / 2 * way
    _, away, speed = blast.way(air, place)
    wave = blast.wave(air, place)
    density = AIR_HEAT_CAPACITY_RATIO * air.pressure_pa
    return Passage(
        wave=wave,
        away=three(away),
        start_s=first,
        end_s=last,
        rate=(last - first) / step,
        front_speed_m_s=speed * jnp.sqrt(1 + 6 / 7 * wave.peak),
        air_density=density / jnp.square(air.sound_speed_m_s),
    )
