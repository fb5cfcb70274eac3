"""Scatter of neighbouring paths is correlated, and its small systems are solved."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jblast import Charge, Scene
from jblast.sensors import Layout
from jblast.sensors.forward_model import record
from jblast.sensors.path_scatter import (
    KERNELS,
    cholesky_columns,
    correlations,
    embedded,
    solve_system,
    split,
)
from jblast.sensors.simulated_readings import error_model, observe

LAWS = {"air_arrival_s": "kingery_bulmash"}
SCENE = Scene(Charge(mass_kg=10.0))


def ring(radius, count=8, middle=(0.0, 0.0)):
    angle = 2 * np.pi * np.arange(count) / count
    east, north = middle[0] + radius * np.cos(angle), middle[1] + radius * np.sin(angle)
    return np.stack([east, north, 0 * angle], axis=1)


def placed(position):
    """Log-polar coordinates of paths from a charge at the origin."""
    toward = -jnp.asarray(position)
    return embedded(toward, jnp.linalg.norm(toward, axis=1))


def layout_of_ring():
    nothing, rows = jnp.full(8, jnp.nan), tuple(range(8))
    position = jnp.asarray(ring(1.0, 8, (40.0, 0.0)))
    names = ("air_arrival_s",) * 8
    return Layout(names, position, nothing, nothing, rows, (0,) * 8, ("",) * 8)


@pytest.mark.parametrize("kernel", range(len(KERNELS)))
def test_individual_and_shared_parts_sum_to_the_correlation(kernel):
    weights = jnp.eye(len(KERNELS))[kernel]
    place, known = placed(np.concatenate([ring(1.0, 6, (40.0, 0.0)), ring(50.0, 5)]))
    own, shared = split(place, known, weights)
    expected = np.array(correlations(place, place, weights))
    np.fill_diagonal(expected, 1.0)
    got = np.diag(own) + np.asarray(shared) @ np.asarray(shared).T
    np.testing.assert_allclose(got, expected, atol=1e-7)  # the nugget
    assert (np.asarray(own) > 0).all()
    # paths around a charge remain nearly independent
    own, _ = split(*placed(ring(20.0)), weights)
    np.testing.assert_allclose(own, 1.0, atol=0.12)


def test_the_scatter_of_travel_times_keeps_its_size():
    layout = layout_of_ring()
    found = record(SCENE, layout, LAWS)
    of_laws = error_model(found, layout)
    shot = np.asarray(found.shot_loading["air_arrival_s"])
    shared = np.sum(np.square(of_laws.loading), axis=1) - shot**2
    total = np.square(of_laws.record_sd) + shared
    np.testing.assert_allclose(np.sqrt(total), found.record_sd, rtol=1e-6)


def test_simulated_neighbours_scatter_together():
    layout = layout_of_ring()
    sigma = jnp.full(8, 1e-6)

    @jax.jit
    @jax.vmap
    def drawn(key):
        return observe(key, SCENE, layout, LAWS, sigma, noise="gaussian")

    exact = np.asarray(record(SCENE, layout, LAWS).value)
    left = np.asarray(drawn(jax.random.split(jax.random.key(0), 400))) - exact
    # 1 % of a shot and of a path; 400 draws: 4 % of an sd
    expected = 0.01 * np.sqrt(2) * exact[0]
    assert np.std(left[:, 0]) == pytest.approx(expected, rel=0.15)
    assert np.std(left[:, 0] - left[:, 4]) < 0.5 * expected


def systems(count, size, right=2):
    rng = np.random.default_rng(count * size)
    root = rng.normal(size=(count, size, size))
    matrix = root @ np.swapaxes(root, 1, 2) + size * np.eye(size)
    return matrix, rng.normal(size=(count, size, right))


@pytest.mark.parametrize("size", [1, 2, 40])
def test_solutions_determinants_and_factors_are_those_of_numpy(size):
    matrix, right = systems(3, size)
    answer, log_determinant = jax.vmap(solve_system)(matrix, right)
    np.testing.assert_allclose(answer, np.linalg.solve(matrix, right), rtol=1e-10)
    expected = np.linalg.slogdet(matrix)[1]
    np.testing.assert_allclose(log_determinant, expected, rtol=1e-12)
    columns = jax.vmap(cholesky_columns)(jnp.concatenate([matrix, matrix], axis=1))
    factor = np.linalg.cholesky(matrix)
    # a row of A itself, below it: A L^-T is L
    expected = np.concatenate([factor, factor], axis=1)
    np.testing.assert_allclose(columns, expected, atol=1e-11)


def test_derivatives_are_those_of_differences():
    matrix, right = systems(1, 4)

    def both(matrix, right):
        # the differences are taken of NumPy arrays
        matrix, right = jnp.asarray(matrix), jnp.asarray(right)
        answer, log_determinant = solve_system(matrix, right)
        factor = jnp.sum(jnp.sin(cholesky_columns(matrix + matrix.T)))
        return jnp.sum(answer**2) + log_determinant + factor

    given = jnp.array(matrix[0]), jnp.array(right[0])
    check_grads(both, given, order=2, modes=["fwd"], rtol=1e-5, atol=1e-6)


@pytest.mark.slow
def test_batches_that_meet_in_one_program_end():
    """LAPACK deadlocks here on two cores: inverses of one program wait for others."""
    batches = [systems(40, 24)[0] for _ in range(6)]

    @jax.jit
    def all_solved(batches):
        unit = jnp.broadcast_to(jnp.eye(24), batches[0].shape)
        return [jax.vmap(solve_system)(each, unit)[0] for each in batches]

    for _ in range(50):
        jax.block_until_ready(all_solved(batches))
