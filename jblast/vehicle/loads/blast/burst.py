"""A charge, and what comes from it to a place."""

from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.types import as_float_array
from jblast.vehicle.loads.blast.curves import FIRST
from jblast.vehicle.loads.blast.wave import Wave, arrival_time, wave_at
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
