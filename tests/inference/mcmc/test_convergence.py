import numpy as np
import pytest

from jblast.inference.mcmc.convergence import autocorrelation_time, convergence, r_hat


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
