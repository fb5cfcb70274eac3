import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads
from scipy import integrate, stats

from jblast.inference.posterior.likelihood import log_likelihood, log_noise

RNG = np.random.default_rng(7)
RESIDUAL = jnp.asarray(RNG.normal(size=6) * 0.1)
SD = jnp.asarray(RNG.uniform(0.05, 0.2, size=6))
LOADING = jnp.asarray(RNG.normal(size=(6, 2)) * 0.1)


@pytest.mark.parametrize(
    ("noise", "reference"), [("gaussian", stats.norm()), ("student", stats.t(df=4))]
)
def test_independent_errors_have_the_density_of_scipy(noise, reference):
    u = np.linspace(-30, 30, 41)
    np.testing.assert_allclose(
        log_noise(jnp.asarray(u), noise), reference.logpdf(u), rtol=1e-12
    )


def test_normal_errors_with_shared_effects_are_one_multivariate_normal():
    covariance = np.diag(SD**2) + np.asarray(LOADING @ LOADING.T)
    normal = stats.multivariate_normal(cov=covariance)  # pyright: ignore[reportArgumentType]  SciPy's stub says int
    expected = normal.logpdf(RESIDUAL)
    value, _ = log_likelihood(RESIDUAL, SD, LOADING, "gaussian")
    # exact up to rounding
    np.testing.assert_allclose(value, expected, rtol=1e-12)


def integral(residual, sd, loading):
    """Student-t rows that share one effect, by adaptive quadrature."""

    def density(v):
        rows = stats.t.logpdf(residual - loading * v, df=4, scale=sd)
        return np.exp(rows.sum() + stats.norm.logpdf(v))

    return np.log(integrate.quad(density, -12, 12, points=[-2, 0, 2], limit=500)[0])


@pytest.mark.parametrize("count", [2, 5, 20])
def test_student_errors_with_a_shared_effect_are_near_the_exact_integral(count):
    # Laplace's method is not exact for Student-t rows: in ln-probability it misses by
    # up to 0.1 for two rows, less for more. What matters is how the miss changes where
    # the residuals shift, since that is what a fit sees.
    rng = np.random.default_rng(count)
    residual = rng.standard_t(4, size=count) * 0.1 + 0.05
    sd, loading = np.full(count, 0.1), np.full(count, 0.1)
    misses = []
    for shift in (0.0, 0.05, 0.1):
        value, _ = log_likelihood(
            jnp.asarray(residual + shift),
            jnp.asarray(sd),
            jnp.asarray(loading)[:, None],
            "student",
        )
        misses.append(float(value) - integral(residual + shift, sd, loading))
    assert np.max(np.abs(misses)) < 0.12
    assert np.ptp(misses) < 0.06


def test_expected_effects_obey_the_identity_of_posterior_means():
    # v is standard normal, so its posterior mean is -L^T times the slope of ln p(r)
    def value(residual):
        return log_likelihood(residual, SD, LOADING, "student")[0]

    _, v = log_likelihood(RESIDUAL, SD, LOADING, "student")
    slope = jax.grad(value)(RESIDUAL)
    np.testing.assert_allclose(v, -LOADING.T @ slope, atol=1e-9)


@pytest.mark.slow
def test_two_groups_of_readings_far_apart_are_integrated_near_the_exact_integral():
    # a shift through the place where the effect gives up on the readings: of two modes
    # of equal weight the bound holds one, so it is low by ln 2 there
    rng = np.random.default_rng(4)
    sd, loading = np.full(8, 0.1), np.full(8, 0.12)
    base = rng.standard_t(4, size=8) * 0.1
    shifts = np.linspace(0.0, 3.0, 121)
    value, _ = jax.vmap(
        lambda r: log_likelihood(r, sd, jnp.asarray(loading)[:, None], "student")
    )(jnp.asarray(base + shifts[:, None]))
    exact = [integral(base + shift, sd, loading) for shift in shifts]
    off = np.asarray(value) - exact
    assert np.max(off) < 0.05  # above only by what five nodes leave
    assert np.min(off) > -1.5
    assert np.max(np.abs(np.diff(off))) < np.log(2)


@pytest.mark.parametrize(
    "noise", [pytest.param("gaussian", marks=pytest.mark.slow), "student"]
)
def test_first_and_second_derivatives_agree_with_finite_differences(noise):
    def value(shift, stretch):
        return log_likelihood(RESIDUAL + shift, SD * stretch, LOADING, noise)[0]

    # step 1e-4 of check_grads: central differences good to about 1e-6 here
    check_grads(
        jax.jit(value),
        (jnp.asarray(0.02), jnp.asarray(1.1)),
        order=2,
        atol=1e-4,
        rtol=1e-4,
    )


def test_one_wild_row_moves_the_shared_effect_less_under_student_errors():
    sd, loading = jnp.full(10, 0.1), jnp.full((10, 1), 0.1)
    clean = jnp.zeros(10)
    wild = clean.at[3].set(3.0)
    _, normal = log_likelihood(wild, sd, loading, "gaussian")
    _, student = log_likelihood(wild, sd, loading, "student")
    assert float(normal[0]) > 2
    assert abs(float(student[0])) < 0.2
