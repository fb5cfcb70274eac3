"""Starts that have met go on as one; slopes of least squares are those of its cost."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference.mode.search import residuals
from tests.catalogue import AROUND, BOTH
from tests.inference.shots import shot


@pytest.mark.slow  # slopes of every law of the shot are compiled
def test_slopes_of_least_squares_are_those_of_finite_differences():
    posterior = shot(AROUND, BOTH[:1])
    parameters = posterior.parameters
    scene = dataclasses.replace(parameters.scene, scatter=True)
    belief = dataclasses.replace(parameters, scene=scene)
    posterior = dataclasses.replace(posterior, parameters=belief)
    free = len(parameters.names)
    z = np.array([2.5, 8.0, -4.0, 0.01])[:free]
    count = free + posterior.misfit(jnp.asarray(z)).loading.shape[1]
    assert count > free
    y = np.random.default_rng(3).normal(0.0, 0.3, count)
    y[:free] = z
    scale = jnp.ones(free)

    def all_of(y):
        return jnp.concatenate(residuals(posterior, scale, y, 4.0))

    slopes = jax.jit(jax.jacfwd(all_of))(jnp.asarray(y))
    found = jax.jit(jax.vmap(all_of))
    steps = 1e-6 * np.eye(count)
    rise = np.asarray(found(jnp.asarray(y + steps)) - found(jnp.asarray(y - steps)))
    np.testing.assert_allclose(np.asarray(slopes).T, rise / 2e-6, rtol=1e-5, atol=1e-4)
