"""Posteriors of shots made up for the tests of samplers."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize

from jblast.inference import Posterior
from jblast.inference.identifiability import identifiability
from jblast.inference.mode.laplace import laplace
from jblast.inference.mode.search import Optima
from jblast.inference.posterior.fisher_information import information
from jblast.inference.posterior.parameters import parameters_of
from jblast.scene import Scene, Sensor, UncertainScene, freed, with_values
from jblast.sensors import observe, planned_layout
from jblast.sensors.record import to_error_scale
from jblast.sensors.simulated_readings import Noise
from tests.catalogue import AROUND, BOTH, TRUTH


def shot(places, records, free=tuple(TRUTH), truth=None, noise: Noise = "student"):
    """Record a charge at some places, with errors, and say what is free."""
    sensors = tuple(
        Sensor(f"m{i}", jnp.array([*place, 1.5]), records=records)
        for i, place in enumerate(places)
    )
    empty = dataclasses.replace(Scene(), scatter=False, sensors=sensors)
    scene = with_values(empty, TRUTH | (truth or {}))
    layout, sigma, _ = planned_layout(scene)
    laws = {quantity: "shock_kinematics" for quantity, _ in records}
    read = observe(jax.random.key(11), scene, layout, laws, sigma, noise=noise)
    return Posterior(
        parameters_of(freed(UncertainScene(scene), list(free))),
        layout,
        to_error_scale(read, layout.quantity),
        sigma,
        tuple(laws.items()),
        noise,
    )


@functools.cache
def five_solved(noise: Noise = "student"):
    """Solve five microphones about a charge, four unknowns."""
    return solved(shot(AROUND, BOTH, noise=noise))


def place_of(posterior, **values):
    """Return the coordinates of some numbers, those of `TRUTH` where not given."""
    parameters = posterior.parameters
    return np.array(
        [
            float(belief.unconstrain(jnp.asarray((TRUTH | values)[name])))
            for name, belief in zip(parameters.names, parameters.beliefs, strict=True)
        ]
    )


def climbed(posterior, z):
    """Climb from a place to the optimum near it, in steps of that place's sds."""
    slope = jax.jit(jax.value_and_grad(lambda z: -posterior.log_density(z)))
    for _ in range(3):
        size = 1 / np.sqrt(np.diag(information(posterior, jnp.asarray(z))))

        def down(u, z=z, size=size):
            value, gradient = slope(jnp.asarray(z + u * size))
            return float(value), np.asarray(gradient) * size

        z = z + minimize(down, np.zeros_like(z), jac=True).x * size
    return z


def solved(posterior, *starts):
    """Return a posterior, its normal, what it tells, and its optima."""
    ends = np.array([climbed(posterior, z) for z in starts or [place_of(posterior)]])
    density = np.array([float(posterior.log_density(jnp.asarray(z))) for z in ends])
    ends, density = ends[np.argsort(-density)], np.sort(density)[::-1]
    identified = identifiability(posterior, ends[0])
    found = Optima(jnp.asarray(ends), jnp.asarray(density))
    return (
        posterior,
        laplace(posterior, ends[0], identified.identified_basis),
        identified,
        found,
    )
