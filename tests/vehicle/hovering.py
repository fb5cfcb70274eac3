"""Vehicles that hover beside a charge, for the tests of its load."""

import itertools
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from jblast.scene import Charge, Scene
from jblast.vehicle import BlastLoad, State, named
from jblast.vehicle.loads.blast_wave import Wave
from jblast.vehicle.quadrotor import required_body
from tests.vehicle.flights import at_hover

CRAZYFLIE = named("crazyflie")
BODY = required_body(CRAZYFLIE.body)


def of_parts(vehicle, *, drag=True, front=True, rotors=False, mass_kg=None):
    """A vehicle of which a blast acts on some parts, and turns nothing but by rotors.

    A load that leaves parts out does the same by another program.
    """

    def part(value, included):
        return value if included else jnp.zeros_like(value)

    body = replace(
        vehicle.body,
        pressure_centre_m=jnp.zeros(3),
        drag_coefficient=part(vehicle.body.drag_coefficient, drag),
        volume_m3=part(vehicle.body.volume_m3, front),
    )
    return replace(
        vehicle,
        mass_kg=vehicle.mass_kg if mass_kg is None else jnp.asarray(mass_kg),
        frame_drag=jnp.zeros(3),
        rotor_drag=part(vehicle.rotor_drag, rotors),
        translational_lift=part(vehicle.translational_lift, rotors),
        body=body,
    )


PLAIN = of_parts(CRAZYFLIE)
HEAVY = of_parts(CRAZYFLIE, mass_kg=1e6)
"""It stays where it is: 1000 t."""


def hovering(vehicle, position, velocity=(0.0, 0.0, 0.0)) -> State:
    return at_hover(vehicle, position, velocity_m_s=jnp.asarray(velocity, float))


def scene(mass=1.0, **charge) -> Scene:
    """A charge, and one that never happens: two waves, as a charge and its image."""
    never = Charge(time_s=jnp.inf, name="never")
    return Scene(charges=(Charge(mass_kg=mass, name="real", **charge), never))


def wave_at(load: BlastLoad, position_m, number=0) -> Wave:
    """Return one of the waves of a load at a position."""
    blast = jax.tree.map(lambda x: x[number], load.waves)
    return blast.wave(load.air, jnp.asarray(position_m, float))


def impulse(load: BlastLoad, start_s, end_s, state, vehicle):
    """What a load gives between two times: one program for all of as many waves."""
    load = replace(load, charges=load.waves.time_s.size)
    given = load, start_s, end_s, state, vehicle
    return _impulse(*jax.tree.map(lambda x: jnp.asarray(x, float), given))


@jax.jit
def _impulse(load, start_s, end_s, state, vehicle):
    return load.impulse(start_s, end_s, state, vehicle)


def held(state, vehicle, load: BlastLoad, edges) -> np.ndarray:
    """Sum of the impulses between times, the vehicle held where it is."""
    each = [
        impulse(load, a, b, state, vehicle)[0] for a, b in itertools.pairwise(edges)
    ]
    return np.sum(each, axis=0)
