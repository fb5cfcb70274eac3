r"""The jolt: what the whole wave of a blast changes of a vehicle's velocity.

$$\Delta v = \frac1m \int F_{blast}\,dt$$

over front and suction, of the load that `rollout` flies through (`load.py`), as if the
wave came within one step to a vehicle that hovers: the same forces, by the same rule.
How the vehicle is pushed meanwhile is heeded as there. What turning, rotors and hold
make of it is left out; `calibration.jolts` tells how much that is.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import AIR_HEAT_CAPACITY_RATIO
from jblast.vehicle.dynamics.components import (
    MatrixRows,
    Vector,
    components,
    dot,
    rotation,
    three,
)
from jblast.vehicle.dynamics.state import State
from jblast.vehicle.loads.blast.drag import RotorForce, drag_force, rotors_in_wind
from jblast.vehicle.loads.blast.passage import (
    Blast,
    Passage,
    Surroundings,
    crossing_time,
    front_impulse,
)
from jblast.vehicle.loads.blast.quadrature import Node, node_at, places, until
from jblast.vehicle.quadrotor.body import Body, required_body
from jblast.vehicle.quadrotor.parameters import Vehicle


def jolt_velocity(
    blast: Blast, air: Surroundings, vehicle: Vehicle, state: State
) -> Float[Array, "3"]:
    r"""Return what a blast changes of a vehicle's velocity, world [m/s].

    Args:
        blast: It happens.
        air: What its wave goes through.
        vehicle: What it pushes.
        state: The vehicle as the wave finds it, at rest.

    Raises:
        InputError: Nothing is known of what a blast acts on.
    """
    body, motion = required_body(vehicle.body), components(state)
    passage = _whole(blast, air, body, state)
    place = places(passage.end_s.dtype)
    node, wind = node_at(passage, passage.end_s, place), three(air.wind_m_s)
    # at rest all that turns a rotor's force is the wind: a polynomial in its speed
    rotors, _ = rotors_in_wind(vehicle, motion, wind, passage)
    attitude = rotation(motion.quaternion)

    def force(each: Node, pushed: Float[Array, "3"]) -> Float[Array, "3"]:
        moved = three(pushed)
        return jnp.stack(_force(body, passage, attitude, each, wind, moved, rotors))

    away, width = jnp.stack(passage.away), node.width[:, None]
    leap = front_impulse(body, passage, node.since)[:, None] * away[None, :]
    first = jax.vmap(force)(node, jnp.zeros_like(leap))
    # one step of Picard's iteration, as in `wind_impulse`
    gained = jax.vmap(until, 1, 1)(width * first)
    forces = jax.vmap(force)(node, (gained + leap) / vehicle.mass_kg)
    whole = front_impulse(body, passage, passage.end_s)
    impulse = (place.weight * node.width) @ forces + whole * away
    return impulse / vehicle.mass_kg


def _whole(blast: Blast, air: Surroundings, body: Body, state: State) -> Passage:
    """Return a whole wave as it passes a vehicle at rest."""
    wave = blast.wave(air, state.position_m)
    _, away, speed = blast.way(air, state.position_m)
    density = AIR_HEAT_CAPACITY_RATIO * air.pressure_pa
    return Passage(
        wave=wave,
        away=three(away),
        start_s=-crossing_time(body, wave),  # of which half comes before
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
    """Return the force of drag and rotors at a node, beyond that without a blast.

    Args:
        body: What the wind acts on.
        passage: The wave.
        attitude: Body to world.
        node: Where in the wave.
        wind: Of the air, world [m/s].
        pushed: Velocity by then, world [m/s].
        rotors: Their force in a wind.
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
