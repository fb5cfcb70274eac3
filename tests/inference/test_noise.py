"""Errors of one reading: against SciPy and automatic derivatives."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from jblast.inference.noise import (
    log_noise,
    noise_slopes,
)

ERRORS: dict[str, Any] = {"gaussian": stats.norm(), "student": stats.t(df=4)}


@pytest.mark.parametrize("noise", ERRORS)
def test_errors_have_the_density_of_scipy(noise):
    u = np.linspace(-30, 30, 41)
    np.testing.assert_allclose(
        log_noise(jnp.asarray(u), noise), ERRORS[noise].logpdf(u), rtol=1e-12
    )


@pytest.mark.parametrize("noise", ERRORS)
def test_slopes_of_an_error_are_its_derivatives(noise):
    u = jnp.linspace(-30, 30, 41)
    first = jax.grad(lambda u: -log_noise(u, noise))
    slope, curvature = noise_slopes(u, noise)
    np.testing.assert_allclose(slope, jax.vmap(first)(u), rtol=1e-11)
    np.testing.assert_allclose(curvature, jax.vmap(jax.grad(first))(u), rtol=1e-9)
