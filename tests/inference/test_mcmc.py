"""Walkers sample the posterior, and say where they cannot."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference.arviz_file import inference_data, write_inference_data
from jblast.inference.mcmc import (
    autocorrelation_time,
    convergence,
    ensemble,
    r_hat,
    walk,
)
from jblast.inference.regions import quantiles
from jblast.report.messages import sentences_of
from tests.inference.test_density import solved


def autoregressive(rho, steps, walkers, seed=0):
    """x_t = rho x_(t-1) + e: its autocorrelation time is (1 + rho) / (1 - rho)."""
    rng = np.random.default_rng(seed)
    x = np.empty((steps, walkers))
    x[0] = rng.standard_normal(walkers)
    for t in range(1, steps):
        x[t] = rho * x[t - 1] + np.sqrt(1 - rho**2) * rng.standard_normal(walkers)
    return x


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_the_autocorrelation_time_of_an_autoregression_is_the_textbook_one(rho):
    # relative error sqrt(2 (2 M + 1) / N) with M = 5 tau: 5 % here
    tau = autocorrelation_time(autoregressive(rho, 4000, 64))
    assert tau == pytest.approx((1 + rho) / (1 - rho), rel=0.1)


def test_walkers_that_never_leave_their_place_count_as_one_draw_each():
    rng = np.random.default_rng(0)
    stuck = rng.standard_normal((1, 64)) * 10 + rng.standard_normal((1000, 64))
    # emcee, which takes each walker's own mean off, says 1
    assert autocorrelation_time(stuck) > 500
    assert autocorrelation_time(np.ones((100, 8))) == np.inf
    assert autocorrelation_time(rng.standard_normal((1, 8)).repeat(9, 0)) == np.inf


def test_the_error_of_a_quantile_is_that_of_repeated_runs():
    # of independent normal draws: sqrt(p (1 - p) / n) / density = 2.11 / sqrt(n)
    judged = convergence(autoregressive(0.0, 500, 64)[:, :, None])
    # the larger of two, each read off about 40 draws between its two shares
    assert judged.error[0] == pytest.approx(2.11 / np.sqrt(judged.steps * 64), rel=0.4)
    runs = [np.quantile(autoregressive(0.8, 500, 64, seed), 0.95) for seed in range(60)]
    told = convergence(autoregressive(0.8, 500, 64)[:, :, None]).error[0]
    assert told == pytest.approx(np.std(runs), rel=0.4)  # sd of 60 runs: to 9 %


def test_r_hat_is_that_of_arviz():
    rng = np.random.default_rng(3)
    x = rng.standard_normal((200, 2)) + np.array([0.0, 0.3])
    # arviz.rhat(x.T, method="rank") of arviz 0.23.4, which splits each chain in two
    assert r_hat(x) == pytest.approx(1.011874448499523, rel=1e-10)


def test_only_a_long_precise_and_even_walk_has_reached_its_end():
    x = autoregressive(0.5, 1000, 64)[:, :, None]
    judged = convergence(x)
    assert judged.reached(0.05)
    assert not judged.reached(0.001)
    assert not convergence(x[:80]).reached(10.0)  # not 50 autocorrelation times
    assert judged.steps + judged.warm_up == 1000
    assert judged.steps_wanted(0.001) > 10_000
    assert convergence(x[:1]).ess[0] == 0


class Two:
    """Two unit normals 8 sd apart along the first axis, one with a third of all."""

    coordinates: Any = SimpleNamespace(size=2)

    def exact(self, u, rng):
        """Return ln of the density, its noise, and the numbers."""
        right, left = (-0.5 * (u[:, 0] - x) ** 2 for x in (4.0, -4.0))
        height = np.logaddexp(right, left + np.log(0.5)) - 0.5 * u[:, 1] ** 2
        # an unbiased estimate of the density, as that of a log
        return height, 0.2 * rng.standard_normal(len(u)) - 0.02, u, np.ones(len(u))


def test_walkers_go_from_mode_to_mode_where_both_are_known():
    # half of the draws are about each: the walkers find that it is a third
    rng = np.random.default_rng(0)
    places = rng.standard_normal((400, 2)) + np.repeat([[4.0, 0], [-4.0, 0]], 200, 0)
    draws: Any = SimpleNamespace(
        u=places,
        weights=np.full(400, 1 / 400),
        resampled=lambda count, seed: rng.integers(400, size=count),
    )
    density: Any = Two()
    steps = zip(range(1500), walk(density, draws), strict=False)
    chain = np.array([u for _, (u, *_) in steps])[200:]
    share = (chain[:, :, 0] < 0).mean(axis=1)
    error = share.std() * np.sqrt(autocorrelation_time(chain[:, :, 0] < 0) / len(share))
    assert share.mean() == pytest.approx(1 / 3, abs=4 * error + 0.01)
    assert error < 0.02


@pytest.mark.slow  # a walk
def test_quantiles_agree_with_those_of_weighted_draws():
    found, draws = solved()
    walked = ensemble(found, draws)
    assert walked.converged
    assert 0.1 < walked.acceptance < 0.6
    again = walked.as_draws(draws)
    for i in range(4):
        ends, others = (quantiles(d.values[:, i], d.weights) for d in (again, draws))
        wide = (others[2] - others[0]) / 3.29
        # some thousand effective draws of each
        np.testing.assert_allclose(ends, others, atol=0.2 * wide)


def test_arguments_out_of_range_are_refused():
    found, draws = solved()
    with pytest.raises(InputError, match="expected an even number, got 7"):
        ensemble(found, draws, walkers=7)
    with pytest.raises(InputError, match="positive precision"):
        ensemble(found, draws, precision=0.0)


def test_draws_of_a_short_walk_come_back_from_the_file(tmp_path):
    pytest.importorskip("arviz", exc_type=ImportError)
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5py")
    found, draws = solved()
    walked = ensemble(found, draws, most_steps=60, walkers=8)
    assert not walked.converged
    sentences = sentences_of(walked.notes)
    assert "autocorrelation times" in " ".join(sentences)
    tree = inference_data(walked, found.observations, sentences)
    write_inference_data(tree, tmp_path / "posterior.nc")
    with xarray.open_datatree(tmp_path / "posterior.nc", engine="h5netcdf") as back:
        mass = back["posterior"]["charge_mass_kg"]
        assert mass.dims == ("chain", "draw")
        column = walked.names.index("charge_mass_kg")
        np.testing.assert_allclose(mass, walked.values[:, :, column], rtol=1e-12)
        np.testing.assert_array_equal(back["sample_stats"]["lp"], walked.log_density)
        assert list(back["observed_data"]["row"].values[:2]) == [
            "m0 air_arrival_s",
            "m0 peak_overpressure_pa",
        ]
        about = back["posterior"].attrs
        assert about["inference_library"] == "emcee"
        assert about["converged"] == 0
        assert "autocorrelation times" in about["why"]
