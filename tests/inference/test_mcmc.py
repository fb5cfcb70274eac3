"""Walkers sample the posterior, and say where they cannot."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference.arviz_file import inference_data, write_inference_data
from jblast.inference.importance import importance, marginals_of_draws
from jblast.inference.mcmc import (
    Start,
    autocorrelation_time,
    convergence,
    ensemble,
    independence_move,
    r_hat,
    walk,
)
from jblast.report.fit.findings import all_words
from tests.catalogue import AROUND, BOTH
from tests.inference.logs import log
from tests.inference.shots import five_solved, shot, solved


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


STARTS = (
    Start(np.zeros(2), np.eye(2), 4.0),
    Start(np.array([3.0, -4.0]), np.array([[0.5, 0.2], [-0.1, 2.0]]), 1.0),
)


def normal_density(w, of):
    u = (w - of.center) @ np.linalg.inv(of.root).T
    return np.exp(-0.5 * np.sum(u**2, axis=-1)) / (2 * np.pi * np.linalg.det(of.root))


def log_mixture(w):
    return np.log(sum(0.2 * of.share * normal_density(w, of) for of in STARTS))


def test_an_independent_move_draws_from_the_mixture_and_knows_its_density():
    move = independence_move(STARTS)
    there, factor = move(np.zeros((20_000, 2)), np.random.RandomState(0))
    expected = log_mixture(np.zeros(2)) - log_mixture(there[:20])
    np.testing.assert_allclose(factor[:20], expected, rtol=1e-10)
    # a fifth of (3, -4); its error by 20,000 draws is at most 0.02
    np.testing.assert_allclose(there.mean(axis=0), [0.6, -0.8], atol=0.08)


class Two(eqx.Module):
    """Two unit normals 8 sd apart along the first axis, one with a third of all."""

    apart: jnp.ndarray

    def log_density(self, w):
        right = -0.5 * (w[0] - self.apart) ** 2
        left = -0.5 * (w[0] + self.apart) ** 2 + jnp.log(0.5)
        return jnp.logaddexp(right, left) - 0.5 * w[1] ** 2


def test_walkers_go_from_mode_to_mode_where_both_are_known():
    # half of the walkers start at each: the moves find that it is a third
    starts = [Start(np.array([x, 0.0]), np.eye(2), 1.0) for x in (-4.0, 4.0)]
    steps = zip(range(1500), walk(Two(jnp.array(4.0)), starts), strict=False)
    chain = np.array([w for _, (w, _) in steps])[200:]
    share = (chain[:, :, 0] < 0).mean(axis=1)
    error = share.std() * np.sqrt(autocorrelation_time(chain[:, :, 0] < 0) / len(share))
    assert share.mean() == pytest.approx(1 / 3, abs=4 * error + 0.01)
    assert error < 0.02


@pytest.mark.slow  # each layout compiles its own search
def test_a_normal_posterior_is_met():
    posterior, normal, told, found = five_solved("gaussian")
    walked = ensemble(posterior, normal, told, found)
    assert walked.converged
    assert 0.2 < walked.acceptance < 0.5
    z = walked.draws()
    sds = np.sqrt(np.diag(normal.covariance))
    # four standard errors, and a tenth of an sd for what is not normal
    error = 4 / np.sqrt(walked.convergence.ess) + 0.1
    assert np.all(np.abs(z.mean(axis=0) - normal.z) < error * sds)
    np.testing.assert_allclose(z.std(axis=0), sds, rtol=0.15)


@pytest.mark.slow
def test_intervals_agree_with_importance_sampling():
    posterior, normal, told, _ = five_solved()
    walked = ensemble(posterior, normal, told)
    weighted = importance(posterior, normal, draws=8000)
    assert weighted.k_hat < 0.7
    one = marginals_of_draws(posterior.parameters, walked.draws())
    other = marginals_of_draws(posterior.parameters, weighted.z, weighted.weights)
    for name in posterior.parameters.names:
        sd = one[name].sd
        for key in ("q05", "q50", "q95"):  # Monte Carlo errors of about 0.04 sd
            assert getattr(one[name], key) == pytest.approx(
                getattr(other[name], key), abs=0.15 * sd
            )


@pytest.mark.slow
def test_a_null_direction_is_refused_by_name():
    free = ("charge_mass_kg", "charge_east_m", "charge_north_m")
    posterior, normal, told, _ = solved(shot([(60.0, 0.0)], BOTH, free))
    with pytest.raises(InputError, match=r"improper along charge_.*expected a prior"):
        ensemble(posterior, normal, told)


@pytest.mark.slow
def test_a_density_that_is_no_number_names_the_observation():
    posterior, normal, told, _ = five_solved()
    measured = posterior.measured.at[3].set(jnp.nan)
    broken = eqx.tree_at(lambda p: p.measured, posterior, measured)
    with pytest.raises(InputError, match=r"got NaN for row 4 \(peak_overpressure_pa\)"):
        ensemble(broken, normal, told)
    with pytest.raises(InputError, match=r"got NaN for m1, pressure"):
        ensemble(broken, normal, told, rows=["", "", "", "m1, pressure"])


@pytest.mark.slow
def test_too_few_walkers_are_refused_and_too_few_steps_are_said():
    posterior, normal, told, _ = five_solved()
    with pytest.raises(InputError, match="at least twice the 4 unknowns, got 6"):
        ensemble(posterior, normal, told, walkers=6)
    short = ensemble(posterior, normal, told, most_steps=60, walkers=8)
    assert not short.converged
    assert "autocorrelation times" in " ".join(all_words(short.findings))


@pytest.mark.slow
def test_draws_come_back_from_the_file(tmp_path):
    pytest.importorskip("arviz", exc_type=ImportError)
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5py")
    posterior, normal, told, _ = five_solved()
    found = ensemble(posterior, normal, told, most_steps=60, walkers=8)
    made = log(
        *(
            (f"m{i}", quantity, 1.0 + i, 0.1, (*place, 1.5))
            for i, place in enumerate(AROUND)
            for quantity, _ in BOTH
        )
    )
    tree = inference_data(found, posterior, made, all_words(found.findings))
    write_inference_data(tree, tmp_path / "posterior.nc")
    with xarray.open_datatree(tmp_path / "posterior.nc", engine="h5netcdf") as back:
        mass = back["posterior"]["charge_mass_kg"]
        assert mass.dims == ("chain", "draw")
        np.testing.assert_allclose(mass, np.exp(found.z[:, :, 0]), rtol=1e-12)
        np.testing.assert_array_equal(back["sample_stats"]["lp"], found.log_density)
        assert list(back["observed_data"]["row"].values[:2]) == [
            "m0 air_arrival_s",
            "m0 peak_overpressure_pa",
        ]
        about = back["posterior"].attrs
        assert about["inference_library"] == "emcee"
        assert about["converged"] == 0
        assert "autocorrelation times" in about["why"]
