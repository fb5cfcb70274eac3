r"""The load of blasts on a vehicle, at its position and as it moves.

The load has three parts, each optional.

1. Drag of the blast wind, quasi-steady, on the body's own areas and at its centre of
   pressure:

   $$F = \tfrac12 \rho C_d \sqrt{\sum_i (A_i r_i)^2}\;r, \qquad r = w - v$$

   where $r$ is the wind past the vehicle along body axes. The area depends on direction
   like the projected area of an ellipsoid.
2. Pressure gradient and added mass as the front crosses the body, at the same point.
3. The rotors in the blast wind: forces and moments of the equations of flight with the
   blast wind minus those without. Frame drag is excluded, because part 1 replaces it.
   The rotors' coefficients are fitted at a few metres per second, and a rotor's lift
   lags by some revolutions. In a blast wind both are extrapolated far.

The time since arrival is that at the vehicle's position, which within a step moves with
the velocity and acceleration at its beginning. Overlapping blasts are added, as if drag
were linear.

A step may contain the whole wave. So the forces are integrated by Gauss's rule over the
part of each phase within the step, node by node in order of time. At each node they are
those in the air at that time, on a vehicle whose velocity includes the impulse so far.

A burst in free air has a second wave, reflected by the ground. It is the free-air wave
of the mirror image of the charge: later, weaker, and directed upwards. On the ground
both waves arrive simultaneously and the pressure is doubled (the rigid wall of
acoustics, as for microphones). The reflection is computed like any blast, so its
impulse within a step is complete. Real strong fronts are reflected more strongly: at
the ground, head on, by $1 + 3x/(7 + x)$ (Rankine and Hugoniot), 1.04 at 10 kPa, 1.37 at
100. A burst whose reflection arrives within the positive phase, as in the region of the
Mach stem, has the surface curves and one front. The vehicle does not deflect the front.

The jolt is the change of velocity by the whole wave,

$$\Delta v = \frac1m \int F_{blast}\,dt$$

over front and suction: the impulse of one step in which the wave passes a hovering
vehicle. Rotation, rotor dynamics and controller are neglected; `calibration.jolts`
measures their effect.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.types import as_numbers
from jblast.vehicle.dynamics import Wrench, air_wrench
from jblast.vehicle.loads.blast_wave import (
    RANGE,
    Blast,
    NodePlace,
    Surroundings,
    blast_passage,
    crossing_time,
    front_impulse,
    nodes,
)
from jblast.vehicle.quadrotor import Body, Vehicle, required_body
from jblast.vehicle.state import (
    MatrixRows,
    Number,
    State,
    Vector,
    add,
    components,
    cross,
    root,
    rotation,
    three,
    times,
    times_transposed,
    unit,
)
from jblast.waves.paths import slant_range
from jblast.waves.scaling import scaled_distance

MAX_ACCELERATION_M_S2 = 300.0
"""Bound on a vehicle's acceleration outside waves, in `quiet_until`.

