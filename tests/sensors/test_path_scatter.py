"""Scatter of neighbouring paths is correlated, and its small systems are solved."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jblast import Charge, Scene
from jblast.sensors import Layout
from jblast.sensors.path_scatter import (
    DENSE,
    KERNELS,
    TYPICAL,
    cholesky_factor,
    correlations,
    decorrelation,
    embedded,
    solve_system,
    split,
)
from jblast.sensors.record import record
from jblast.sensors.simulated_readings import error_model, observe

LAWS = {"air_arrival_s": "kingery_bulmash"}


def ring(radius, count=8, middle=(0.0, 0.0)):
    angle = 2 * np.pi * np.arange(count) / count
    east, north = middle[0] + radius * np.cos(angle), middle[1] + radius * np.sin(angle)
    return np.stack([east, north, 0 * angle], axis=1)


def placed(position):
    """Log-polar coordinates of paths from a charge at the origin."""
    toward = -jnp.asarray(position)
    return embedded(toward, jnp.linalg.norm(toward, axis=1))


def layout_at(position):
    n = len(position)
    nothing = jnp.full(n, jnp.nan)
    return Layout(
        ("air_arrival_s",) * n,
        jnp.asarray(position),
        nothing,
        nothing,
        tuple(range(n)),
        (0,) * n,
        ("",) * n,
    )


def test_what_separates_neighbours_is_what_their_correlation_lacks():
    apart = np.array([1e-3, 0.02, 0.3, 1.0])
    place = jnp.zeros((1, 4)), jnp.zeros((4, 4)).at[:, 0].set(apart)
    for weights in np.eye(len(KERNELS)):
        rho = np.asarray(correlations(*place, jnp.asarray(weights)))[0]
        np.testing.assert_allclose(decorrelation(apart, weights), 1 - rho, rtol=1e-6)


@pytest.mark.parametrize("kernel", range(len(KERNELS)))
def test_what_paths_share_and_have_for_themselves_adds_up_to_the_correlation(kernel):
    position = np.concatenate([ring(1.0, 6, (40.0, 0.0)), ring(50.0, 5)])
    place, known = placed(position)
    weights = jnp.eye(len(KERNELS))[kernel]
    own, shared = split(place, known, weights)
    expected = np.array(correlations(place, place, weights))
    np.fill_diagonal(expected, 1.0)
    got = np.diag(own) + np.asarray(shared) @ np.asarray(shared).T
    np.testing.assert_allclose(got, expected, atol=1e-7)  # the nugget
    assert (np.asarray(own) > 0).all()


def test_paths_around_a_charge_stay_independent():
    place, known = placed(ring(20.0))
    for weights in jnp.eye(len(KERNELS)):
        own, _ = split(place, known, weights)
        np.testing.assert_allclose(own, 1.0, atol=0.12)


def test_a_long_log_is_split_by_some_of_its_paths():
    # two tight arrays, and paths by themselves
    arrays = [ring(0.1, 16, (100.0, 0.0)), ring(0.1, 16, (0.0, 100.0))]
    place, known = placed(np.concatenate([*arrays, ring(30.0, 3)]))
    assert len(place) > DENSE
    own, shared = map(np.asarray, split(place, known, jnp.asarray(TYPICAL)))
    got = np.diag(own) + shared @ shared.T
    np.testing.assert_allclose(np.diag(got), 1.0, atol=1e-6)
    assert got[0, 1] > 0.98
    assert got[16, 20] > 0.98
    assert abs(got[0, 16]) < 0.02
    np.testing.assert_allclose(own[32:], 1.0, atol=0.5)


def test_the_scatter_of_travel_times_keeps_its_size():
    layout = layout_at(ring(1.0, 8, (40.0, 0.0)))
    found = record(Scene(Charge(mass_kg=10.0)), layout, LAWS)
    of_laws = error_model(found, layout)
    shot = np.asarray(found.shot_loading["air_arrival_s"])
    shared = np.sum(np.square(of_laws.loading), axis=1) - shot**2
    total = np.square(of_laws.record_sd) + shared
    np.testing.assert_allclose(np.sqrt(total), found.record_sd, rtol=1e-6)
    # neighbours differ by far less than two independent paths would
    difference = np.asarray(of_laws.loading[0] - of_laws.loading[1])
    apart = np.sqrt(difference @ difference + np.sum(np.square(of_laws.record_sd[:2])))
    assert apart < 0.25 * np.sqrt(2) * float(found.record_sd[0])


def test_simulated_neighbours_scatter_together():
    layout = layout_at(ring(1.0, 8, (40.0, 0.0)))
    scene = Scene(Charge(mass_kg=10.0))
    keys = jax.random.split(jax.random.key(0), 400)
    drawn = jax.jit(
        jax.vmap(
            lambda key: observe(
                key, scene, layout, LAWS, jnp.full(8, 1e-6), noise="gaussian"
            )
        )
    )(keys)
    exact = record(scene, layout, LAWS)
    left = np.asarray(drawn) - np.asarray(exact.value)
    travel = float(exact.value[0])
    # a shot's and a path's 1 %; 400 draws: 4 % of an sd
    assert np.std(left[:, 0]) == pytest.approx(0.01 * np.sqrt(2) * travel, rel=0.15)
    assert np.std(left[:, 0] - left[:, 4]) < 0.5 * 0.01 * np.sqrt(2) * travel


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


@pytest.mark.slow
def test_batches_that_meet_in_one_program_come_to_an_end():
    """LAPACK deadlocks here on two cores: inverses of one program wait for others."""
    batches = [systems(40, 24)[0] for _ in range(6)]

    @jax.jit
    def all_solved(batches):
        unit = jnp.broadcast_to(jnp.eye(24), batches[0].shape)
        return [jax.vmap(solve_system)(each, unit)[0] for each in batches]

    for _ in range(50):
        jax.block_until_ready(all_solved(batches))
