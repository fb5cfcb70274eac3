import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from jblast.sensors.instrument import CHUNK, causal_filter, filter_block, filter_start

RATE = 48e3
NOISE = np.random.default_rng(0).standard_normal(3001)


set_up = jax.jit(causal_filter, static_argnames="rate")
"""The same by one program instead of one an operation; it looks at no corner."""


@jax.jit
def run(filtering, samples):
    return filter_block(filtering, filter_start(filtering), jnp.asarray(samples))[1]


def test_samples_are_those_of_another_implementation():
    both = set_up(RATE, 20.0, 8e3)
    high = butter(2, 20.0, "high", fs=RATE, output="sos")
    low = butter(2, 8e3, "low", fs=RATE, output="sos")
    # poles 1e-3 from the unit circle, two deep: roundings times 1e3 in each
    np.testing.assert_allclose(
        run(both, NOISE), sosfilt(low, sosfilt(high, NOISE)), rtol=0, atol=1e-10
    )


def test_blocks_of_any_length_give_the_same_samples():
    filtering = set_up(RATE, 20.0, 8e3)
    state, parts, one_block = filter_start(filtering), [], jax.jit(filter_block)
    cuts = [0, 1, 2, CHUNK - 1, 2 * CHUNK, 700, 700, 2048, 3001]
    for start, stop in itertools.pairwise(cuts):
        state, part = one_block(filtering, state, NOISE[start:stop])
        parts.append(part)
    # the same sums in another order
    np.testing.assert_allclose(
        np.concatenate(parts), run(filtering, NOISE), rtol=0, atol=1e-12
    )


def test_slopes_by_corner_and_samples_are_those_of_differences():
    pulse = np.exp(-np.arange(400) / 50.0)

    @jax.jit
    def energy(corners, scale):
        filtering = causal_filter(RATE, corners[0], corners[1])
        return jnp.sum(jnp.square(run(filtering, scale * pulse)[::7]))

    at = jnp.array([20.0, 5e3])
    slopes = jax.jit(jax.grad(energy, argnums=(0, 1)))(at, 1.3)
    for i, step in enumerate((1e-3, 1e-1)):
        shift = step * np.eye(2)[i]
        up, down = (energy(at + sign * shift, 1.3) for sign in (1, -1))
        np.testing.assert_allclose(slopes[0][i], (up - down) / (2 * step), rtol=1e-6)
    np.testing.assert_allclose(slopes[1], 2 * energy(at, 1.3) / 1.3, rtol=1e-12)


def test_no_filter_leaves_samples_alone():
    np.testing.assert_array_equal(run(causal_filter(RATE), NOISE), NOISE)


@pytest.mark.parametrize(
    ("corners", "words"),
    [
        ({"high_pass": 0.0}, "high_pass: expected a corner above 0"),
        ({"low_pass": 24e3}, "below half the rate of 48000 Hz, got 24000 Hz"),
        ({"low_pass": np.nan}, "low_pass: expected a corner"),
    ],
)
def test_corners_that_are_none_are_refused(corners, words):
    with pytest.raises(ValueError, match=words):
        causal_filter(RATE, **corners)
