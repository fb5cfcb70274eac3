"""Errors of one reading: against SciPy and automatic derivatives."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from jblast.inference.noise import (
    log_noise,
    log_survival,
    survival_slopes,
)

ERRORS: dict[str, Any] = {"gaussian": stats.norm(), "student": stats.t(df=4)}


@pytest.mark.parametrize("noise", ERRORS)
def test_errors_have_the_density_of_scipy(noise):
    u = np.linspace(-30, 30, 41)
    np.testing.assert_allclose(
        log_noise(jnp.asarray(u), noise), ERRORS[noise].logpdf(u), rtol=1e-12
    )


@pytest.mark.parametrize("noise", ERRORS)
def test_the_chance_of_an_error_is_that_of_scipy_in_both_tails(noise):
    u = np.array([-1e3, -12, -2, -1e-9, 0, 1e-9, 2, 9.99, 10.01, 30, 1e3, 1e6])
    np.testing.assert_allclose(
        jax.jit(log_survival, static_argnames="noise")(jnp.asarray(u), noise),
        ERRORS[noise].logsf(u),
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
