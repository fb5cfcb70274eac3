import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference.importance import (
    generalised_pareto,
    importance,
    largest_log_sd,
    largest_quantile_error,
    pareto_smoothed,
)
from tests.inference.shots import five_solved


@pytest.mark.parametrize(
    ("seed", "scale", "k_hat", "moment", "ess", "largest"),
    [
        (0, 0.5, 0.29124162626063915, 1.3118067620824305, 3788.108973780517, -6.5528),
        (1, 1.0, 0.5018025379115554, 2.036140741929583, 2312.6369586732144, -5.1281),
        (2, 1.7, 0.6326265268814418, 3.3852801340197844, 445.02212192638876, -3.4505),
    ],
)
def test_smoothed_weights_are_those_of_arviz(seed, scale, k_hat, moment, ess, largest):
    # arviz.psislw(log_ratio) of arviz 0.23.4
    x = np.random.default_rng(seed).standard_normal(4000)
    log_weights, k = pareto_smoothed(scale * x**2 / 4)
    weights = np.exp(log_weights)
    assert k == pytest.approx(k_hat, rel=1e-9)
    assert weights @ x**2 == pytest.approx(moment, rel=1e-9)
    assert 1 / np.sum(weights**2) == pytest.approx(ess, rel=1e-9)
    assert log_weights.max() == pytest.approx(largest, abs=1e-4)


@pytest.mark.parametrize("shape", [-0.2, 0.3, 0.8])
def test_the_shape_of_a_pareto_tail_is_found(shape):
    u = (np.arange(5000) + 0.5) / 5000
    k, scale = generalised_pareto(2.0 * np.expm1(-shape * np.log1p(-u)) / shape)
    assert k == pytest.approx(shape, abs=0.02)
    assert scale == pytest.approx(2.0, rel=0.02)


def test_ratios_all_alike_are_a_perfect_match_and_a_lone_one_is_none():
    log_weights, k = pareto_smoothed(np.zeros(100))
    assert k == 0.0
    np.testing.assert_allclose(log_weights, -np.log(100))
    assert pareto_smoothed(np.r_[0.0, np.full(99, -np.inf)])[1] == np.inf
    assert pareto_smoothed(np.full(99, -np.inf))[1] == np.inf
    assert pareto_smoothed(np.zeros(3))[1] == np.inf


@pytest.mark.slow  # compiles a posterior for itself
def test_weights_turn_a_normal_too_wide_into_the_posterior():
    posterior, normal, _, _ = five_solved("gaussian")
    right = importance(posterior, normal)
    assert right.k_hat < 0.3
    wide = importance(
        posterior, dataclasses.replace(normal, covariance=2.25 * normal.covariance)
    )
    assert 0.1 < wide.ess / len(wide.z) < 0.6  # (2 / 1.5 - 1 / 1.5^2)^2 ... about 0.4
    sds = [
        np.sqrt(found.weights @ (found.z - found.weights @ found.z) ** 2)
        for found in (right, wide)
    ]
    np.testing.assert_allclose(sds[1], sds[0], rtol=0.12)  # 4 / sqrt(2 ess)
    narrow = importance(
        posterior, dataclasses.replace(normal, covariance=0.1 * normal.covariance)
    )
    assert narrow.k_hat > 0.7  # its tails hold none of the posterior's


@pytest.mark.slow
@pytest.mark.parametrize("wider", [1.0, 1.25])
def test_the_ends_of_a_normal_too_wide_are_off_by_what_it_is_too_wide(wider):
    posterior, normal, _, _ = five_solved("gaussian")
    wide = dataclasses.replace(normal, covariance=wider**2 * normal.covariance)
    # 1.645 of its sds instead of 1.645/wider; the end is known to 2.1/sqrt(4000) = 0.03
    # sd, and here the posterior bends by as much
    off = largest_quantile_error(importance(posterior, wide), wide)
    assert off == pytest.approx(1.645 * (1 - 1 / wider), abs=0.12)


def test_the_largest_log_sd_is_of_the_mass_or_of_the_place_over_its_range():
    posterior, normal, _, _ = five_solved()
    sds = np.sqrt(np.diag(normal.covariance))
    nearest = np.asarray(posterior.misfit(jnp.asarray(normal.z)).slant_range).min()
    assert largest_log_sd(posterior, normal) == pytest.approx(sds[0], rel=1e-3)
    covariance = normal.covariance * np.diag([1e-12, 1.0, 1.0, 1.0])
    placed = dataclasses.replace(normal, covariance=covariance)
    assert largest_log_sd(posterior, placed) == pytest.approx(
        sds[1:3].max() / nearest, rel=1e-3
    )
