"""A charge, and the part of its wave that passes a vehicle within a step of its flight.

The front leaves an impulse of its own on a body that it crosses; the wind behind it is
that of `drag.py`.
"""

from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.constants import AIR_HEAT_CAPACITY_RATIO
from jblast.types import as_float_array
from jblast.vehicle.dynamics.components import Number, Vector, three
from jblast.vehicle.dynamics.state import State
from jblast.vehicle.loads.blast.wave import (
    FIRST,
    Wave,
    arrival_time,
    wave_at,
    wind_speed,
)
from jblast.vehicle.quadrotor.parameters import Body
from jblast.waves.paths import slant_range
from jblast.waves.scaling import sachs_distance_factor


class Surroundings(NamedTuple):
    """The air that waves go through.

    Attributes:
        pressure_pa: Ambient.
        sound_speed_m_s: In still air.
        wind_m_s: East, north, up; it carries the waves.
    """

    pressure_pa: Float[Array, ""]
    sound_speed_m_s: Float[Array, ""]
    wind_m_s: Float[Array, "3"]


class Blast(eqx.Module):
    """A charge as the loads need it.

    Attributes:
        position_m: East, north, up.
        time_s: Of detonation; infinite: it never happens.
        mass_kg: TNT that makes the same pressure.
        impulse_mass_kg: TNT that makes the same impulse.
        burst: "surface" or "free-air".
    """

    position_m: Float[Array, "*batch 3"] = eqx.field(converter=as_float_array)
    time_s: Float[Array, "*batch"] = eqx.field(converter=as_float_array)
    mass_kg: Float[Array, "*batch"] = eqx.field(converter=as_float_array)
    impulse_mass_kg: Float[Array, "*batch"] = eqx.field(converter=as_float_array)
    burst: str = eqx.field(static=True, default="surface")

    @property
    def never(self) -> Bool[Array, "*batch"]:
        """Whether it never happens."""
        return jnp.isposinf(self.time_s)

    def by(self, time_s: Float[Array, "..."]) -> "Blast":
        """Return a blast that never happens as if it did at a time; others as they are.

        For what is computed before it is masked: an infinite time has gradients that
        are no numbers, masked or not.
        """
        return replace(self, time_s=jnp.where(self.never, time_s, self.time_s))

    def way(
        self, air: Surroundings, position_m: Float[Array, "... 3"]
    ) -> tuple[Float[Array, "..."], Float[Array, "... 3"], Float[Array, "..."]]:
        """Return distance [m], direction and speed of sound along it [m/s].

        Nearer than the laws' start everything is as it is there.
        """
        source = jnp.broadcast_to(self.position_m, position_m.shape)
        distance = slant_range(source, position_m)
        nearest = FIRST * sachs_distance_factor(self.mass_kg, air.pressure_pa)
        distance = jnp.maximum(distance, nearest)
        away = (position_m - source) / distance[..., None]
        along = away[..., 0] * air.wind_m_s[0] + away[..., 1] * air.wind_m_s[1]
        return distance, away, air.sound_speed_m_s + along

    def travel_time_s(
        self, air: Surroundings, position_m: Float[Array, "... 3"]
    ) -> Float[Array, "..."]:
        """Return the time from detonation to the front [s]."""
        distance, _, speed = self.way(air, position_m)
        return arrival_time(distance, self.mass_kg, air.pressure_pa, speed, self.burst)

    def wave(self, air: Surroundings, position_m: Float[Array, "... 3"]) -> Wave:
        """Return what passes a place."""
        distance, _, _ = self.way(air, position_m)
        return wave_at(
            distance,
            self.mass_kg,
            self.impulse_mass_kg,
            air.pressure_pa,
            air.sound_speed_m_s,
            self.burst,
        )


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


def crossing_time(body: Body, wave: Wave) -> Number:
    """Return how long the front takes across the sphere of a body's mean area [s]."""
    speed = wave.sound_speed_m_s * jnp.sqrt(1 + 6 / 7 * wave.peak)
    area = jnp.mean(body.area_m2)
    known = ~(area <= 0)
    diameter = jnp.sqrt(4 / jnp.pi * jnp.where(known, area, 1.0))
    return jnp.where(known, diameter, 1e-3) / speed


def front_impulse(
    body: Body, passage: Passage, since_s: Float[Array, "..."]
) -> Float[Array, "..."]:
    r"""Return what pressure gradient and added mass have given until then [N s].

    $\rho_0 V (1 + C_m)\,Du/Dt$. With the ambient density the gradient's part is exact
    across a shock, $p_s/U = \rho_0 u_s$. As an impulse it is $\rho_0 V (1 + C_m)$ times
    the change of $u$: whatever the step, a jump is whole. That the added mass also
    resists the vehicle's own acceleration is left out: $\rho_0 V C_m$ is below 1e-3 of
    its mass.
    """
    wave = passage.wave
    crossed = jnp.clip(since_s / crossing_time(body, wave) + 0.5, 0, 1)
    moved = passage.air_density * body.volume_m3 * (1 + body.added_mass_coefficient)
    return moved * crossed * wind_speed(wave, jnp.maximum(since_s, 0))
