import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference.mcmc.run import Start, Store, sample
from tests.inference.mcmc.densities_by_hand import (
    COVARIANCE,
    Nowhere,
    Two,
    banana,
    gaussian,
)

pytestmark = pytest.mark.slow  # each problem compiles a program of its own

SAMPLERS = ("emcee", "scan")


def start(free):
    return [Start(np.zeros(free), np.eye(free), 1.0)]


def drawn(found):
    return found.chain[found.convergence.warm_up :].reshape(-1, found.chain.shape[-1])


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_the_moments_of_a_normal_are_met_within_monte_carlo_error(sampler):
    found = sample(gaussian(), start(3), np.eye(3), sampler=sampler, seed=2)
    assert found.reached
    w, ess = drawn(found), found.convergence.ess
    sd = np.sqrt(np.diag(COVARIANCE))
    # four standard errors; a variance has relative error sqrt(2 / ess)
    assert np.all(np.abs(w.mean(axis=0)) < 4 * sd / np.sqrt(ess))
    scatter = np.sqrt(2 / ess.min())
    np.testing.assert_allclose(
        np.cov(w.T), COVARIANCE, atol=4 * scatter * np.outer(sd, sd).max() / 2
    )
    quantile = np.quantile(w, 0.95, axis=0) / sd
    assert np.all(np.abs(quantile - 1.6449) < 4 * found.convergence.error)


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_the_moments_of_a_banana_are_met_within_monte_carlo_error(sampler):
    found = sample(banana(), start(2), np.eye(2), sampler=sampler, seed=2)
    assert found.reached
    w, ess = drawn(found), found.convergence.ess
    mean, variance = np.array([0.0, 0.5]), np.array([1.0, 1.5])
    assert np.all(np.abs(w.mean(axis=0) - mean) < 4 * np.sqrt(variance / ess))
    # y tells the size of x: cov(y, x^2) = 1, to about 3 / sqrt(ess)
    bent = np.mean((w[:, 1] - 0.5) * w[:, 0] ** 2)
    assert bent == pytest.approx(1.0, abs=4 * 3 / np.sqrt(ess[1]))


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_jumps_carry_walkers_from_mode_to_mode(sampler):
    both = [
        Start(np.array([4.0, 0.0]), np.eye(2), 0.5),
        Start(np.array([-4.0, 0.0]), np.eye(2), 0.5),
    ]
    found = sample(
        Two(jnp.array(4.0)), both, np.eye(2), sampler=sampler, most_steps=1500
    )
    right = drawn(found)[:, 0] > 0
    # two thirds, though half of the walkers started there
    error = np.sqrt(2 / 9 / found.convergence.ess[0])
    assert np.mean(right) == pytest.approx(2 / 3, abs=4 * error)


def test_control_c_keeps_what_is_sampled_and_the_rest_follows(tmp_path):
    def walked(store, report=lambda _: None):
        return sample(
            gaussian(),
            start(3),
            np.eye(3),
            precision=1e-9,
            store=store,
            most_steps=300,
            report=report,
        )

    def press(progress):
        if progress.steps == 137:
            raise KeyboardInterrupt

    store = Store(tmp_path / "chain")
    stopped = walked(store, press)
    assert stopped.interrupted
    assert not stopped.reached
    assert len(stopped.chain) == 137
    np.testing.assert_array_equal(walked(store).chain, walked(None).chain)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"walkers": 4}, "at least twice the 3 unknowns, got 4"),
        ({"walkers": 9}, "expected an even number"),
        ({"precision": 0.0}, "precision: expected a positive number"),
        ({"most_steps": 0}, "most_steps: expected at least 1"),
        ({"sampler": "nuts"}, "sampler: expected emcee or scan, got 'nuts'"),
    ],
)
def test_numbers_that_make_no_sense_are_refused(asked, message):
    # past the annotations, as a caller without them would come
    wanted = getattr(sample, "__wrapped__", sample)
    with pytest.raises(InputError, match=message):
        wanted(gaussian(), start(3), np.eye(3), **asked)


def test_a_density_that_is_nowhere_is_refused():
    with pytest.raises(InputError, match="zero or NaN at the optimum"):
        sample(Nowhere(jnp.array(-1.0)), start(2), np.eye(2))


def test_a_chain_of_something_else_is_refused(tmp_path):
    store = Store(tmp_path / "chain")
    sample(gaussian(), start(3), np.eye(3), store=store, most_steps=20)
    with pytest.raises(InputError, match="chain of walkers 32, got one of 64"):
        sample(gaussian(), start(3), np.eye(3), store=store, walkers=32)
    with pytest.raises(InputError, match="chain of sampler scan, got one of emcee"):
        sample(gaussian(), start(3), np.eye(3), store=store, sampler="scan")
    with pytest.raises(InputError, match="expected a chain of this log and scene"):
        sample(banana(), start(2), np.eye(2), store=store)
    other = type(gaussian())(jnp.eye(3))
    with pytest.raises(InputError, match="its densities differ"):
        sample(other, start(3), np.eye(3), store=store)
