"""Lower bounds in the likelihood: against SciPy, by quadrature, by differences."""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate, stats

from jblast.inference.posterior.likelihood import (
    blurred,
    log_likelihood,
    log_survival,
    survival_information,
    survival_slopes,
)

ERRORS: dict[str, Any] = {"gaussian": stats.norm(), "student": stats.t(df=4)}
RNG = np.random.default_rng(3)
RESIDUAL, SD = RNG.normal(size=6) * 0.1, RNG.uniform(0.05, 0.2, size=6)
LOADING = RNG.normal(size=(6, 2)) * 0.1
BOUND = np.array([True, False, True, True, False, False])

likelihood = jax.jit(log_likelihood, static_argnames="noise")


@pytest.mark.parametrize("noise", ERRORS)
def test_the_chance_of_an_error_is_that_of_scipy_in_both_tails(noise):
    u = np.array([-1e3, -12, -2, -1e-9, 0, 1e-9, 2, 9.99, 10.01, 30, 1e3, 1e6])
    expected = ERRORS[noise].logsf(u)
    np.testing.assert_allclose(
        jax.jit(log_survival, static_argnames="noise")(jnp.asarray(u), noise),
        expected,
        rtol=1e-13,  # rounding, and 1e-13 of the series of Mills' ratio
    )


@pytest.mark.parametrize("noise", ERRORS)
def test_slopes_of_a_bound_are_its_derivatives_and_finite(noise):
    u = jnp.array([-1e8, -40.0, -2.0, 0.0, 2.0, 9.99, 10.01, 1e8])

    @jax.jit
    def derivatives(u):
        first = jax.grad(lambda u: -log_survival(u, noise))
        return jax.vmap(first)(u), jax.vmap(jax.grad(first))(u)

    slope, curvature = survival_slopes(u, noise)
    np.testing.assert_allclose(slope, derivatives(u)[0], rtol=1e-11)
    np.testing.assert_allclose(curvature, derivatives(u)[1], rtol=1e-9, atol=1e-15)
    hazard = np.exp(ERRORS[noise].logpdf(u[1:5]) - ERRORS[noise].logsf(u[1:5]))
    np.testing.assert_allclose(slope[1:5], hazard, rtol=1e-12)


@pytest.mark.parametrize("noise", ERRORS)
def test_information_of_a_bound_is_that_of_one_yes_or_no(noise):
    u = np.array([-3.0, 0.0, 1.0])
    of, chance = ERRORS[noise], ERRORS[noise].sf(u)
    expected = of.pdf(u) ** 2 / (chance * (1 - chance))
    found = survival_information(jnp.asarray(u), noise)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize("noise", ERRORS)
def test_independent_rows_count_with_density_or_survival(noise):
    value, _ = likelihood(RESIDUAL, SD, np.zeros((6, 0)), noise, BOUND)
    of, u = ERRORS[noise], RESIDUAL / SD
    read = of.logpdf(u) - np.log(SD)
    np.testing.assert_allclose(
        value, np.where(BOUND, of.logsf(u), read).sum(), rtol=1e-12
    )


def integral(residual, sd, loading, bound, of):
    """Rows that share one effect, by quadrature over a fine grid."""
    v = np.linspace(-9, 9, 4001)[:, None]
    u = (residual - loading * v) / sd
    rows = np.where(bound, of.logsf(u), of.logpdf(u) - np.log(sd))
    joint = rows.sum(axis=1) + stats.norm.logpdf(v[:, 0])
    top = joint.max()
    return top + np.log(integrate.simpson(np.exp(joint - top), x=v[:, 0]))


