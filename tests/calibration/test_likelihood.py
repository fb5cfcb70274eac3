import math
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm, t

from calibration.ford_2021 import ADOPTED, QUANTITIES, fit
from calibration.likelihood import log_student_t, marginal
from jblast.waves.laws.ford_2021 import ford_2021

SHOT = np.array([0, 0, 0, 1, 1, 2, 2, 2])
PATH = np.array([0, 1, 1, 0, 2, 1, 2, 2])
X = np.linspace(-1.0, 1.0, 8)
Y = np.array([0.3, 0.1, 0.2, -0.4, 0.1, 0.9, 0.6, 0.8])
SDS = np.array([0.3, 0.2, 0.15])
DESIGN = np.stack([np.ones(8), X], axis=1)


def covariance(sds, weight=None):
    keep = slice(None) if weight is None else weight > 0
    same_shot = (SHOT[:, None] == SHOT) * sds[0] ** 2
    same_path = (PATH[:, None] == PATH) * sds[1] ** 2
    full = same_shot + same_path + np.eye(8) * sds[2] ** 2
    return full[keep][:, keep]


def effects(sds, x):
    return sds[0] * x[:3][SHOT] + sds[1] * x[3:6][PATH]


@partial(jax.jit, static_argnums=(2, 3))
def integrated(sds, weight, nu, restricted):
    def predict(sds, x):
        if restricted:
            return jnp.asarray(DESIGN) @ x[:2] + effects(sds, x[2:])
        return effects(sds, x)

    precision = np.array([0.0, 0.0] * restricted + [1.0] * 6)
    start = jnp.zeros(len(precision))
    return marginal(
        predict, sds, jnp.asarray(precision), start, jnp.asarray(Y), weight, nu
    )


@pytest.mark.slow
@pytest.mark.parametrize("weight", [np.ones(8), np.array([1.0] * 5 + [0.0] * 3)])
def test_gaussian_likelihood_is_scipys_with_its_normalisation(weight):
    got = integrated(jnp.asarray(SDS), jnp.asarray(weight), math.inf, False)
    expected = multivariate_normal(cov=covariance(SDS, weight)).logpdf(Y[weight > 0])
    # Both are closed forms; only rounding differs.
    assert got.log_likelihood == pytest.approx(expected, abs=1e-10)


def test_restricted_gaussian_likelihood_is_the_integral_over_the_coefficients():
    got = integrated(jnp.asarray(SDS), jnp.ones(8), math.inf, True)
    inverse = np.linalg.inv(covariance(SDS))
    information = DESIGN.T @ inverse @ DESIGN
    best = np.linalg.solve(information, DESIGN.T @ inverse @ Y)
    at_best = multivariate_normal(DESIGN @ best, covariance(SDS)).logpdf(Y)
    volume = math.log(2 * math.pi) - 0.5 * np.linalg.slogdet(information)[1]
    assert got.log_likelihood == pytest.approx(at_best + volume, abs=1e-10)
    assert np.allclose(got.mode[:2], best, atol=1e-10)
    assert np.allclose(got.covariance[:2, :2], np.linalg.inv(information), atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("nu", [4.0, math.inf])
def test_gradient_through_the_mode_agrees_with_finite_differences(nu):
    def value(sds):
        return integrated(sds, jnp.ones(8), nu, True).log_likelihood

    got = jax.jit(jax.grad(value))(jnp.asarray(SDS))
    compiled = jax.jit(value)
    for i in range(3):
        step = np.zeros(3)
        step[i] = 1e-5
        numeric = (compiled(jnp.asarray(SDS + step)) - compiled(SDS - step)) / 2e-5
        assert got[i] == pytest.approx(float(numeric), abs=1e-6)


@pytest.mark.parametrize("nu", [4.0, math.inf])
def test_density_of_an_error_is_scipys(nu):
    errors = np.linspace(-2.0, 2.0, 9)
    got = log_student_t(jnp.asarray(errors), jnp.asarray(0.3), nu)
    if math.isinf(nu):
        expected = norm.logpdf(errors, scale=0.3)
    else:
        expected = t.logpdf(errors, nu, scale=0.3)
    assert np.allclose(got, expected, atol=1e-12)


def test_laplace_of_student_errors_is_near_the_integral():
    # One effect, five records: Laplace leaves out terms of order one over the number
    # of records; 0.1 in ln L is what remains here.
    value = np.array([0.2, 0.3, 0.25, 0.1, 1.5])

    @jax.jit
    def integrated(value):
        return marginal(
            lambda sds, x: jnp.broadcast_to(sds[0] * x[0], (5,)),
            jnp.array([0.3, 0.1]),
            jnp.ones(1),
            jnp.zeros(1),
            value,
            jnp.ones(5),
            4.0,
        )

    got = integrated(jnp.asarray(value))
    exact, _ = quad(
        lambda u: norm.pdf(u) * np.prod(t.pdf(value, 4, loc=0.3 * u, scale=0.1)), -8, 8
    )
    assert got.log_likelihood == pytest.approx(math.log(exact), abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("quantity", QUANTITIES)
def test_packaged_coefficients_are_what_the_script_finds(quantity):
    found = fit(quantity, ADOPTED[quantity]).curve
    packaged = ford_2021()
    kept = packaged.impulse if "impulse" in quantity else packaged.duration
    # The search stops where the likelihood is flat to 1e-13 of itself.
    for name, value in vars(found).items():
        assert np.allclose(getattr(kept, name), value, rtol=1e-3, atol=1e-4), name
