import os
import signal

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference.mcmc.engines import Emcee
from jblast.inference.mcmc.run import Start, Store, sample
from tests.inference.mcmc.densities_by_hand import (
    COVARIANCE,
    Nowhere,
    Two,
    Unlike,
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


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_modes_unlike_in_size_are_both_reached_by_going_anew(sampler):
    # a difference of two walkers of the wide mode never hits the narrow one
    wide = Start(np.zeros(2), np.eye(2), 0.5)
    narrow = Start(np.array([8.0, 0.0]), 0.02 * np.eye(2), 0.5)
    found = sample(
        Unlike(jnp.array(0.02)), [wide, narrow], np.eye(2), sampler=sampler, seed=1
    )
    assert found.reached
    inside = drawn(found)[:, 0] > 6
    error = np.sqrt(0.3 * 0.7 / found.convergence.ess[0])
    assert np.mean(inside) == pytest.approx(0.3, abs=4 * error)


def test_the_same_seed_walks_the_same_way_and_another_does_not():
    def walked(seed):
        return sample(gaussian(), start(3), np.eye(3), most_steps=50, seed=seed).chain

    np.testing.assert_array_equal(walked(1), walked(1))
    assert not (walked(1) == walked(2)).all()


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_a_walk_killed_between_files_goes_on_to_the_same_chain(sampler, tmp_path):
    def walked(store, most_steps):
        return sample(
            gaussian(),
            start(3),
            np.eye(3),
            precision=1e-9,
            sampler=sampler,
            store=store,
            most_steps=most_steps,
        )

    whole = walked(None, 500)
    store = Store(tmp_path / "chain")
    walked(store, 230)  # not a multiple of what is kept at a time
    rest = walked(store, 500)
    assert rest.resumed == 230
    np.testing.assert_array_equal(rest.chain, whole.chain)
    np.testing.assert_array_equal(rest.log_density, whole.log_density)
    again = walked(store, 500)  # nothing is left to do
    assert again.resumed == 500
    np.testing.assert_array_equal(again.chain, whole.chain)


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


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_control_c_that_a_destructor_swallows_still_ends_the_walk():
    class Dying:
        def __del__(self):
            os.kill(os.getpid(), signal.SIGINT)

    def press(progress):
        if progress.steps == 37:
            Dying()  # gone at once; what is raised there, Python only prints

    stopped = sample(
        gaussian(), start(3), np.eye(3), precision=1e-9, most_steps=300, report=press
    )
    assert stopped.interrupted
    assert 37 <= len(stopped.chain) <= 100
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_control_c_before_the_first_step_is_passed_on(monkeypatch):
    def pressed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(Emcee, "walk", pressed)
    with pytest.raises(KeyboardInterrupt):
        sample(gaussian(), start(3), np.eye(3))


def test_walkers_that_start_where_there_is_no_density_are_brought_nearer():
    found = sample(Nowhere(jnp.array(0.01)), start(2), np.eye(2), most_steps=20)
    assert np.all(np.sum(found.chain**2, axis=-1) < 0.01)


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


def test_a_damaged_or_missing_file_of_a_chain_is_named(tmp_path):
    store = Store(tmp_path / "chain")
    sample(gaussian(), start(3), np.eye(3), store=store, most_steps=300, precision=1e-9)
    files = sorted(store.folder.glob("steps-*.npz"))
    assert len(files) == 3
    kept = files[1].read_bytes()
    files[1].write_bytes(kept[: len(kept) // 2])
    with pytest.raises(InputError, match=r"steps-00000100.npz: expected a segment"):
        sample(gaussian(), start(3), np.eye(3), store=store)
    files[1].unlink()
    with pytest.raises(InputError, match=r"steps-00000200.npz: .* after step 100"):
        sample(gaussian(), start(3), np.eye(3), store=store)


def test_a_folder_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        sample(gaussian(), start(3), np.eye(3), store=Store(tmp_path / "file" / "x"))
