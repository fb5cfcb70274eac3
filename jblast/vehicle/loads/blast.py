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

A step may contain the whole wave. So the drag is integrated by Gauss's rule over the
part of each phase within the step. The vehicle's velocity at each node includes the
impulse so far (one step of Picard's iteration), and the part of the wave that passes
within the step accounts for this motion, too. With a constant velocity, steps of 10 ms
would miss up to 1.4 %.

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

over front and suction, as if the wave passed a hovering vehicle within one step.
Forces, quadrature and the correction for the vehicle's motion are those of a step.
Rotation, rotor dynamics and controller are neglected; `calibration.jolts` measures
their effect.
"""

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.constants import AIR_HEAT_CAPACITY_RATIO, FLIGHT_GRAVITY
from jblast.types import as_numbers
from jblast.vehicle.dynamics import Wrench, air_wrench
from jblast.vehicle.loads.blast_wave import (
    RANGE,
    Blast,
    Node,
    NodePlace,
    Passage,
    Surroundings,
    Wave,
    blast_passage,
    crossing_time,
    front_impulse,
    node_at,
    places,
    until,
)
from jblast.vehicle.quadrotor import Body, Vehicle, required_body
from jblast.vehicle.state import (
    MatrixRows,
    Number,
    State,
    StateComponents,
    Vector,
    add,
    components,
    cross,
    dot,
    rotation,
    three,
    times_transposed,
    turned,
    unit,
)
from jblast.waves.paths import slant_range
from jblast.waves.scaling import scaled_distance

MAX_ACCELERATION_M_S2 = 1e3
"""Bound on a vehicle's acceleration outside waves, in `quiet_until`.

Far above that of any rotors (some 20 m/s2); a larger bound only shortens the intervals
in which a wave is not evaluated.
"""
_UP = np.array([0.0, 0.0, 1.0])
GainedImpulse = tuple[tuple[Array, Array, Array], Array]
"""Impulses until each node: drag and rotors, world; front, away from the charge."""
T = TypeVar("T")
R = TypeVar("R")


class BlastLoad(eqx.Module):
    """Pulse of blasts on a vehicle; for a batch of scenes, wrap it in `Each`.

    Attributes:
        blasts: The charges.
        pressure_pa: Ambient pressure.
        sound_speed_m_s: Speed of sound in still air.
        wind_m_s: Ambient wind, east, north, up; it advects the waves.
        drag: Include the drag of the blast wind on the body.
        front: Include the impulse of the front that crosses the body.
        rotors: Include the rotors' forces in the blast wind.
        images: Mirror images of the charges, whose waves are the ground reflections;
            the images of charges not above the ground never detonate.
    """

    blasts: tuple[Blast, ...]
    pressure_pa: Float[Array, "*batch"] = eqx.field(converter=as_numbers)
    sound_speed_m_s: Float[Array, "*batch"] = eqx.field(converter=as_numbers)
    wind_m_s: Float[Array, "*batch 3"] = eqx.field(converter=as_numbers)
    drag: bool = eqx.field(static=True, default=True)
    front: bool = eqx.field(static=True, default=True)
    rotors: bool = eqx.field(static=True, default=True)
    images: tuple[Blast, ...] = ()

    @property
    def waves(self) -> tuple[Blast, ...]:
        """Direct waves and ground reflections."""
        return (*self.blasts, *self.images)

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
        body = required_body(vehicle.body)
        motion = components(state)
        attitude = rotation(unit(motion.quaternion))
        wind = three(self.wind_m_s)
        v = motion.velocity
        air = add(wind, (-v[0], -v[1], -v[2]))
        flies = jnp.stack(
            turned(motion.quaternion, air_wrench(vehicle, motion, wind)[0])
        )
        # A float64 constant of NumPy would promote a flight in float32.
        acceleration = flies / vehicle.mass_kg - FLIGHT_GRAVITY * _UP.astype(
            flies.dtype
        )

        def of(blast: Blast) -> tuple[Vector, Vector]:
            # A blast that never happens is computed as a detonation at the step's end
            # and masked: an infinite time would give NaN gradients even if masked.
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
        for gained, turned_by in map_grouped(of, self.waves):
            impulse = add(impulse, gained)
            angular_impulse = add(angular_impulse, turned_by)
        return jnp.stack(impulse), jnp.stack(angular_impulse)

    def quiet_until(
        self, start_s: Float[Array, ""], state: State, vehicle: Vehicle
    ) -> Float[Array, ""]:
        """Return a time until which no wave reaches the vehicle, whatever its motion.

        A front arrives earlier by at most 1/c for each metre nearer to the charge. A
        vehicle at a speed v therefore does not meet it before the share c/(c + v) of
        the time left at its position. The end of a wave arrives later by at most 4.7/c
        for each metre farther from the charge, whatever the burst, so a vehicle slower
        than c/5 does not overtake a wave. Both bounds hold while the vehicle gains
        speed by at most `MAX_ACCELERATION_M_S2`.
        """
        body, blow = required_body(vehicle.body), _length(self.wind_m_s)
        # Twice the wind speed also covers a wind across the line to the charge.
        sound = jnp.maximum(self.sound_speed_m_s - 2 * blow, 0.0)
        speed, most = _length(state.velocity_m_s), MAX_ACCELERATION_M_S2

        def quiet(blast: Blast) -> Float[Array, ""]:
            wave, happens = self.wave_of(blast, state.position_m), ~blast.never
            came = self.front_time_s(blast, state.position_m, start_s)
            crossing = crossing_time(body, wave)  # half of it precedes the arrival
            left = jnp.maximum(came - crossing - start_s, 0)
            wait = left * sound / (sound + speed + most * left)
            # 5 % more than the wave's duration, for its growth along the vehicle's
            # path.
            over = start_s - came - crossing > 1.05 * (wave.duration_s + wave.suction_s)
            slow = jnp.maximum(sound / 5 - speed, 0) / most
            return jnp.where(happens, start_s + jnp.where(over, slow, wait), jnp.inf)

        never = jnp.asarray(jnp.inf, start_s.dtype)
        return functools.reduce(jnp.minimum, map_grouped(quiet, self.waves), never)

    def arrival_time_s(
        self, position_m: Float[Array, "... 3"]
    ) -> Float[Array, "... blast"]:
        """Return the arrival times of the direct fronts [s]; infinite: never."""

        def front(blast: Blast) -> Float[Array, "..."]:
            came = self.front_time_s(blast, position_m, jnp.zeros_like(blast.time_s))
            return jnp.where(blast.never, jnp.inf, came)

        return jnp.stack(map_grouped(front, self.blasts), axis=-1)

    def front_time_s(
        self,
        blast: Blast,
        position_m: Float[Array, "... 3"],
        else_s: Float[Array, "..."],
    ) -> Float[Array, "..."]:
        """Return the arrival time of a front [s].

        Args:
            blast: The blast.
            position_m: Positions: east, north, up.
            else_s: Substitute time of a blast that never happens.
        """
        travel = blast.travel_time_s(self.surroundings(), position_m)
        return blast.by(else_s).time_s + travel

    def wave_of(self, blast: Blast, position_m: Float[Array, "... 3"]) -> Wave:
        """Return the wave at positions; zero pressure if the blast never happens."""
        wave = blast.wave(self.surroundings(), position_m)
        return wave._replace(
            peak=jnp.where(blast.never, 0.0, wave.peak),
            suction=jnp.where(blast.never, 0.0, wave.suction),
        )

    def in_range(self, position_m: Float[Array, "... 3"]) -> Bool[Array, "... blast"]:
        """Return whether positions are within the range of validity of all laws.

        Outside (`RANGE`) the load is finite but extrapolated.
        """

        def holds(blast: Blast) -> Bool[Array, "..."]:
            first, last = RANGE[blast.burst]
            source = jnp.broadcast_to(blast.position_m, position_m.shape)
            distance = slant_range(source, position_m)
            # ln Z needs a positive distance; at the charge Z is out of range anyway.
            positive = jnp.maximum(distance, 1e-9)
            z = scaled_distance(positive, blast.mass_kg, self.pressure_pa)
            return (z >= first) & (z <= last)

        return jnp.stack(map_grouped(holds, self.blasts), axis=-1)

    def surroundings(self) -> Surroundings:
        """Return the ambient air."""
        return Surroundings(self.pressure_pa, self.sound_speed_m_s, self.wind_m_s)


def _only(happens: Bool[Array, ""], v: Vector) -> Vector:
    x, y, z = (jnp.where(happens, part, 0.0) for part in v)
    return x, y, z


def _length(v: Float[Array, "3"]) -> Float[Array, ""]:
    # No guard at zero: `pulse_wrench` stops the gradient of `quiet_until`.
    return jnp.sqrt(jnp.sum(jnp.square(v)))


class RotorForce(NamedTuple):
    """Additional force of the rotors in a wind along one direction.

    Attributes:
        linear: Coefficient of the wind speed: world [N s/m].
        square: Coefficient of its square: world [N s2/m2].
    """

    linear: Vector
    square: Vector


class WindImpulse(NamedTuple):
    """Impulse of the blast wind within a step.

    Attributes:
        body: Impulse of drag and front, world [N s].
        way: Integral of the wind speed, factor of `RotorForce.linear` [m].
        square: Integral of its square, factor of `RotorForce.square` [m2/s].
    """

    body: Vector
    way: Number
    square: Number


def wind_impulse(
    body: Body,
    mass_kg: Number,
    passage: Passage,
    attitude: MatrixRows,
    air: Vector,
    acceleration: Vector,
    rotors: RotorForce | None,
    *,
    drag: bool,
    front: bool,
) -> WindImpulse:
    """Return the impulse of the blast wind within a step.

    Args:
        body: Areas, volume and coefficients of the vehicle.
        mass_kg: Mass of the vehicle.
        passage: The part of the wave within the step.
        attitude: Body to world.
        air: Velocity of the air past the vehicle without the blast, world [m/s].
        acceleration: Acceleration of the vehicle without the blast, world [m/s2].
        rotors: Force of the rotors in the blast wind; None: neglected.
        drag: Include the drag on the body.
        front: Include the impulse of the front.
    """
    away = passage.away
    nothing = jnp.zeros_like(passage.start_s)
    before = front_impulse(body, passage, passage.start_s)

    def run(end_s: Number, gained: GainedImpulse) -> tuple[GainedImpulse, WindImpulse]:
        """Return the impulses until each node and in total, from a previous guess."""

        def at_node(
            place: NodePlace, gained: GainedImpulse
        ) -> tuple[WindImpulse, GainedImpulse]:
            given, leap = gained
            node = node_at(passage, end_s, place)
            past_s = (node.since - passage.start_s) / passage.rate
            moved = [
                (j + leap * n) / mass_kg + a * past_s
                for j, n, a in zip(given, away, acceleration, strict=True)
            ]
            gone = [a - dv for a, dv in zip(air, moved, strict=True)]
            along = sum(n * dv for n, dv in zip(away, moved, strict=True))
            square = node.wind * (node.wind - 2 * along)
            force: tuple[Number, ...] = (nothing, nothing, nothing)
            if drag:
                x, y, z = (node.wind * n + g for n, g in zip(away, gone, strict=True))
                blown = drag_force(body, attitude, node.density, (x, y, z))
                x, y, z = gone
                still = drag_force(body, attitude, passage.air_density, (x, y, z))
                force = tuple(a - b for a, b in zip(blown, still, strict=True))
            part = place.weight * node.width
            x, y, z = (part * f for f in force)
            share = WindImpulse((x, y, z), part * node.wind, part * square)
            if rotors is not None:
                force = tuple(
                    f + a * node.wind + b * square
                    for f, a, b in zip(force, *rotors, strict=True)
                )
            x, y, z = (node.width * f for f in force)
            leap = nothing
            if front:
                leap = front_impulse(body, passage, node.since) - before
            return share, ((x, y, z), leap)

        # All nodes at once: a loop over nodes would be a program of single numbers
        # each.
        shares, (force, leap) = jax.vmap(at_node)(rule, gained)
        total = jax.tree.map(lambda share: jnp.sum(share, axis=0), shares)
        if front:
            whole = front_impulse(body, passage, end_s) - before
            x, y, z = (j + whole * n for j, n in zip(total.body, away, strict=True))
            total = total._replace(body=(x, y, z))
        x, y, z = (until(f) for f in force)
        return ((x, y, z), leap), total

    rule = places(passage.start_s.dtype)
    none = jnp.zeros_like(rule.share)
    gained, first = run(passage.end_s, ((none, none, none), none))
    # The integrator applies the impulse as a constant force, so the vehicle is
    # displaced by half of impulse times step at its end, and meets a later part of the
    # wave.
    pushed = dot(away, first.body)
    if rotors is not None:
        pushed = pushed + dot(away, rotors.linear) * first.way
        pushed = pushed + dot(away, rotors.square) * first.square
    step = (passage.end_s - passage.start_s) / passage.rate
    later = pushed / mass_kg * step / 2 / passage.front_speed_m_s
    return run(jnp.maximum(passage.end_s - later, passage.start_s), gained)[1]


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
    square = (a * r_x) ** 2 + (b * r_y) ** 2 + (c * r_z) ** 2
    # Negated, so that an area of NaN gives NaN and not zero drag.
    blows = ~(square <= 0)
    size = jnp.where(blows, jnp.sqrt(jnp.where(blows, square, 1.0)), 0.0)
    half = 0.5 * density * body.drag_coefficient * size
    return half * x, half * y, half * z


def rotors_in_wind(
    vehicle: Vehicle, motion: StateComponents, air: Vector, passage: Passage
) -> tuple[RotorForce, RotorForce]:
    """Return force (world) and moment (body) of the rotors in a blast wind.

    Without the frame's drag both are polynomials of second degree in the wind speed,
    defined by their values at three wind speeds.
    """
    # Any wind speed gives the same polynomial; a tenth of the speed of sound is far
    # above the rounding of the differences.
    probe = passage.wave.sound_speed_m_s / 10
    bare = eqx.tree_at(
        lambda v: v.frame_drag, vehicle, jnp.zeros_like(vehicle.frame_drag)
    )

    def wrench(speed: Number) -> Wrench:
        x, y, z = (speed * n for n in passage.away)
        force, moment = air_wrench(bare, motion, add(air, (x, y, z)))
        return turned(motion.quaternion, force), moment

    none, ahead, back = wrench(0 * probe), wrench(probe), wrench(-probe)
    force, moment = (
        RotorForce(
            three((jnp.stack(a) - jnp.stack(b)) / (2 * probe)),
            three(
                (jnp.stack(a) + jnp.stack(b) - 2 * jnp.stack(n))
                / (2 * jnp.square(probe))
            ),
        )
        for n, a, b in zip(none, ahead, back, strict=True)
    )
    return force, moment


def polynomial(rotors: RotorForce, given: WindImpulse) -> Vector:
    """Return the impulse of a rotor force, or the angular impulse of a moment."""
    x, y, z = (
        a * given.way + b * given.square
        for a, b in zip(rotors.linear, rotors.square, strict=True)
    )
    return x, y, z


def jolt_velocity(
    blast: Blast, air: Surroundings, vehicle: Vehicle, state: State
) -> Float[Array, "3"]:
    r"""Return the change of a vehicle's velocity by a blast, world [m/s], shape (3,).

    Args:
        blast: A blast that happens.
        air: Ambient air.
        vehicle: The vehicle.
        state: State of the vehicle at the arrival, at rest.

    Raises:
        InputError: The vehicle has no `body`.
    """
    body, motion = required_body(vehicle.body), components(state)
    passage = _whole(blast, air, body, state)
    place = places(passage.end_s.dtype)
    node, wind = node_at(passage, passage.end_s, place), three(air.wind_m_s)
    # At rest the rotors' force depends on the wind only: a polynomial in its speed.
    rotors, _ = rotors_in_wind(vehicle, motion, wind, passage)
    attitude = rotation(motion.quaternion)

    def force(each: Node, pushed: Float[Array, "3"]) -> Float[Array, "3"]:
        moved = three(pushed)
        return jnp.stack(_force(body, passage, attitude, each, wind, moved, rotors))

    away, width = jnp.stack(passage.away), node.width[:, None]
    leap = front_impulse(body, passage, node.since)[:, None] * away[None, :]
    first = jax.vmap(force)(node, jnp.zeros_like(leap))
    # One step of Picard's iteration, as in `wind_impulse`.
    gained = jax.vmap(until, 1, 1)(width * first)
    forces = jax.vmap(force)(node, (gained + leap) / vehicle.mass_kg)
    whole = front_impulse(body, passage, passage.end_s)
    impulse = (place.weight * node.width) @ forces + whole * away
    return impulse / vehicle.mass_kg


def _whole(blast: Blast, air: Surroundings, body: Body, state: State) -> Passage:
    """Return the passage of a whole wave over a vehicle at rest."""
    wave = blast.wave(air, state.position_m)
    _, away, speed = blast.way(air, state.position_m)
    density = AIR_HEAT_CAPACITY_RATIO * air.pressure_pa
    return Passage(
        wave=wave,
        away=three(away),
        start_s=-crossing_time(body, wave),  # half of it precedes the arrival
        end_s=wave.duration_s + wave.suction_s,
        rate=jnp.ones_like(wave.peak),
        front_speed_m_s=speed,
        air_density=density / jnp.square(air.sound_speed_m_s),
    )


def _force(
    body: Body,
    passage: Passage,
    attitude: MatrixRows,
    node: Node,
    wind: Vector,
    pushed: Vector,
    rotors: RotorForce,
) -> Vector:
    """Return the additional force of drag and rotors due to the blast at a node.

    Args:
        body: Areas and drag coefficient.
        passage: The wave.
        attitude: Body to world.
        node: Wave at the node.
        wind: Ambient wind, world [m/s].
        pushed: Velocity of the vehicle at the node, world [m/s].
        rotors: Force of the rotors in a wind.
    """
    away = passage.away
    x, y, z = (w - dv for w, dv in zip(wind, pushed, strict=True))
    gone = x, y, z
    x, y, z = (node.wind * n + g for n, g in zip(away, gone, strict=True))
    blown = drag_force(body, attitude, node.density, (x, y, z))
    still = drag_force(body, attitude, passage.air_density, gone)
    square = node.wind * (node.wind - 2 * dot(away, pushed))
    x, y, z = (
        b - s + first * node.wind + second * square
        for b, s, first, second in zip(blown, still, *rotors, strict=True)
    )
    return x, y, z


def map_grouped(function: Callable[[T], R], values: Sequence[T]) -> list[R]:
    """Map a function over values, with one `vmap` for each PyTree structure.

    Args:
        function: Pure function of one value.
        values: PyTrees of arrays.
    """
    # Stacked values of one structure, as blasts of one curve set, share a program: that
    # of a hundred blasts is as long as that of two.
    kinds: dict[object, list[int]] = {}
    for n, value in enumerate(values):
        leaves, tree = jax.tree.flatten(value)
        of_arrays = tuple((jnp.shape(x), jnp.result_type(x)) for x in leaves)
        kinds.setdefault((tree, of_arrays), []).append(n)
    found: dict[int, R] = {}
    for members in kinds.values():
        if len(members) == 1:
            found[members[0]] = function(values[members[0]])
            continue
        stacked = jax.tree.map(lambda *x: jnp.stack(x), *(values[n] for n in members))
        given = jax.vmap(function)(stacked)
        for place, n in enumerate(members):
            found[n] = jax.tree.map(lambda x, place=place: x[place], given)
    return [found[n] for n in range(len(values))]
