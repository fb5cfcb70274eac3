r"""Impulse of the blast wind on a body, within one step of a flight.

Drag, quasi-steady, on the body's own areas:

$$F = \tfrac12 \rho C_d \sqrt{\sum_i (A_i r_i)^2}\;r, \qquad r = w - v$$

with $r$ the wind past the vehicle along body axes: as an ellipsoid's projected area
turns, so does this one.

To it comes the impulse of the front (`passage.py`), and of the rotors in the wind.

A step may hold the whole wave. So the drag is integrated by Gauss's rule over the part
of each phase within the step, and the vehicle's velocity in it follows the impulse so
far (one step of Picard's iteration); how much of the wave passes within the step takes
in the way it is pushed. At a velocity held over the step 10 ms would miss up to 1.4 %.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jblast.vehicle.dynamics.components import (
    MatrixRows,
    Number,
    StateComponents,
    Vector,
    add,
    dot,
    three,
    times_transposed,
    turned,
)
from jblast.vehicle.dynamics.equations import Wrench, air_wrench
from jblast.vehicle.loads.blast.passage import Passage, front_impulse
from jblast.vehicle.loads.blast.quadrature import NodePlace, node_at, places, until
from jblast.vehicle.quadrotor.parameters import Body, Vehicle


class RotorForce(NamedTuple):
    """Force of the rotors in a wind along one direction, beyond that in none.

    Attributes:
        linear: Times the wind's speed: world [N s/m].
        square: Times its square: world [N s2/m2].
    """

    linear: Vector
    square: Vector


class WindImpulse(NamedTuple):
    """What the wind gives within a step.

    Attributes:
        body: Impulse of drag and front, world [N s].
        way: By which `RotorForce.linear` is multiplied [m].
        square: By which `RotorForce.square` is multiplied [m2/s].
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
    """Return what the wind gives within a step.

    Args:
        body: What it acts on.
        mass_kg: Of the vehicle.
        passage: The part of the wave.
        attitude: Body to world.
        air: What blows past the vehicle without the blast, world [m/s].
        acceleration: Of the vehicle without the blast, world [m/s2].
        rotors: What moves the vehicle besides; None: nothing.
        drag: Whether there is drag.
        front: Whether there is a force of the front.
    """
    away = passage.away
    nothing = jnp.zeros_like(passage.start_s)
    before = front_impulse(body, passage, passage.start_s)

    def run(end_s: Number, gained: Gained) -> tuple[Gained, WindImpulse]:
        """Impulse until each node, and of all, for one guess of both."""

        def at_node(place: NodePlace, gained: Gained) -> tuple[WindImpulse, Gained]:
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

        # all nodes at once: one after another they are programs of a few numbers each
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
    # The integrator spreads the impulse over the step: half of it is way by its end.
    pushed = dot(away, first.body)
    if rotors is not None:
        pushed = pushed + dot(away, rotors.linear) * first.way
        pushed = pushed + dot(away, rotors.square) * first.square
    step = (passage.end_s - passage.start_s) / passage.rate
    later = pushed / mass_kg * step / 2 / passage.front_speed_m_s
    return run(jnp.maximum(passage.end_s - later, passage.start_s), gained)[1]


Gained = tuple[tuple[Array, Array, Array], Array]
"""Impulse of drag and rotors, world, and that of the front, away, at the nodes."""


def drag_force(
    body: Body, attitude: MatrixRows, density: Number, past: Vector
) -> Vector:
    """Return the drag, world [N]; its gradient at rest is zero, not NaN.

    Args:
        body: What the wind acts on.
        attitude: Body to world.
        density: Of the air [kg/m3].
        past: Velocity of the air past the vehicle, world [m/s].
    """
    x, y, z = past
    r_x, r_y, r_z = times_transposed(attitude, past)
    a, b, c = three(body.area_m2)
    square = (a * r_x) ** 2 + (b * r_y) ** 2 + (c * r_z) ** 2
    blows = ~(square <= 0)  # an area that is no number does not stand still
    size = jnp.where(blows, jnp.sqrt(jnp.where(blows, square, 1.0)), 0.0)
    half = 0.5 * density * body.drag_coefficient * size
    return half * x, half * y, half * z


def rotors_in_wind(
    vehicle: Vehicle, motion: StateComponents, air: Vector, passage: Passage
) -> tuple[RotorForce, RotorForce]:
    """Return what the rotors feel of a wind: force, world, and moment, body.

    Without the frame's drag both are polynomials of second degree in the speed of the
    wind: three of its values tell it.
    """
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
    """Return the impulse of such a force, or moment."""
    x, y, z = (
        a * given.way + b * given.square
        for a, b in zip(rotors.linear, rotors.square, strict=True)
    )
    return x, y, z
