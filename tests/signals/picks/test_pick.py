"""The pick of a record: exact without noise, and as sure as repetitions say."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.signals.picks import pick
from tests.signals.picks.simulated import (
    RATE,
    SAMPLES,
    TIME,
    Truth,
    noisy,
)

pytestmark = pytest.mark.slow  # a program of picks to compile
TRUTH = Truth()
MANY = 32
VALUES = {
    "air_arrival_s": TRUTH.arrival,
    "peak_overpressure_pa": TRUTH.peak,
    "positive_duration_s": TRUTH.duration,
    "positive_impulse_pa_s": TRUTH.impulse,
    "rise_time_s": TRUTH.rise,
    "decay": TRUTH.decay,
    "negative_pressure_pa": TRUTH.suction,
    "negative_duration_s": TRUTH.suction_duration,
}


@pytest.fixture(scope="module")
def repeated():
    """Picks of one pulse under noise of 1 % of its peak, again and again."""
    return pick(TIME, noisy(TRUTH, 0.01 * TRUTH.peak, MANY))


@pytest.fixture(scope="module")
def exact():
    """The pick of the same without noise."""
    return pick(TIME, noisy(TRUTH, 0.0, MANY))


@pytest.mark.parametrize("name", VALUES)
def test_without_noise_the_truth_comes_back(name, exact):
    # means of 64 instants are off by 1e-4 of what changes within a sample
    np.testing.assert_allclose(getattr(exact, name)[0], VALUES[name], rtol=1e-3)
    assert bool(exact.found.all())


def test_a_record_alone_is_picked_as_among_others_and_none_as_none(repeated):
    records = noisy(TRUTH, 0.01 * TRUTH.peak, MANY)
    alone, none = pick(TIME, records[:1]), pick(TIME, records[:0])
    np.testing.assert_array_equal(alone.covariance, repeated.covariance[:1])
    np.testing.assert_array_equal(alone.air_arrival_s, repeated.air_arrival_s[:1])
    assert none.covariance.shape == (0, 4, 4)


@pytest.mark.parametrize("name", VALUES)
def test_errors_are_as_large_as_repetitions_say(name, repeated):
    apart = (getattr(repeated, name) - VALUES[name]) / repeated.sd(name)
    # 32 repetitions: the mean of one to 0.18, their standard deviation to 0.13
    assert abs(float(jnp.mean(apart))) < 4 * 0.18
    assert 0.55 < float(jnp.std(apart)) < 1.5


def test_the_covariance_is_that_of_repetitions(repeated):
    of_record = jnp.stack(
        [
            repeated.air_arrival_s,
            jnp.log(repeated.peak_overpressure_pa),
            jnp.log(repeated.positive_duration_s),
            jnp.log(repeated.positive_impulse_pa_s),
        ]
    )
    seen = np.corrcoef(np.asarray(of_record))
    mean = np.asarray(repeated.covariance).mean(axis=0)
    sd = np.sqrt(np.diag(mean))
    # a correlation of 32 pairs has a standard error of 0.18 at most
    np.testing.assert_allclose(mean / np.outer(sd, sd), seen, atol=4 * 0.18)


@pytest.mark.xfail(reason="the slopes of 2 in 32 samples disagree; why is not known")
def test_slopes_by_the_samples_are_those_of_differences():
    samples = jnp.asarray(noisy(TRUTH, 0.01 * TRUTH.peak, MANY))
    way = np.random.default_rng(1).standard_normal(samples.shape)

    def values(samples):
        found = pick(TIME, samples)
        return jnp.log(found.positive_impulse_pa_s), found.air_arrival_s * RATE

    _, slopes = jax.jvp(values, (samples,), (jnp.asarray(way),))
    step = 3.0  # Pa, of noise of 300: the search ends within 1e-4 sd of the optimum
    ahead, behind = values(samples + step * way), values(samples - step * way)
    for slope, plus, minus in zip(slopes, ahead, behind, strict=True):
        numeric = (plus - minus) / (2 * step)
        # a front at the edge of a sample is a kink, beside which a search may end
        np.testing.assert_allclose(slope, numeric, atol=0.04 * float(jnp.std(numeric)))


def test_in_noise_alone_and_in_nothing_nothing_is_found():
    noise = np.random.default_rng(2).standard_normal((MANY, SAMPLES))
    noise[0] = 0.0
    noise[1] = 101325.0
    found = pick(TIME, noise)
    assert int(found.found.sum()) == 0
    assert np.isnan(np.asarray(found.air_arrival_s)).all()


def test_a_faint_pulse_is_not_told_three_times_as_long_with_its_suction():
    found = pick(TIME, noisy(TRUTH, 0.25 * TRUTH.peak, MANY))
    off = np.log(np.asarray(found.positive_duration_s) / TRUTH.duration)
    # four standard deviations: once in 500 of 32 records
    assert np.all(np.abs(off) < 4.0 * np.asarray(found.spread[:, 2]))
    assert np.median(np.abs(off)) < 0.2


def test_a_slow_wave_of_the_baseline_is_told(repeated):
    wave = 0.1 * TRUTH.peak * np.sin(2 * np.pi * TIME / (5 * TRUTH.duration))
    found = pick(TIME, noisy(TRUTH, 0.01 * TRUTH.peak, MANY) + wave)
    assert np.mean(np.asarray(found.curving)) > 0.8
    assert not np.any(np.asarray(repeated.curving))
