"""Draws of many keys are those of `jax.random`; points of a design those of SciPy."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import norm, qmc

from jblast.study.draws import folded, normals, points_of

INDEX = jnp.array([0, 1, 2, 12345, 2**31, 2**32 - 1], jnp.uint32)


@pytest.fixture
def keys():
    return jax.vmap(jax.random.fold_in, (None, 0))(jax.random.key(7), INDEX)


def test_a_number_folded_in_makes_the_key_of_jax(keys):
    ours = jax.random.key_data(folded(jax.random.key(7), INDEX))
    np.testing.assert_array_equal(ours, jax.random.key_data(keys))
    ours = jax.random.key_data(folded(keys, 3))
    theirs = jax.vmap(lambda key: jax.random.fold_in(key, 3))(keys)
    np.testing.assert_array_equal(ours, jax.random.key_data(theirs))


@pytest.mark.parametrize("count", [1, 2, 5])
def test_numbers_are_those_of_jax(keys, count):
    theirs = jax.jit(jax.vmap(lambda key: jax.random.normal(key, (count,))))(keys)
    np.testing.assert_array_equal(
        jax.jit(normals, static_argnums=1)(keys, count), theirs
    )


DRAWS, DIMENSIONS = 64, 3
POINTS: Any = points_of("sobol", DIMENSIONS, 5)


def test_parts_are_those_of_the_whole():
    whole = POINTS(0, DRAWS)
    assert whole.shape == (DRAWS, DIMENSIONS)
    parts = [POINTS(begin, 16) for begin in range(0, DRAWS, 16)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)


def test_sobol_points_are_scipys():
    engine = qmc.Sobol(DIMENSIONS, scramble=True, bits=32, rng=5)
    np.testing.assert_allclose(norm.cdf(POINTS(0, DRAWS)), engine.random(DRAWS))
