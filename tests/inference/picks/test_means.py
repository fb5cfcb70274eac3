"""Slopes of means over bins against differences of the means themselves."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference.picks.fit.means import mean_columns, mean_slopes
from jblast.inference.picks.fit.pole import ringing
from jblast.inference.picks.ready.bins import bins_about_front
from jblast.waves.waveform.pulse import Pulse, pulse_mean

BINS = bins_about_front(512)
STEP = 1e-5
"""Squared it is 1e-10, over it rounding is 1e-11; a bin's edge may lie at a kink."""

PULSES = {
    "long": (0.3, 1.0, 2.0, 300.0, 1.2, 0.3, 700.0),
    "within a few samples": (0.31, 1.0, 0.7, 8.0, 0.6, 0.3, 20.0),
    "level behind the front": (-0.2, 0.9, 3.0, 80.0, -0.7, -0.1, 60.0),
    "a decay of nothing": (-0.2, 0.9, 3.0, 80.0, 0.0, 0.2, 60.0),
}


@jax.jit
def _slopes(numbers):
    return mean_slopes(BINS, numbers)


@jax.jit
def _means(numbers):
    def one(x):
        pulse = Pulse(*x, hold_time=jnp.zeros(()))
        return pulse_mean(pulse, BINS.start, BINS.stop)

    return jax.vmap(jax.vmap(one))(numbers)


@pytest.mark.parametrize("numbers", PULSES.values(), ids=PULSES)
def test_slopes_of_means_are_their_differences(numbers):
    at = np.array(numbers)
    moves = STEP * np.maximum(np.abs(at), 0.1) * np.eye(at.size)
    up, down = np.asarray(_means(np.stack([at + moves, at - moves])))
    differences = (up - down) / (2.0 * moves.diagonal())[:, None]
    made = np.asarray(_slopes(jnp.asarray(at)))
    size = np.abs(made).max(axis=1, keepdims=True)
    np.testing.assert_allclose(made / size, differences / size, rtol=0.0, atol=1e-5)


@pytest.mark.parametrize("numbers", PULSES.values(), ids=PULSES)
def test_what_a_peak_and_a_suction_of_one_make_are_the_slopes_by_these(numbers):
    pulse = Pulse(*(jnp.asarray(x) for x in numbers), hold_time=jnp.zeros(()))
    slopes = np.asarray(_slopes(jnp.asarray(numbers)))
    columns = jax.jit(lambda pulse: mean_columns(BINS, pulse))(pulse)
    np.testing.assert_allclose(columns, slopes[[1, 5]], rtol=0, atol=1e-12)


@pytest.mark.slow  # a ring's slopes take long to compile
def test_slopes_of_a_ring_are_its_differences():
    at = np.array([*PULSES["long"], 0.8, 0.05])

    @jax.jit
    def mean(x):
        pulse = Pulse(*x[:7], hold_time=jnp.zeros(()))
        return ringing(BINS, pulse, x[7], x[8]).mean

    made = np.asarray(jax.jit(jax.jacfwd(mean))(jnp.asarray(at)))
    for k in range(at.size):
        move = STEP * max(abs(at[k]), 0.1) * (np.arange(at.size) == k)
        apart = (mean(at + move) - mean(at - move)) / (2.0 * move[k])
        size = np.abs(made[:, k]).max()
        np.testing.assert_allclose(made[:, k] / size, apart / size, atol=1e-5)
