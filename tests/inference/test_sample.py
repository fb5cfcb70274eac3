"""Weighted draws against integrals, and what is read from them."""

import numpy as np
import pytest

from jblast.inference import fit
from jblast.inference.density import density_of
from jblast.inference.identify import WHOLE_TURN
from jblast.inference.regions import arcs, extent, quantiles, regions
from jblast.inference.sample import (
    generalised_pareto,
    pareto_smoothed,
    smoothed,
    solve,
)
from jblast.scene import Scene, UncertainScene, freed
from tests.catalogue import MASS_FREE, disagreeing
from tests.inference.logs import log

RNG = np.random.default_rng
KEPT = (0.05, 0.5, 0.95)


@pytest.mark.parametrize("apart", [0.0, 2.5, 4.0])
def test_quantiles_are_those_of_integration(apart):
    density = density_of(disagreeing(apart), MASS_FREE)
    density, draws = solve(density)
    assert draws.reliable
    ln_mass = np.linspace(np.log(0.05), np.log(5e4), 3000)
    height = density(ln_mass[:, None])
    # what the bound on the likelihood leaves out, by many draws of the scales
    gains = [density.exact(ln_mass[:, None], RNG(i))[1] for i in range(6)]
    below = np.cumsum(np.exp(height + np.log(np.mean(np.exp(gains), 0)) - height.max()))
    expected = np.interp(KEPT, below / below[-1], ln_mass)
    found = np.log(quantiles(draws.values[:, 0], draws.weights))
    sd = (expected[2] - expected[0]) / 3.29
    # some thousand effective draws: 0.07 sd at the ends, and of two modes their shares
    np.testing.assert_allclose(found, expected, atol=0.25 * sd)


def test_a_log_of_linear_numbers_alone_has_the_normal_of_regression():
    rows = [
        (n, "flash_time_s", 1.0 + 0.01 * i, 0.02, 50.0) for i, n in enumerate("abc")
    ]
    uncertain = freed(UncertainScene(Scene()), ["origin_time_s"])
    found = fit(log(*rows, at_range=True), uncertain, noise="gaussian")
    time = found.summary.estimates["origin_time_s"]
    assert time.value == pytest.approx(1.01, abs=1e-5)
    # a mean of three, by two thousand draws; the sd of light is nothing
    assert time.sd == pytest.approx(0.02 / np.sqrt(3), rel=0.05)
    assert found.exit_code == 0


def test_the_shape_of_a_pareto_tail_is_found():
    for k in (0.3, 0.9):
        # ratios with the tail index 1/k
        _, found = pareto_smoothed(np.log(RNG(0).pareto(1 / k, 20_000) + 1))
        assert found == pytest.approx(k, abs=0.15)
        x = np.sort(RNG(1).pareto(1 / k, 5000))
        shape, scale = generalised_pareto(x)
        assert shape == pytest.approx(k, abs=0.1)
        assert scale == pytest.approx(k, rel=0.15)


def test_noise_about_a_quadratic_is_smoothed():
    rng = RNG(7)
    u = rng.normal([5.0, -3.0], [0.1, 2.0], (2000, 2))
    exact = 1 + (u[:, 0] - 5) * 3 + 0.2 * (u[:, 1] + 3) ** 2
    near = np.abs((u - [5, -3]) / [0.1, 2.0]).max(1) < 2
    found = smoothed(u, exact + rng.normal(0, 1, 2000), np.full(2000, 1 / 2000))
    # six terms of 2,000 values with an sd of 1
    np.testing.assert_allclose(found[near], exact[near], atol=0.3)


def test_weights_without_a_tail_stay():
    log_ratio = np.zeros(500)
    smoothed, k_hat = pareto_smoothed(log_ratio)
    np.testing.assert_allclose(np.exp(smoothed), 1 / 500)
    assert k_hat == -np.inf


def test_quantiles_of_weighted_numbers_are_those_of_repeated_ones():
    x, times = RNG(2).normal(size=300), RNG(3).integers(1, 9, 300)
    repeated = np.quantile(np.repeat(x, times), KEPT)
    np.testing.assert_allclose(quantiles(x, times / times.sum()), repeated, atol=0.1)


def test_arcs_hold_their_share_and_cross_north():
    rng = RNG(4)
    degrees = np.concatenate([rng.normal(358, 4, 6000), rng.normal(180, 4, 4000)])
    first, second = arcs(np.radians(degrees), np.full(10_000, 1e-4))
    assert first.last < first.first  # across north
    # 90 % of a normal: 3.29 sd, and its smoothing
    assert first.size == pytest.approx(3.29 * 4, rel=0.25)
    assert (first.share, second.share) == pytest.approx((0.54, 0.36), abs=0.03)


@pytest.mark.parametrize("count", [500, 3000])
def test_bearings_all_around_are_one_turn(count):
    turn = arcs(RNG(6).uniform(0, 2 * np.pi, count), np.full(count, 1 / count))
    # the 10 % of lowest density, which is chance, divide it
    assert max(arc.size for arc in turn) > WHOLE_TURN


def test_regions_apart_are_told_apart_and_the_rest_is_elsewhere():
    rng = RNG(5)
    near = rng.normal([0.0, 0.0], 0.2, (6000, 2))
    mirror = rng.normal([4.0, 0.0], 0.2, (3100, 2))
    far = rng.uniform(-8, 8, (900, 2))
    v, weights = np.concatenate([near, mirror, far]), np.full(10_000, 1e-4)
    one, two, rest = regions(v, weights)
    assert [r.share for r in (one, two, rest)] == pytest.approx(
        [0.6, 0.31, 0.09], abs=0.02
    )
    assert (one.is_place, two.is_place, rest.is_place) == (True, True, False)
    assert one.inside[:6000].mean() > 0.99


def test_a_ridge_is_one_region_and_no_place():
    along = RNG(6).uniform(0, 5, 5000)
    v = np.stack([along, 0.1 * np.sin(along)], 1)
    weights = np.full(5000, 1 / 5000)
    (ridge,) = regions(v, weights)
    assert not ridge.is_place
    assert extent(v, weights) == pytest.approx(4.5, abs=0.2)
