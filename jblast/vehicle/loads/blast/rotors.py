"""The rotors in the wind of a blast."""

import equinox as eqx
import jax.numpy as jnp

from jblast.vehicle.dynamics.components import (
    Motion,
    Number,
    Vector,
    add,
    three,
    turned,
)
from jblast.vehicle.dynamics.equations import Wrench, air_wrench
from jblast.vehicle.loads.blast.drag import RotorForce, WindImpulse
from jblast.vehicle.loads.blast.passage import Passage
from jblast.vehicle.quadrotor.parameters import Vehicle


def rotors_in_wind(
    vehicle: Vehicle, motion: Motion, air: Vector, passage: Passage
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
