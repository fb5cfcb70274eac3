"""Which method tells how sure an answer is, and that both say the same of a normal."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import multivariate_normal, multivariate_t

from jblast.inference import fit
from jblast.inference.fitting.findings import DirectionUnidentified
from jblast.inference.fitting.uncertainty import uncertainty
from jblast.inference.importance import (
    FREEDOM,
    MAX_QUANTILE_ERROR,
    check_intervals,
    reaching,
)
from jblast.report.fit.findings import all_words, reason_words, words
from tests.catalogue import (
    MASS_FREE,
    WU_HAO,
    disagreeing,
    disagreeing_solved,
    pressures,
    wu_hao_arrivals,
)


def test_a_narrow_answer_is_left_to_the_normal_approximation():
    result = fit(
        pressures(15.0, sigma=0.01), MASS_FREE, noise="gaussian", posterior="auto"
    )
    assert result.summary.posterior == "laplace"
    assert "k-hat" in reason_words(result.posterior_reason)
    assert result.summary.warnings == ()


def test_a_wide_answer_gets_walkers_and_they_agree_where_it_is_normal():
    wide = fit(
        pressures(15.0, sigma=0.3), MASS_FREE, noise="gaussian", posterior="auto"
    )
    assert wide.summary.posterior == "emcee"
    assert wide.summary.converged
    assert any("k-hat" in said for said in all_words(wide.summary.warnings))
    normal = fit(pressures(15.0, sigma=0.3), MASS_FREE, noise="gaussian").summary
    by_walk = wide.summary.estimates["charge_mass_kg"]
    by_normal = normal.estimates["charge_mass_kg"]
    assert by_walk.value == by_normal.value
    # ln p is nearly straight in ln W: the two differ by the walk's error of 5 % of the
    # sd, and as much by the bend
    for quantile in ("q05", "q95"):
        apart = np.log(getattr(by_walk, quantile) / getattr(by_normal, quantile))
        assert abs(apart) < 0.15 * by_normal.log_sd
    assert by_walk.log_sd == pytest.approx(by_normal.log_sd, rel=0.1)


def test_what_no_log_can_tell_is_not_walked_over():
    result = fit(wu_hao_arrivals([20.0] * 4), WU_HAO, posterior="emcee")
    assert result.summary.posterior == "laplace"
    assert result.posterior_reason == DirectionUnidentified()
    assert not result.summary.identifiable


def ends_by_grid(solution):
    """Integrate a posterior of one unknown; its ends in sds of its normal."""
    normal = solution.laplace
    x = np.linspace(-20, 20, 4001)
    z = normal.z[0] + x * np.sqrt(normal.covariance[0, 0])
    density = jax.vmap(solution.posterior.log_density)(jnp.asarray(z[:, None]))
    below = np.cumsum(np.exp(density - np.max(density)))
    return np.interp((0.05, 0.95), below / below[-1], x)


@pytest.mark.parametrize("free", [1, 4])
def test_draws_that_reach_further_come_with_their_density(free):
    w, log_drawn, log_normal = reaching(40_000, free, np.random.default_rng(0))
    normal = multivariate_normal(np.zeros(free)).logpdf(w)
    student = multivariate_t(np.zeros(free), df=FREEDOM).logpdf(w)
    mixed = np.logaddexp(normal, student) - np.log(2)
    # up to the constant that both share
    constant = (normal - log_normal)[0]
    np.testing.assert_allclose(normal - log_normal, constant, rtol=1e-12)
    np.testing.assert_allclose(mixed - log_drawn, constant - np.log(2), rtol=1e-11)
    # and they are drawn from it: weights p/q of mean 1, for either half
    for log_density in (normal, student):
        weights = np.exp(log_density - mixed)
        error = weights.std() / np.sqrt(len(w))
        assert weights.mean() == pytest.approx(1.0, abs=4 * error)


@pytest.mark.slow
@pytest.mark.parametrize("apart", [0.0, 2.5, 4.0])
def test_ends_are_off_by_what_integration_says_and_the_answer_warns(apart):
    made = disagreeing(apart)
    solution = disagreeing_solved(apart)
    by = np.abs(ends_by_grid(solution) - (-1.645, 1.645)).max()
    found = check_intervals(solution.posterior, solution.laplace)
    assert found.off == pytest.approx(by, abs=3 * found.error + 0.01)
    assert found.believed
    alone = fit(made, MASS_FREE, posterior="laplace").summary
    said = [w for w in all_words(alone.warnings) if "90 %" in w]
    warned = f"an error of up to {found.off:.1f} sd for charge_mass_kg"
    assert [warned in w and "--posterior emcee runs MCMC" in w for w in said] == (
        [True] if by > MAX_QUANTILE_ERROR else []
    )


@pytest.mark.parametrize("apart", [0.0, 4.0])
def test_weighted_intervals_end_where_integration_says(apart):
    made = disagreeing(apart)
    solution = disagreeing_solved(apart)
    weighted = fit(made, MASS_FREE)
    assert weighted.weighted
    mass = weighted.summary.estimates["charge_mass_kg"]
    normal = solution.laplace
    ends = (np.log([mass.q05, mass.q95]) - normal.z) / np.sqrt(normal.covariance)
    found = check_intervals(solution.posterior, normal)
    # chance moves an end by its standard error, told of the worst one alone
    expected = ends_by_grid(solution)
    np.testing.assert_allclose(ends[0], expected, atol=3 * max(found.error, 0.03))
    assert np.abs(ends[0]).max() == pytest.approx(
        np.abs(expected).max(), abs=3 * max(found.error, 0.03)
    )
    assert not any("90 %" in said for said in all_words(weighted.summary.warnings))


def test_where_importance_sampling_cannot_tell_the_approximation_stands_alone():
    solution = disagreeing_solved(0.0)
    normal = solution.laplace
    # a normal a hundredth as wide as the posterior: weights of a heavy tail
    thin = replace(normal, covariance=1e-4 * normal.covariance)
    sure = uncertainty(solution._replace(laplace=thin), "weighted")
    assert not sure.weighted
    assert "is unreliable" in words(sure.reason)
    assert any("of a normal approximation" in why for why in all_words(sure.findings))
