import equinox as eqx
import numpy as np
import pytest

from jblast.inference.importance import Importance
from jblast.inference.mcmc.engines import Emcee, Scan
from jblast.inference.mode.laplace import Laplace
from jblast.verification.benchmark.fits import (
    WALKERS,
    interval_ends,
    sampler_points,
    solved,
    timed_walk,
    weighted_ends,
)

STEPS, DRAWS = (100, 600), (500, 8000)


class Round(eqx.Module):
    """A unit normal."""

    def log_density(self, w):
        return -0.5 * w @ w


@pytest.fixture(scope="module")
def points():
    return sampler_points(STEPS, DRAWS, 3000, 2)


def errors(points, name):
    return [point.error for point in points if point.method.startswith(name)]


def test_a_walk_is_without_its_warm_up_and_follows_its_seed():
    chain, seconds = timed_walk(Emcee(), Round(), 4, 50)
    assert chain.shape == (45, WALKERS, 4)
    assert seconds > 0
    again, _ = timed_walk(Emcee(), Round(), 4, 50)
    other, _ = timed_walk(Emcee(), Round(), 4, 50, seed=1)
    np.testing.assert_array_equal(chain, again)
    assert not np.any(chain[-1] == other[-1])


def test_ends_are_quantiles_of_each_unknown():
    draws = np.stack([np.arange(101.0), -np.arange(101.0)], axis=1)
    np.testing.assert_allclose(interval_ends(draws), [[5, -95], [95, -5]])
    np.testing.assert_allclose(interval_ends(draws[:, None, :]), [[5, -95], [95, -5]])


def test_weighted_ends_of_equal_weights_are_quantiles_from_the_optimum():
    normal = Laplace(np.array([3.0, 10.0, -5.0, 1.5]), np.eye(4), 0.0, True)
    z = normal.z + np.random.default_rng(0).standard_normal((1001, 4))
    found = Importance(z, np.full(1001, 1 / 1001), 0.0, 1001.0)
    expected = interval_ends(z - normal.z)
    np.testing.assert_allclose(weighted_ends(found, normal), expected, atol=1e-9)


@pytest.mark.slow
def test_longer_walks_and_more_draws_have_smaller_errors(points):
    for name in ("emcee", "one scan", "importance"):
        short, long = errors(points, name)[:2]
        assert long < short, name


@pytest.mark.slow
def test_the_normal_approximation_is_the_worst_and_the_cheapest(points):
    (laplace,) = (point for point in points if point.method == "Laplace")
    others = [point for point in points if point is not laplace]
    assert laplace.error > max(point.error for point in others)
    assert laplace.cost_s < min(point.cost_s for point in others)


@pytest.mark.slow
def test_the_reference_is_the_longest_walk_and_no_error_is_below_its_own(points):
    (reference,) = (point for point in points if point.is_reference)
    assert reference.method == "one scan, 3,000 steps"
    assert min(point.error for point in points) == reference.error


@pytest.mark.slow
def test_the_scan_and_emcee_agree():
    what = solved()
    axes = np.asarray(what.density.root)
    sd = np.sqrt(np.diag(what.normal.covariance))
    ends = [
        interval_ends(timed_walk(sampler, what.density, 4, 1500)[0] @ axes.T)
        for sampler in (Emcee(), Scan())
    ]
    # 1,350 x 256 / 11 independent draws: 0.012 sd an end, sqrt(2) for two, five sigma
    assert np.max(np.abs(ends[0] - ends[1]) / sd) < 0.1