Far above that of the models' rotors (some 20 m/s2) and of a racing vehicle (150); a
larger bound only shortens the intervals in which a wave is not evaluated.
"""
T = TypeVar("T")


class BlastLoad(eqx.Module):
    """Pulse of blasts on a vehicle.

    Attributes:
        waves: The charges, followed by the mirror images whose waves are the ground
            reflections.
        charges: Number of charges.
        pressure_pa: Ambient pressure.
        sound_speed_m_s: Speed of sound in still air.
        wind_m_s: Ambient wind, east, north, up; it advects the waves.
        drag: Include the drag of the blast wind on the body.
        front: Include the impulse of the front that crosses the body.
        rotors: Include the rotors' forces in the blast wind.
    """

    waves: Blast
    charges: int = eqx.field(static=True)
    pressure_pa: Float[Array, "*batch"] = eqx.field(converter=as_numbers)
    sound_speed_m_s: Float[Array, "*batch"] = eqx.field(converter=as_numbers)
    wind_m_s: Float[Array, "*batch 3"] = eqx.field(converter=as_numbers)
    drag: bool = eqx.field(static=True, default=True)
    front: bool = eqx.field(static=True, default=True)
    rotors: bool = eqx.field(static=True, default=True)

    @property
    def blasts(self) -> Blast:
        """The charges alone."""
        return jax.tree.map(lambda x: x[: self.charges], self.waves)

    @property
    def air(self) -> Surroundings:
        """The ambient air."""
        return Surroundings(self.pressure_pa, self.sound_speed_m_s, self.wind_m_s)

    def impulse(
        self,
        start_s: Float[Array, ""],
        end_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
    ) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        """Return the impulse of the blasts on a vehicle between two times.

        Returns:
            Impulse, world [N s], and angular impulse about the centre of mass, body
            [N m s].

        Raises:
            InputError: The vehicle has no `body`.
        """
        motion, wind = components(state), three(self.wind_m_s)
        attitude, mass = rotation(unit(motion.quaternion)), vehicle.mass_kg
        x, y, z = times(attitude, air_wrench(vehicle, motion, wind)[0])
        acceleration = x / mass, y / mass, z / mass - FLIGHT_GRAVITY
        vehicle = self.exposed(vehicle)
        body = required_body(vehicle.body)

        def about(force: Vector) -> Vector:
            """Return the moment of a force at the centre of pressure."""
            arm = three(body.pressure_centre_m)
            return cross(arm, times_transposed(attitude, force))

        def wrench(air: Vector, density: Number, velocity: Vector) -> Wrench:
            """Return force, world, and moment, body, in moving air."""
            moved = motion._replace(velocity=velocity)
            force, moment = air_wrench(vehicle, moved, air)
            drag = drag_force(
                body, attitude, density, add(air, _scaled(velocity, -1.0))
            )
            return add(times(attitude, force), drag), add(moment, about(drag))

        def of(blast: Blast) -> Wrench:
            passage = blast_passage(
                blast, self.air, start_s, end_s, state, jnp.stack(acceleration)
            )
            before = front_impulse(body, passage, passage.start_s)

            def front(since_s: Number) -> Vector:
                """Return the front's impulse since the beginning of the step."""
                crossed = front_impulse(body, passage, since_s)
                return _scaled(passage.away, crossed - before)

            def node(
                carried: tuple[Wrench, Vector], place: NodePlace
            ) -> tuple[tuple[Wrench, Vector], None]:
                given, last = carried
                wave = passage.node(place)
                past_s = (wave.since - passage.start_s) / passage.rate
                # Half of a node's own impulse precedes it, at about the last force.
                push = add(given[0], _scaled(last, wave.part / 2))
                gained = _scaled(add(push, front(wave.since)), 1 / mass)
                own = add(motion.velocity, _scaled(acceleration, past_s))
                velocity = add(own, gained)
                blown = add(wind, _scaled(passage.away, wave.wind))
                now = wrench(blown, wave.density, velocity)
                still = wrench(wind, passage.air_density, velocity)
                added = jax.tree.map(lambda a, b: a - b, now, still)
                given = jax.tree.map(lambda x, a: x + wave.part * a, given, added)
                return (given, added[0]), None

            zero = jnp.zeros_like(passage.start_s)
            none = (zero, zero, zero)
            start = (none, none), none
            ((push, turn), _), _ = jax.lax.scan(node, start, nodes(zero.dtype))
            whole = front(passage.end_s)
            return add(push, whole), add(turn, about(whole))

        push, turn = (jnp.sum(jnp.stack(x), axis=1) for x in self.of_waves(of, 0.0))
        return push, turn

    def exposed(self, vehicle: Vehicle) -> Vehicle:
        """Return the vehicle with only those properties on which a blast acts.

        The drag of the frame is replaced by that of the body, and the rotors' thrust at
        rest is the same with and without the blast.

        Raises:
            InputError: The vehicle has no `body`.
        """
        body = required_body(vehicle.body)

        def part(value: Array, included: bool) -> Array:
            return value if included else jnp.zeros_like(value)

        return replace(
            vehicle,
            frame_drag=part(vehicle.frame_drag, False),
            thrust_coefficient=part(vehicle.thrust_coefficient, False),
            moment_coefficient=part(vehicle.moment_coefficient, False),
            rotor_drag=part(vehicle.rotor_drag, self.rotors),
            translational_lift=part(vehicle.translational_lift, self.rotors),
            body=replace(
                body,
                drag_coefficient=part(body.drag_coefficient, self.drag),
                volume_m3=part(body.volume_m3, self.front),
            ),
        )

    def quiet_until(
        self, start_s: Float[Array, ""], state: State, vehicle: Vehicle
    ) -> Float[Array, ""]:
        r"""Return a time until which no wave reaches the vehicle, whatever its motion.

        A front arrives earlier by at most 1/c for each metre nearer to the charge, and
        the end of a wave later by at most 4.7/c for each metre farther, whatever the
        burst. With this slowness $s$, speed $v$, acceleration up to $a$
        (`MAX_ACCELERATION_M_S2`) and the time $q$ to the front or since the end, a
        vehicle meets the wave no earlier than after $t$ with
        $q = s\,(v t + a t^2/2) \pm t$.
        """
        # Twice the wind speed also covers a wind across the line to the charge.
        sound = jnp.maximum(self.sound_speed_m_s - 2 * _length(self.wind_m_s), 1.0)
        begins_s, ends_s = self.span_s(state.position_m, vehicle)
        gone = start_s > ends_s
        left = jnp.where(gone, start_s - ends_s, jnp.maximum(begins_s - start_s, 0))
        slowness = jnp.where(gone, 4.7, 1.0) / sound
        linear = slowness * _length(state.velocity_m_s) + jnp.where(gone, -1.0, 1.0)
        square = slowness * MAX_ACCELERATION_M_S2
        wait = (jnp.sqrt(linear**2 + 2 * square * left) - linear) / square
        return start_s + jnp.min(wait)

    def span_s(
        self, position_m: Float[Array, "3"], vehicle: Vehicle
    ) -> tuple[Float[Array, " wave"], Float[Array, " wave"]]:
        """Return beginning and end of each wave's force [s]; infinite: never."""
        body = required_body(vehicle.body)

        def of(blast: Blast) -> tuple[Number, Number]:
            wave = blast.wave(self.air, position_m)
            came = blast.time_s + blast.travel_time_s(self.air, position_m)
            crossing = crossing_time(body, wave)  # half of it precedes the arrival
            # 5 % more than the wave's duration, for its growth along the vehicle's
            # path.
            lasts = crossing + 1.05 * (wave.duration_s + wave.suction_s)
            return came - crossing, came + lasts

        return self.of_waves(of, jnp.inf)

    def arrival_time_s(
        self, position_m: Float[Array, "... 3"]
    ) -> Float[Array, "... blast"]:
        """Return the arrival times of the direct fronts [s]; infinite: never."""

        def of(blast: Blast) -> Float[Array, "..."]:
            return blast.time_s + blast.travel_time_s(self.air, position_m)

        return jnp.moveaxis(self.of_waves(of, jnp.inf)[: self.charges], 0, -1)

    def of_waves(self, function: Callable[[Blast], T], absent: float | bool) -> T:
        """Map a function over the waves.

        Args:
            function: Function of one wave, to arrays.
            absent: Its value for a blast that never happens.
        """

        def of(blast: Blast) -> T:
            never = jnp.isposinf(blast.time_s)
            # An infinite time would give NaN gradients, masked or not.
            sometime = replace(blast, time_s=jnp.where(never, 0.0, blast.time_s))
            return jax.tree.map(
                lambda x: jnp.where(never, absent, x), function(sometime)
            )

        return jax.vmap(of)(self.waves)

    def in_range(self, position_m: Float[Array, "... 3"]) -> Bool[Array, "... blast"]:
        """Return whether positions are within the range of validity of all laws.

        Outside (`RANGE`) the load is finite but extrapolated. A blast that never
        happens has a known load: none.
        """

        def of(blast: Blast) -> Bool[Array, "..."]:
            source = jnp.broadcast_to(blast.position_m, position_m.shape)
            # ln Z needs a positive distance; at the charge Z is out of range anyway.
            distance = jnp.maximum(slant_range(source, position_m), 1e-9)
            z = scaled_distance(distance, blast.mass_kg, self.pressure_pa)
            first, last = (
                surface + blast.free_air * (free_air - surface)
                for surface, free_air in zip(*RANGE.values(), strict=True)
            )
            return (z >= first) & (z <= last)

        return jnp.moveaxis(self.of_waves(of, True)[: self.charges], 0, -1)


def _scaled(v: Vector, factor: float | Number) -> Vector:
    return v[0] * factor, v[1] * factor, v[2] * factor


def _length(v: Float[Array, "3"]) -> Float[Array, ""]:
    # No guard at zero: `pulse_wrench` stops the gradient of `quiet_until`.
    return jnp.sqrt(jnp.sum(jnp.square(v)))


def drag_force(
    body: Body, attitude: MatrixRows, density: Number, past: Vector
) -> Vector:
    """Return the drag, world [N]; its gradient at rest is zero.

    Args:
        body: Areas and drag coefficient.
        attitude: Body to world.
        density: Density of the air [kg/m3].
        past: Velocity of the air past the vehicle, world [m/s].
    """
    x, y, z = past
    r_x, r_y, r_z = times_transposed(attitude, past)
    a, b, c = three(body.area_m2)
    size = root((a * r_x) ** 2 + (b * r_y) ** 2 + (c * r_z) ** 2)
    half = 0.5 * density * body.drag_coefficient * size
    return half * x, half * y, half * z
