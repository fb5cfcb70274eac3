"""Small linear systems are solved as NumPy does, with slopes that are derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jblast.sensors.path_scatter import cholesky_factor, solve_system


def systems(count, size, right=2):
    rng = np.random.default_rng(count * size)
    root = rng.normal(size=(count, size, size))
    matrix = root @ np.swapaxes(root, 1, 2) + size * np.eye(size)
    return matrix, rng.normal(size=(count, size, right))


@pytest.mark.parametrize("size", [1, 2, 7, 40])
def test_solutions_determinants_and_factors_are_those_of_numpy(size):
    matrix, right = systems(3, size)
    answer, log_determinant = jax.vmap(solve_system)(matrix, right)
    np.testing.assert_allclose(answer, np.linalg.solve(matrix, right), rtol=1e-10)
    expected = np.linalg.slogdet(matrix)[1]
    np.testing.assert_allclose(log_determinant, expected, rtol=1e-12)
    factor = jax.vmap(cholesky_factor)(matrix)
    np.testing.assert_allclose(factor, np.linalg.cholesky(matrix), atol=1e-12)


def test_a_matrix_that_is_not_positive_definite_has_no_determinant():
    matrix = jnp.array([[1.0, 2.0], [2.0, 1.0]])
    assert np.isnan(solve_system(matrix, jnp.ones((2, 1)))[1])
    assert np.isnan(cholesky_factor(matrix)).any()


def test_first_and_second_derivatives_are_those_of_differences():
    matrix, right = systems(1, 4)

    def both(matrix, right):
        # the differences are taken of NumPy arrays
        answer, log_determinant = solve_system(jnp.asarray(matrix), jnp.asarray(right))
        return jnp.sum(answer**2) + log_determinant

    check_grads(
        both, (jnp.array(matrix[0]), jnp.array(right[0])), order=2, rtol=1e-5, atol=1e-6
    )


def test_the_derivative_of_a_factor_is_that_of_differences():
    matrix = jnp.array(systems(1, 4)[0][0])

    def factor(a):
        return jnp.sum(jnp.sin(cholesky_factor(jnp.asarray(a + a.T))))

    check_grads(factor, (matrix,), order=1, modes=["fwd"], rtol=1e-5, atol=1e-6)


def test_batches_that_meet_in_one_program_come_to_an_end():
    """LAPACK deadlocks here on two cores: inverses of one program wait for others."""
    batches = [systems(40, 24)[0] for _ in range(6)]

    @jax.jit
    def all_solved(batches):
        unit = jnp.broadcast_to(jnp.eye(24), batches[0].shape)
        return [jax.vmap(solve_system)(each, unit)[0] for each in batches]

    for _ in range(50):
        jax.block_until_ready(all_solved(batches))
