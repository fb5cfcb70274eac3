"""Vehicles that hover beside a charge, for the tests of its load."""

import functools
import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jblast.scene import Charge, Scene
from jblast.vehicle import BlastLoad, State, blast_load, named, simulate

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


@jax.jit
def impulse(load: BlastLoad, start_s, end_s, state, vehicle):
    """What a load gives between two times, compiled as a whole."""
    return load.impulse(start_s, end_s, state, vehicle)


def held(state, vehicle, load: BlastLoad, steps) -> np.ndarray:
    """Sum of the impulses between times, the vehicle held where it is."""
    return np.array(
        [impulse(load, a, b, state, vehicle)[0] for a, b in itertools.pairwise(steps)]
    )


@functools.cache
def gained(mass: float, distance: float, step_s: float) -> np.ndarray:
    """Return the velocity after a flight of 0.12 s through a blast."""
    vehicle = plain(CRAZYFLIE)
    flight = simulate(
        vehicle,
        hovering(vehicle, (distance, 0.0, 2.0)),
        duration_s=0.12,
        step_s=step_s,
        loads=(blast_load(scene(mass)),),
        store_every=10000,
    )
    return np.asarray(flight.velocity_m_s[-1])
