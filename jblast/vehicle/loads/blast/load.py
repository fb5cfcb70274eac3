r"""The loads of a scene's blasts on a vehicle, where it is and as it moves.

Three parts, each of which can be left out:

- drag of the blast wind on the body (`drag.py`), at its centre of pressure;
- pressure gradient and added mass as the front crosses it, likewise;
- the rotors in the blast wind: what the equations of flight give with it less what they
  give without, frame drag aside, for which the body's own stands. Their coefficients
  are fitted to a few metres a second, and a rotor's lift takes some turns to follow:
  in a blast wind both are carried far beyond.

The time since arrival is that at the vehicle's own place, which within a step moves on
with the velocity and acceleration of its beginning; what it meets is the wave there.
Blasts that overlap add up, as if drag were linear.

Of a burst in free air the ground sends a second wave, from the image of the charge as
far below it: the wave of free air at that distance, later, weaker, and pushing upwards;
on the ground both come at once and the pressure is doubled (the rigid wall of
acoustics, as for a microphone in `sensors.heard`). It is a blast as any other, so what
a step gives of it is whole. Strong fronts are reflected more strongly: at the ground,
head on, by $1 + 3x/(7 + x)$ (Rankine and Hugoniot), 1.04 at 10 kPa, 1.38 at 100. A
burst whose reflection comes within the positive phase, as in the Mach stem's region,
has the surface curves and one front. The vehicle does not turn the front.
"""

