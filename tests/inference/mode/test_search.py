"""Starts that have met go on as one; slopes of least squares are those of its cost."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference.mode.search import MERGE_STEPS, onward, residuals
from tests.catalogue import AROUND, BOTH
from tests.inference.shots import shot


def test_starts_that_have_met_are_searched_once_and_end_together():
    begun = jnp.array(
        [[4.0], [4.0 + 0.1 * MERGE_STEPS], [9.0], [4.0], [9.0 + 10 * MERGE_STEPS]]
    )
    freedoms = jnp.array([[1.0, 1.0, 1.0, 2.0, 1.0]])
    searched = []

    def approach(y, freedom):
        jax.debug.callback(lambda y: searched.append(float(y[0])), y)
        return 10 * y + freedom

    ends = np.asarray(onward(approach, begun, freedoms))[:, 0]
    jax.effects_barrier()
    assert sorted(searched) == [4.0, 4.0, 9.0, 9.0 + 10 * MERGE_STEPS]
    np.testing.assert_allclose(ends, [41, 41, 91, 42, 91 + 100 * MERGE_STEPS])


def test_every_search_goes_on_from_where_the_one_before_it_ended():
    begun = jnp.array([[4.0], [9.0]])
    freedoms = jnp.array([[1.0, 2.0], [3.0, 4.0]])
    ends = onward(lambda y, freedom: 10 * y + freedom, begun, freedoms)
    np.testing.assert_allclose(np.asarray(ends)[:, 0], [413, 924])


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
