import jax
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from calibration.efficiency import CASES, errors_of, price, verdict
from jblast.inference.posterior.likelihood import log_noise

LOGS = 400


def expected(function):
    """The mean of a function of a standard normal error."""
    return quad(lambda u: float(function(u)) * norm.pdf(u), -12, 12)[0]


def test_price_is_the_sandwich_of_the_density_that_is_fitted():
    score = jax.jit(jax.grad(lambda u: -log_noise(u, "student")))
    bend = jax.jit(jax.grad(score))
    sandwich = expected(lambda u: score(u) ** 2) / expected(bend) ** 2
    assert price() == pytest.approx(np.sqrt(sandwich), rel=1e-7)  # of the integral


def test_price_vanishes_as_student_becomes_normal():
    # To first order in 1/nu the score adds (3u - u^3)/nu to a multiple of u, with which
    # it has no correlation: 6/nu^2 in the variance. The next order is O(1/nu) of it.
    assert price(1e3) - 1 == pytest.approx(3 / 1e3**2, rel=0.02)


def test_place_is_measured_by_the_nearest_range_and_time_by_its_sound():
    told = CASES["microphones"].yardsticks()
    near = np.sqrt(50**2 + 5**2 + 1.5**2)  # (10, -5, 0) to (60, 0, 1.5)
    assert told == pytest.approx(
        {
            "charge_mass_kg": 1.0,
            "charge_east_m": near,
            "charge_north_m": near,
            "origin_time_s": near / 340,
        }
    )


def test_only_what_is_narrow_is_judged():
    assert verdict(0.099, 1.0) == "ok"
    assert verdict(0.099, 0.949) == verdict(0.099, 1.051) == "MISSED"
    assert verdict(0.1, 2.0) == "(wide)"


@pytest.mark.slow
def test_answers_to_few_arrivals_reach_the_bound():
    found = errors_of(CASES["arrivals"], 0, "gaussian", "gaussian", logs=LOGS)
    assert found.unconverged == found.costlier == 0
    # 5 standard errors of a root mean square, and of a mean
    np.testing.assert_allclose(found.rmse, 1.0, atol=5 / np.sqrt(2 * LOGS))
    np.testing.assert_allclose(found.rmse_error, 1 / np.sqrt(2 * LOGS), rtol=0.3)
    np.testing.assert_allclose(found.bias, 0.0, atol=5 / np.sqrt(LOGS))
