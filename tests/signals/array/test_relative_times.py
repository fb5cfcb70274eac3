"""Delays between microphones: no bias, and errors as large as they are said to be."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.signals import relative_times
from tests.signals.array.simulated import RATE, WINDOW, bound, heard, variance

FAR = 3e-3
TRIES = 200


def delays_of(noise, tries=TRIES, seed=0):
    """Errors of delays, and their sigmas."""
    rng = np.random.default_rng(seed)
    errors, sigmas = [], []
    for _ in range(tries):
        later = rng.uniform(-1e-3, 1e-3, 2)
        times = relative_times(
            heard(rng, later, noise=noise),
            RATE,
            variance(noise, 2),
            FAR,
        )
        errors.append(np.diff(times.time) - np.diff(later))
        # relative to their mean, two times have half the variance of their difference
        sigmas.append(2 * times.covariance[0, 0] ** 0.5)
    return np.array(errors), np.array(sigmas)


def test_the_best_weights_reach_the_bound_of_cramer_and_rao():
    errors, sigmas = delays_of(0.01)
    assert errors.std() == pytest.approx(bound(0.01), rel=0.15)  # 3 sd of 200 tries
    # weights that are measured leave out bins in which the sound is not told from noise
    np.testing.assert_allclose(sigmas, bound(0.01), rtol=0.05)


def test_a_delay_is_no_matter_of_the_samples():
    rng = np.random.default_rng(4)
    for part in (0.0, 0.25, 0.5, 0.77):
        quiet = heard(rng, [0.0, (3 + part) / RATE], noise=1e-7)
        (delay,) = np.diff(relative_times(quiet, RATE, variance(1e-7, 2), FAR).time)
        assert delay * RATE == pytest.approx(3 + part, abs=1e-5)


def test_gains_of_the_microphones_change_nothing():
    rng, later = np.random.default_rng(5), np.array([0.0, 3e-4, -2e-4])
    even = heard(rng, later, noise=0.01)
    noise = np.array([1.0, 20.0, 0.05])
    plain = relative_times(even, RATE, variance(0.01, 3), FAR)
    scaled = relative_times(even * noise[:, None], RATE, variance(0.01 * noise, 3), FAR)
    np.testing.assert_allclose(scaled.time, plain.time, atol=2e-9)
    np.testing.assert_allclose(scaled.covariance, plain.covariance, rtol=1e-3)


def test_a_noisy_microphone_has_a_larger_error_and_the_covariance_knows():
    rng, noise = np.random.default_rng(6), np.array([0.01, 0.01, 0.04, 0.01])
    errors, told = [], []
    for _ in range(TRIES):
        later = rng.uniform(-1e-3, 1e-3, 4)
        times = relative_times(
            heard(rng, later, noise=noise), RATE, variance(noise, 4), FAR
        )
        errors.append(times.time - (later - later.mean()))
        told.append(times.covariance)
        assert abs(times.time.sum()) < 1e-12
    measured, expected = np.cov(np.array(errors).T), np.mean(told, axis=0)
    # Monte Carlo: a variance of 200 is known to 10 %
    np.testing.assert_allclose(np.diag(measured), np.diag(expected), rtol=0.35)
    assert expected[2, 2] > 4 * expected[0, 0]


def test_where_nothing_is_heard_no_delay_is_told():
    rng = np.random.default_rng(7)
    noise = rng.standard_normal((3, WINDOW))
    times = relative_times(noise, RATE, variance(1.0, 3), FAR)
    assert not times.complete
    assert np.isnan(times.time).all()


def test_with_a_dead_microphone_no_time_is_complete():
    rng = np.random.default_rng(8)
    records = heard(rng, [0.0, 1e-4, 2e-4], noise=0.01)
    records[2] = 0.0
    times = relative_times(records, RATE, variance([0.01, 0.01, 0.0], 3), FAR)
    assert not times.complete


@pytest.mark.parametrize(
    ("samples", "said"),
    [
        (np.zeros((1, 64)), "2 to 8 microphones, got 1"),
        (np.zeros((9, 64)), "2 to 8 microphones, got 9"),
        (np.zeros((2, 101)), "even number"),
        (np.full((2, 64), np.nan), "finite samples"),
    ],
)
def test_what_cannot_be_used_is_refused(samples, said):
    count, length = samples.shape
    with pytest.raises(InputError, match=said):
        relative_times(samples, RATE, variance(1.0, count, length), FAR)