import functools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.types import as_float_array
from jblast.vehicle.dynamics.components import (
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
from jblast.vehicle.dynamics.equations import air_wrench
from jblast.vehicle.dynamics.state import State
from jblast.vehicle.loads.blast.alike import over_alike
from jblast.vehicle.loads.blast.drag import polynomial, rotors_in_wind, wind_impulse
from jblast.vehicle.loads.blast.passage import (
    Blast,
    Surroundings,
    blast_passage,
    crossing_time,
)
from jblast.vehicle.loads.blast.wave import RANGE, Wave
from jblast.vehicle.quadrotor.body import required_body
from jblast.vehicle.quadrotor.parameters import Vehicle
from jblast.waves.paths import slant_range
from jblast.waves.scaling import scaled_distance

MOST_ACCELERATION_M_S2 = 1e3
"""Beyond that of any rotors; a wave that gives more is not quiet."""
_UP = np.array([0.0, 0.0, 1.0])


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
        images: Whose waves come by way of the ground; those of charges not above it
            never happen.
    """

    blasts: tuple[Blast, ...]
    pressure_pa: Float[Array, "*batch"] = eqx.field(converter=as_float_array)
    sound_speed_m_s: Float[Array, "*batch"] = eqx.field(converter=as_float_array)
    wind_m_s: Float[Array, "*batch 3"] = eqx.field(converter=as_float_array)
    drag: bool = eqx.field(static=True, default=True)
    front: bool = eqx.field(static=True, default=True)
    rotors: bool = eqx.field(static=True, default=True)
    images: tuple[Blast, ...] = ()

    @property
    def waves(self) -> tuple[Blast, ...]:
        """Of the charges, and by way of the ground."""
        return (*self.blasts, *self.images)

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
        body = required_body(vehicle.body)
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

        def of(blast: Blast) -> tuple[Vector, Vector]:
            # one that never happens has not come by the step's end, and gives nothing
            happens = ~blast.never
            passage = blast_passage(
                blast.by(end_s),
                self.surroundings(),
                start_s,
                end_s,
                state,
                acceleration,
            )
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
            arm = three(body.pressure_centre_m)
            gained = given.body
            turned_by = cross(arm, times_transposed(attitude, given.body))
            if force is not None and moment is not None:
                gained = add(gained, polynomial(force, given))
                turned_by = add(turned_by, polynomial(moment, given))
            return _only(happens, gained), _only(happens, turned_by)

        impulse = angular_impulse = three(jnp.zeros_like(state.position_m))
        for gained, turned_by in over_alike(of, self.waves):
            impulse = add(impulse, gained)
            angular_impulse = add(angular_impulse, turned_by)
        return jnp.stack(impulse), jnp.stack(angular_impulse)

    def quiet_until(
        self, start_s: Float[Array, ""], state: State, vehicle: Vehicle
    ) -> Float[Array, ""]:
        """Return until when no wave reaches a vehicle, as fast as it may be.

        A front comes to a place earlier by 1/c at most for each metre nearer to the
        charge, so a vehicle at a speed v does not meet it before the share c/(c + v) of
        the time left at its place. Nor does one slower than c/5 overtake a wave: its
        end comes to a place later by 4.7/c at most for each metre farther from the
        charge, whatever the burst. Both hold while it gains no more speed than by
        `MOST_ACCELERATION_M_S2`.
        """
        body, blow = required_body(vehicle.body), _length(self.wind_m_s)
        # of a wind across the way too
        sound = jnp.maximum(self.sound_speed_m_s - 2 * blow, 0.0)
        speed, most = _length(state.velocity_m_s), MOST_ACCELERATION_M_S2

        def until(blast: Blast) -> Float[Array, ""]:
            wave, happens = self.wave_of(blast, state.position_m), ~blast.never
            came = self.front_time_s(blast, state.position_m, start_s)
            crossing = crossing_time(body, wave)  # of which half comes before
            left = jnp.maximum(came - crossing - start_s, 0)
            wait = left * sound / (sound + speed + most * left)
            over = start_s - came - crossing > 1.05 * (wave.duration_s + wave.suction_s)
            slow = jnp.maximum(sound / 5 - speed, 0) / most
            return jnp.where(happens, start_s + jnp.where(over, slow, wait), jnp.inf)

        never = jnp.asarray(jnp.inf, start_s.dtype)
        return functools.reduce(jnp.minimum, over_alike(until, self.waves), never)

    def arrival_time_s(
        self, position_m: Float[Array, "... 3"]
    ) -> Float[Array, "... blast"]:
        """Return when the fronts come to places, straight [s]; infinite: never."""

        def front(blast: Blast) -> Float[Array, "..."]:
            came = self.front_time_s(blast, position_m, jnp.zeros_like(blast.time_s))
            return jnp.where(blast.never, jnp.inf, came)

        return jnp.stack(over_alike(front, self.blasts), axis=-1)

    def front_time_s(
        self,
        blast: Blast,
        position_m: Float[Array, "... 3"],
        else_s: Float[Array, "..."],
    ) -> Float[Array, "..."]:
        """Return when a front comes to places [s].

        Args:
            blast: Whose.
            position_m: Where.
            else_s: When one that never happens is taken to have gone off.
        """
        travel = blast.travel_time_s(self.surroundings(), position_m)
        return blast.by(else_s).time_s + travel

    def wave_of(self, blast: Blast, position_m: Float[Array, "... 3"]) -> Wave:
        """Return what passes a place; without pressure if it never happens."""
        wave = blast.wave(self.surroundings(), position_m)
        return wave._replace(
            peak=jnp.where(blast.never, 0.0, wave.peak),
            suction=jnp.where(blast.never, 0.0, wave.suction),
        )

    def in_range(self, position_m: Float[Array, "... 3"]) -> Bool[Array, "... blast"]:
        """Return where the waves laws hold: elsewhere the load is finite, no more.

        On the surface Z = 0.178 to 40 m/kg^(1/3), in free air 0.147 to 36.975.
        """

        def holds(blast: Blast) -> Bool[Array, "..."]:
            first, last = RANGE[blast.burst]
            source = jnp.broadcast_to(blast.position_m, position_m.shape)
            distance = slant_range(source, position_m)
            positive = jnp.maximum(distance, 1e-9)
            z = scaled_distance(positive, blast.mass_kg, self.pressure_pa)
            return (z >= first) & (z <= last)

        return jnp.stack(over_alike(holds, self.blasts), axis=-1)

    def surroundings(self) -> Surroundings:
        """Return the air that the waves go through."""
        return Surroundings(self.pressure_pa, self.sound_speed_m_s, self.wind_m_s)


def _minus(v: Vector) -> Vector:
    return -v[0], -v[1], -v[2]


def _only(happens: Bool[Array, ""], v: Vector) -> Vector:
    x, y, z = (jnp.where(happens, part, 0.0) for part in v)
    return x, y, z


def _length(v: Float[Array, "3"]) -> Float[Array, ""]:
    return jnp.sqrt(jnp.sum(jnp.square(v)))
