import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from scipy.optimize import least_squares

from jblast.inference.many.solver import expansion, levenberg_marquardt

TIMES = jnp.linspace(0.0, 3.0, 9)


def decay(y, data):
    """An exponential decay to a level, three unknowns."""
    return (y[0] * jnp.exp(-jnp.exp(y[1]) * TIMES) + y[2] - data) / 0.01


def data(seed):
    noise = np.random.default_rng(seed).standard_normal(9)
    return decay(jnp.array([2.0, 0.3, 0.5]), 0.0) * 0.01 + 0.01 * jnp.asarray(noise)


START = jnp.array([1.0, -0.5, 0.0])


def half_square(residual):
    return 0.5 * residual**2, residual, None, None


def search(residuals, start, loss=half_square, steps=60):
    """Minimise the cost of residuals of one problem, or of lanes."""

    def expand(y):
        residual, push = jax.linearize(residuals, y)
        units = [jnp.zeros_like(y).at[k].set(1.0) for k in range(len(y))]
        return expansion(loss, y, residual, [push(unit) for unit in units])

    return levenberg_marquardt(expand, start, max_steps=steps)


def solve(readings, start=START):
    return search(lambda y: decay(y, readings), start)


def solve_lanes(readings):
    lanes = jax.vmap(decay, in_axes=(1, 1), out_axes=1)
    starts = jnp.repeat(START[:, None], len(readings), axis=1)
    return search(lambda y: lanes(y, readings.T), starts)


def test_one_problem_ends_where_optimistix_and_scipy_end():
    ours = solve(data(0))
    solver = optx.LevenbergMarquardt(rtol=1e-12, atol=1e-12)
    theirs = optx.least_squares(decay, solver, START, data(0), max_steps=500)
    scipys = least_squares(
        lambda y: np.asarray(decay(jnp.asarray(y), data(0))),
        START,
        method="lm",
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    # the optimum is known to the square root of rounding in the cost at worst
    np.testing.assert_allclose(ours.y, theirs.value, rtol=1e-8)
    np.testing.assert_allclose(ours.y, scipys.x, rtol=1e-8)
    assert ours.here.f == pytest.approx(scipys.cost, rel=1e-13)
    assert ours.done
    assert ours.here.at_optimum()


def test_lanes_under_vmap_and_a_loop_are_the_same():
    readings = jnp.stack([data(seed) for seed in range(4)])
    loop = jnp.stack([solve(r).y for r in readings])
    batch = jax.vmap(lambda r: solve(r).y)(readings)
    together = solve_lanes(readings)
    np.testing.assert_allclose(batch, loop, rtol=1e-10)
    np.testing.assert_allclose(together.y.T, loop, rtol=1e-10)
    assert together.done.all()


def test_a_start_at_the_rounding_floor_is_left_at_once():
    # there no step can make the cost fall, and a classical trust region rejects on
    end = solve(data(1)).y
    again = solve(data(1), end)
    assert again.steps == 1
    np.testing.assert_allclose(again.y, end, rtol=1e-12)


def test_a_lane_that_is_not_finite_stays_and_disturbs_no_other():
    readings = jnp.stack([data(0), jnp.full(9, jnp.nan), data(2)])
    found = solve_lanes(readings)
    np.testing.assert_array_equal(found.here.at_optimum(), [True, False, True])
    np.testing.assert_allclose(found.y[:, 2], solve(data(2)).y, rtol=1e-10)
    np.testing.assert_array_equal(found.y[:, 1], START)


def test_unknowns_that_no_residual_tells_apart_are_no_optimum():
    def ridge(y):
        return jnp.stack([y[0] + y[1] - 1.0, 2 * (y[0] + y[1]) - 2.5])

    found = search(ridge, jnp.zeros(2), steps=30)
    assert not found.here.at_optimum()
    assert np.isfinite(found.y).all()


def test_a_curvature_that_gauss_newton_does_not_see_is_no_trouble():
    # Gauss-Newton sees a curvature of 1 at y0 = 0, where it is 5
    def residuals(y):
        return jnp.stack([y[0] ** 2 + 2.0, y[0], y[1] - 3.0])

    found = search(residuals, jnp.array([[0.8, -1e-6], [0.0, 2.0]]))
    assert found.here.at_optimum().all()
    np.testing.assert_allclose(found.y, [[0.0, 0.0], [3.0, 3.0]], atol=1e-7)


def test_where_the_curvature_is_negative_reweighted_residuals_step():
    # minus ln of a Cauchy density, from where it curves downwards
    def cauchy(u):
        bend = 1 + u**2
        return jnp.log(bend) / 2, u / bend, (1 - u**2) / bend**2, 1 / bend

    found = search(lambda y: y - 1.0, jnp.array([[4.0]]), cauchy)
    assert found.here.at_optimum().all()
    np.testing.assert_allclose(found.y, 1.0, rtol=1e-9)
