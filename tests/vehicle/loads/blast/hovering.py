"""Vehicles that hover beside a charge, for the tests of its load."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jblast.scene import Charge, Scene
from jblast.vehicle import BlastLoad, State, named
from jblast.vehicle.loads.blast_wave import Wave

CRAZYFLIE = named("crazyflie")


def plain(vehicle):
    """A vehicle that no wind turns and whose rotors feel none: its body alone."""
    return eqx.tree_at(
        lambda v: (
            v.body.pressure_centre_m,
            v.frame_drag,
            v.rotor_drag,
            v.translational_lift,
        ),
        vehicle,
        (jnp.zeros(3), jnp.zeros(3), jnp.zeros(3), jnp.zeros(())),
    )


HEAVY = eqx.tree_at(lambda v: v.mass_kg, plain(CRAZYFLIE), jnp.asarray(1e6))
"""It stays where it is: 1000 t."""


def hovering(vehicle, position, velocity=(0.0, 0.0, 0.0)) -> State:
    speed = jnp.sqrt(vehicle.mass_kg * 9.81 / 4 / vehicle.thrust_coefficient)
    return State(
        jnp.asarray(position, float),
        jnp.asarray(velocity, float),
        jnp.array([0.0, 0.0, 0.0, 1.0]),
        jnp.zeros(3),
        jnp.full(4, speed),
    )


def scene(mass=1.0, **charge) -> Scene:
    return Scene(Charge(mass_kg=mass, **charge))


def wave_at(load: BlastLoad, position_m, number=0) -> Wave:
    """Return one of the waves of a load at a position."""
    blast = jax.tree.map(lambda x: x[number], load.waves)
    return blast.wave(load.air, jnp.asarray(position_m, float))


@jax.jit
def impulse(load: BlastLoad, start_s, end_s, state, vehicle):
    """What a load gives between two times, compiled as a whole."""
    return load.impulse(jnp.asarray(start_s), jnp.asarray(end_s), state, vehicle)


def held(state, vehicle, load: BlastLoad, edges) -> np.ndarray:
    """Sum of the impulses between times, the vehicle held where it is."""
    each = [
        impulse(load, a, b, state, vehicle)[0] for a, b in itertools.pairwise(edges)
    ]
    return np.sum(each, axis=0)
