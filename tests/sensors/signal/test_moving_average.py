import jax.numpy as jnp
import numpy as np
import pytest

from jblast.sensors.instrument import averaged_samples, moving_average


@pytest.mark.parametrize(
    ("rate", "cutoff", "count"),
    [(200.0, 25.0, 5), (44100.0, 25.0, 883), (30.0, 25.0, 1)],
)
def test_an_odd_number_of_samples_is_averaged(rate, cutoff, count):
    assert averaged_samples(rate, cutoff) == count  # 4, 882 and 0.6, made odd


def test_samples_are_the_means_of_those_about_them():
    samples = np.random.default_rng(0).standard_normal(40)
    expected = [samples[max(i - 4, 0) : i + 5].mean() for i in range(40)]
    averaged = moving_average(samples, 400.0)  # 400 / 50 = 8, so 9 samples
    np.testing.assert_allclose(averaged, expected, rtol=0, atol=1e-14)


def test_a_front_is_heard_before_it_comes():
    front = np.repeat([0.0, 1.0], 50)
    averaged = np.asarray(moving_average(front, 400.0))
    assert averaged[45] == 0.0
    assert averaged[46] > 0.1  # four samples early: half a window


def test_three_decibels_are_lost_below_the_cutoff():
    time = np.arange(40_000) / 10e3
    for frequency, gain in ((0.886 * 25.0, 2**-0.5), (50.0, 0.0)):
        tone = jnp.asarray(np.sin(2 * np.pi * frequency * time))
        middle = np.asarray(moving_average(tone, 10e3))[1000:-1000]
        # 201 samples are 0.5 % more than 200
        np.testing.assert_allclose(np.abs(middle).max(), gain, atol=0.01)


def test_a_window_longer_than_the_signal_is_its_mean():
    np.testing.assert_allclose(moving_average(jnp.array([1.0, 2.0, 6.0]), 400.0), 3.0)


def test_a_cutoff_that_is_none_is_refused():
    with pytest.raises(
        ValueError, match="cutoff: expected a positive frequency, got 0 Hz"
    ):
        moving_average(jnp.ones(1), 400.0, 0.0)