@pytest.mark.parametrize("noise", ERRORS)
@pytest.mark.parametrize("scale", [0.3, 1.0, 3.0])
def test_a_shared_effect_is_integrated_out_near_the_exact_integral(noise, scale):
    # The bound on the integral is not exact: where the law says less than all of the
    # lower bounds, or more, it misses ln-probability by this much at most. A fit sees
    # how the miss changes from one place to the next.
    rng = np.random.default_rng(8)
    residual = rng.standard_t(4, size=8) * 0.1
    sd, loading = np.full(8, 0.1), np.full(8, 0.1 * scale)
    bound = np.arange(8) < 4
    misses = []
    for shift in np.linspace(-0.6, 0.6, 7):
        moved = residual + np.where(bound, shift, 0.0)
        value, _ = likelihood(moved, sd, loading[:, None], noise, bound)
        misses.append(float(value) - integral(moved, sd, loading, bound, ERRORS[noise]))
    assert np.max(np.abs(misses)) < 0.12, misses
    assert np.max(np.abs(np.diff(misses))) < 0.06, misses


@functools.partial(jax.jit, static_argnames="noise")
def joint_slopes(v, residual, sd, loading, noise, bound):
    """Slope and curvature of the expectation of rows and effects, by the effects."""
    load = loading / sd[:, None]
    blur = blurred(residual / sd, load, noise, bound)[0].blur
    nodes, weights = np.polynomial.hermite_e.hermegauss(5)

    def joint(v):
        total = -0.5 * v @ v
        for node, weight in zip(nodes, weights / weights.sum(), strict=True):
            u = residual / sd - load @ v + node * blur
            read = jnp.asarray(ERRORS_OF_ROW[noise](u))
            rows = jnp.where(bound, log_survival(u, noise), read)
            total += weight * jnp.sum(rows)
        return total

    return jax.grad(joint)(v), jax.hessian(joint)(v)


@pytest.mark.slow
@pytest.mark.parametrize("noise", ERRORS)
@pytest.mark.parametrize("shift", [-30.0, -1.0, 1.0, 30.0])
def test_the_expected_effects_are_found_wherever_bounds_lie(noise, shift):
    # twelve bounds, met by far or missed by far, under effects as large as ten errors
    bound = np.arange(16) < 12
    residual = np.where(bound, shift, 0.05 * RNG.normal(size=16))
    sd, loading = np.full(16, 0.1), RNG.normal(size=(16, 3)) + 0.5

    value, v = likelihood(residual, sd, loading, noise, bound)
    assert np.isfinite(value)
    slope, curvature = joint_slopes(v, residual, sd, loading, noise, bound)
    # what another Newton step would gain
    assert abs(slope @ np.linalg.solve(curvature, slope)) < 1e-8


ERRORS_OF_ROW = {
    "gaussian": lambda u: -0.5 * u**2,
    "student": lambda u: -2.5 * jnp.log1p(u**2 / 4),
}


@pytest.mark.slow  # by default without a bound, test_likelihood.py, and a bound alone
@pytest.mark.parametrize("noise", ["gaussian", "student"])
def test_first_and_second_derivatives_agree_with_finite_differences(noise):
    def value(x):
        moved, wide = RESIDUAL + x[0], SD * x[1]
        return log_likelihood(moved, wide, LOADING, noise, BOUND)[0]

    at, step = np.array([0.02, 1.1]), 1e-4
    ends = at + step * np.array([[1, 0], [-1, 0], [0, 1], [0, -1], [0, 0]])
    values, slopes = jax.jit(jax.vmap(jax.value_and_grad(value)))(ends)
    # central differences: the error is some 1e-8 times the third derivative
    by_values = (values[0:4:2] - values[1:4:2]) / (2 * step)
    np.testing.assert_allclose(slopes[4], by_values, rtol=1e-5)
    by_slopes = (slopes[0:4:2] - slopes[1:4:2]) / (2 * step)
    np.testing.assert_allclose(by_slopes, by_slopes.T, rtol=1e-5)
    second = jax.jit(jax.jacfwd(jax.grad(value)))(at)
    np.testing.assert_allclose(second, by_slopes, rtol=1e-5)
