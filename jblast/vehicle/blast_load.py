r"""The loads of a scene's blasts on a vehicle, where it is and as it moves.

Three parts, each of which can be left out:

- drag of the blast wind on the body (`blast_drag.py`), at its centre of pressure;
- pressure gradient and added mass as the front crosses it, likewise;
- the rotors in the blast wind: what the equations of flight give with it less what they
  give without, frame drag aside, for which the body's own stands. Their coefficients
  are fitted to a few metres a second, and a rotor's lift takes some turns to follow:
  in a blast wind both are carried far beyond.

The time since arrival is that at the vehicle's own place, which within a step moves on
with the velocity and acceleration of its beginning; what it meets is the wave there.
Blasts that overlap add up, as if drag were linear.

Nothing is reflected but by the ground under a surface burst: no wave comes back from
the ground to a vehicle in the air, and the vehicle does not turn the front.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.constants import AIR_HEAT_CAPACITY_RATIO, FLIGHT_GRAVITY
from jblast.errors import InputError
from jblast.types import as_float_array
from jblast.vehicle.blast_curves import FIRST, RANGE
from jblast.vehicle.blast_drag import wind_impulse
from jblast.vehicle.blast_front import crossing_time
from jblast.vehicle.blast_passage import Passage
from jblast.vehicle.blast_rotors import polynomial, rotors_in_wind
from jblast.vehicle.blast_wave import Wave, arrival_time, wave_at
from jblast.vehicle.dynamics import air_wrench
from jblast.vehicle.motion import (
    Vector,
    add,
    components,
    cross,
    rotation,
    three,
    times_transposed,
    turned,
    unit,
)
from jblast.vehicle.parameters import Body, Vehicle
from jblast.vehicle.state import State
from jblast.waves.paths import slant_range
from jblast.waves.scaling import sachs_distance_factor, scaled_distance

_UP = np.array([0.0, 0.0, 1.0])


class Blast(eqx.Module):
    """A charge as the loads need it.

    Attributes:
        position_m: East, north, up.
        time_s: Of detonation.
        mass_kg: TNT that makes the same pressure.
        impulse_mass_kg: TNT that makes the same impulse.
        burst: "surface" or "free-air".
    """

    position_m: Float[Array, "*batch 3"] = eqx.field(converter=as_float_array)
    time_s: Float[Array, "*batch"] = eqx.field(converter=as_float_array)
    mass_kg: Float[Array, "*batch"] = eqx.field(converter=as_float_array)
    impulse_mass_kg: Float[Array, "*batch"] = eqx.field(converter=as_float_array)
    burst: str = eqx.field(static=True, default="surface")


class BlastLoad(eqx.Module):
    """The pulse that blasts give a vehicle; for a batch of scenes, wrap it in `Each`.

    Attributes:
        blasts: The charges.
        pressure_pa: Ambient pressure.
        sound_speed_m_s: In still air.
        wind_m_s: Of the air, east, north, up; it carries the waves.
        drag: Whether the blast wind drags the body.
        front: Whether the front pushes it as it crosses.
        rotors: Whether the rotors feel the blast wind.
    """

    blasts: tuple[Blast, ...]
    pressure_pa: Float[Array, "*batch"] = eqx.field(converter=as_float_array)
    sound_speed_m_s: Float[Array, "*batch"] = eqx.field(converter=as_float_array)
    wind_m_s: Float[Array, "*batch 3"] = eqx.field(converter=as_float_array)
    drag: bool = eqx.field(static=True, default=True)
    front: bool = eqx.field(static=True, default=True)
    rotors: bool = eqx.field(static=True, default=True)

    def impulse(
        self,
        start_s: Float[Array, ""],
        end_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
    ) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        """Return what the blasts give between two times to a vehicle in a state.

        Returns:
            Impulse, world [N s], and angular impulse about the centre of mass, body
            [N m s].

        Raises:
            InputError: Nothing is known of what a blast acts on.
        """
        body = _body(vehicle)
        motion = components(state)
        attitude = rotation(unit(motion.quaternion))
        wind = three(self.wind_m_s)
        air = add(wind, _minus(motion.velocity))
        flies = jnp.stack(
            turned(motion.quaternion, air_wrench(vehicle, motion, wind)[0])
        )
        acceleration = flies / vehicle.mass_kg - FLIGHT_GRAVITY * _UP.astype(
            flies.dtype
        )
        push = turn = three(jnp.zeros_like(state.position_m))
        for blast in self.blasts:
            passage = self._passage(blast, start_s, end_s, state, acceleration)
            force = moment = None
            if self.rotors:
                force, moment = rotors_in_wind(vehicle, motion, wind, passage)
            given = wind_impulse(
                body,
                vehicle.mass_kg,
                passage,
                attitude,
                air,
                three(acceleration),
                force,
                drag=self.drag,
                front=self.front,
            )
            push = add(push, given.body)
            arm = three(body.pressure_centre_m)
            turn = add(turn, cross(arm, times_transposed(attitude, given.body)))
            if force is not None and moment is not None:
                push = add(push, polynomial(force, given))
                turn = add(turn, polynomial(moment, given))
        return jnp.stack(push), jnp.stack(turn)

    def quiet_until(
        self, start_s: Float[Array, ""], state: State, vehicle: Vehicle
    ) -> Float[Array, ""]:
        """Return until when no wave reaches a vehicle slower than 70 m/s.

        It does not meet the front before three quarters of the time that is left at its
        place are over. Nor does it overtake a wave: its end comes to a place later by
        4.7/c_0 at most for each metre farther from the charge, whatever the burst.
        """
        quiet = jnp.asarray(jnp.inf, start_s.dtype)
        for n, blast in enumerate(self.blasts):
            wave = self.wave(n, state.position_m)
            came = blast.time_s + self._travel_time(blast, state.position_m)
            crossing = crossing_time(_body(vehicle), wave)
            left = came - crossing - start_s
            past = start_s - came - crossing > 1.05 * (wave.duration_s + wave.suction_s)
            until = start_s + 0.75 * jnp.maximum(left, 0)
            quiet = jnp.minimum(quiet, jnp.where(past, jnp.inf, until))
        return quiet

    def arrival_time_s(
        self, position_m: Float[Array, "... 3"]
    ) -> Float[Array, "... blast"]:
        """Return when the fronts come to places [s]."""
        return jnp.stack(
            [
                blast.time_s + self._travel_time(blast, position_m)
                for blast in self.blasts
            ],
            axis=-1,
        )

    def wave(self, blast: int, position_m: Float[Array, "... 3"]) -> Wave:
        """Return what passes a place."""
        return self._wave(self.blasts[blast], position_m)

    def in_range(self, position_m: Float[Array, "... 3"]) -> Bool[Array, "... blast"]:
        """Return where the waves laws hold: elsewhere the load is finite, no more.

        On the surface Z = 0.178 to 40 m/kg^(1/3), in free air 0.147 to 36.975.
        """
        found = []
        for blast in self.blasts:
            first, last = RANGE[blast.burst]
            source = jnp.broadcast_to(blast.position_m, position_m.shape)
            distance = slant_range(source, position_m)
            positive = jnp.maximum(distance, 1e-9)
            z = scaled_distance(positive, blast.mass_kg, self.pressure_pa)
            found.append((z >= first) & (z <= last))
        return jnp.stack(found, axis=-1)

    def _way(
        self, blast: Blast, position_m: Float[Array, "... 3"]
    ) -> tuple[Float[Array, "..."], Float[Array, "... 3"], Float[Array, "..."]]:
        """Return distance, direction and speed of sound along it.

        Nearer than the laws' start everything is as it is there.
        """
        source = jnp.broadcast_to(blast.position_m, position_m.shape)
        distance = slant_range(source, position_m)
        nearest = FIRST * sachs_distance_factor(blast.mass_kg, self.pressure_pa)
        distance = jnp.maximum(distance, nearest)
        away = (position_m - source) / distance[..., None]
        along = away[..., 0] * self.wind_m_s[0] + away[..., 1] * self.wind_m_s[1]
        return distance, away, self.sound_speed_m_s + along

    def _travel_time(
        self, blast: Blast, position_m: Float[Array, "... 3"]
    ) -> Float[Array, "..."]:
        distance, _, speed = self._way(blast, position_m)
        return arrival_time(
            distance, blast.mass_kg, self.pressure_pa, speed, blast.burst
        )

    def _wave(self, blast: Blast, position_m: Float[Array, "... 3"]) -> Wave:
        distance, _, _ = self._way(blast, position_m)
        return wave_at(
            distance,
            blast.mass_kg,
            blast.impulse_mass_kg,
            self.pressure_pa,
            self.sound_speed_m_s,
            blast.burst,
        )

    def _passage(
        self,
        blast: Blast,
        start_s: Float[Array, ""],
        end_s: Float[Array, ""],
        state: State,
        acceleration: Float[Array, "3"],
    ) -> Passage:
        """Return the part of a wave that passes within a step."""
        step = end_s - start_s
        way = (state.velocity_m_s + acceleration * step / 2) * step
        places = jnp.stack([state.position_m, state.position_m + way])
        came = blast.time_s + self._travel_time(blast, places)
        first, last = start_s - came[0], end_s - came[1]
        met = jnp.clip(-first / (last - first), 0, 1)
        # From where the front meets it to where half of the positive phase is over, or
        # to the step's end: the drag is that of the middle.
        half = self._wave(blast, state.position_m + met * way).duration_s / 2
        left = jnp.minimum(1, met + half / step)
        place = state.position_m + (met + left) / 2 * way
        _, away, speed = self._way(blast, place)
        wave = self._wave(blast, place)
        density = AIR_HEAT_CAPACITY_RATIO * self.pressure_pa
        return Passage(
            wave=wave,
            away=three(away),
            start_s=first,
            end_s=last,
            rate=(last - first) / step,
            front_speed_m_s=speed * jnp.sqrt(1 + 6 / 7 * wave.peak),
            air_density=density / jnp.square(self.sound_speed_m_s),
        )


def _minus(v: Vector) -> Vector:
    return -v[0], -v[1], -v[2]


def _body(vehicle: Vehicle) -> Body:
    body = vehicle.body
    if body is None:
        raise InputError(
            "vehicle: expected one with body_area, body_drag_coefficient, "
            "body_volume, added_mass_coefficient and pressure_centre for a blast "
            "to act on, got none of them"
        )
    return body
