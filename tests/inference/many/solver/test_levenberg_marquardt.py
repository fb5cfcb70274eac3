import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from scipy.optimize import least_squares

from jblast.inference.many.solver import LaneLevenbergMarquardt

TIMES = jnp.linspace(0.0, 3.0, 9)


def decay(y, data):
    """An exponential decay to a level, three unknowns."""
    return (y[0] * jnp.exp(-jnp.exp(y[1]) * TIMES) + y[2] - data) / 0.01


def data(seed):
    noise = np.random.default_rng(seed).standard_normal(9)
    return decay(jnp.array([2.0, 0.3, 0.5]), 0.0) * 0.01 + 0.01 * jnp.asarray(noise)


START = jnp.array([1.0, -0.5, 0.0])


def solve(readings, start=START, **options):
    return optx.least_squares(
        decay,
        LaneLevenbergMarquardt(),
        start,
        readings,
        options=options,
        max_steps=60,
        throw=False,
    )


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
    np.testing.assert_allclose(ours.value, theirs.value, rtol=1e-8)
    np.testing.assert_allclose(ours.value, scipys.x, rtol=1e-8)
    assert ours.state.info.f == pytest.approx(scipys.cost, rel=1e-13)
    assert ours.state.done
    assert LaneLevenbergMarquardt().at_optimum(ours.state.info)


def test_lanes_under_vmap_and_a_loop_are_the_same():
    readings = jnp.stack([data(seed) for seed in range(4)])
    loop = jnp.stack([solve(r).value for r in readings])
    batch = jax.vmap(lambda r: solve(r).value)(readings)

    def lanes(y, readings):
        return jax.vmap(decay, in_axes=(1, 1), out_axes=1)(y, readings)

    starts = jnp.repeat(START[:, None], 4, axis=1)
    together = optx.least_squares(
        lanes, LaneLevenbergMarquardt(), starts, readings.T, max_steps=60
    )
    np.testing.assert_allclose(batch, loop, rtol=1e-10)
    np.testing.assert_allclose(together.value.T, loop, rtol=1e-10)
    assert together.state.done.all()


def test_a_start_at_the_rounding_floor_is_left_at_once():
    # there no step can make the cost fall, and a classical trust region rejects on
    end = solve(data(1)).value
    again = solve(data(1), end)
    assert again.state.steps == 1
    np.testing.assert_allclose(again.value, end, rtol=1e-12)


def test_a_lane_that_is_not_finite_stays_and_disturbs_no_other():
    readings = jnp.stack([data(0), jnp.full(9, jnp.nan), data(2)])

    def lanes(y, readings):
        return jax.vmap(decay, in_axes=(1, 1), out_axes=1)(y, readings)

    starts = jnp.repeat(START[:, None], 3, axis=1)
    solver = LaneLevenbergMarquardt()
    found = optx.least_squares(lanes, solver, starts, readings.T, max_steps=60)
    np.testing.assert_array_equal(
        solver.at_optimum(found.state.info), [True, False, True]
    )
    np.testing.assert_allclose(found.value[:, 2], solve(data(2)).value, rtol=1e-10)
    np.testing.assert_array_equal(found.value[:, 1], START)


def test_unknowns_that_no_residual_tells_apart_are_no_optimum():
    def ridge(y, _):
        return jnp.stack([y[0] + y[1] - 1.0, 2 * (y[0] + y[1]) - 2.5])

    solver = LaneLevenbergMarquardt()
    found = optx.least_squares(ridge, solver, jnp.zeros(2), max_steps=30, throw=False)
    assert not solver.at_optimum(found.state.info)
    assert np.isfinite(found.value).all()
