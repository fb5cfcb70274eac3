"""What stands at a recorder's limit is what all other samples make likeliest."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference.tuning.sound import filled, filling, padded_places

COUNT = 96
CLIPPED = np.isin(np.arange(COUNT), [20, 21, 22, 23, 24, 40, 41, 70])


@pytest.fixture(scope="module")
def noise():
    """Noise of a red spectrum, and its inverse covariance as a dense matrix."""
    sd = 1.0 / np.sqrt(1.0 + np.arange(COUNT // 2 + 1.0))
    kernel = np.fft.irfft(sd**-2.0, COUNT)
    gaps = np.subtract.outer(np.arange(COUNT), np.arange(COUNT)) % COUNT
    return jnp.asarray(sd), kernel[gaps]


@pytest.fixture(scope="module")
def left():
    return np.random.default_rng(0).normal(size=COUNT)


def test_it_is_the_mean_of_a_normal_given_the_others(noise, left):
    sd, inverse = noise
    places = jnp.asarray(padded_places(CLIPPED))
    found = filled(jnp.asarray(left), places, sd, filling(places, sd, COUNT))
    covariance = np.linalg.inv(inverse)
    across = covariance[np.ix_(CLIPPED, ~CLIPPED)]
    own = covariance[np.ix_(~CLIPPED, ~CLIPPED)]
    expected = across @ np.linalg.solve(own, left[~CLIPPED])
    np.testing.assert_allclose(found[CLIPPED], expected, atol=1e-10)
    np.testing.assert_array_equal(found[~CLIPPED], left[~CLIPPED])


def test_its_squares_are_those_of_the_others_alone(noise, left):
    sd, inverse = noise
    places = jnp.asarray(padded_places(CLIPPED))
    held = filling(places, sd, COUNT)
    own = np.linalg.inv(inverse)[np.ix_(~CLIPPED, ~CLIPPED)]
    alone = np.linalg.inv(own)

    def squares(left):
        found = filled(left, places, sd, held)
        return found @ jnp.asarray(inverse) @ found

    of = jnp.asarray(left)
    expected = left[~CLIPPED] @ alone @ left[~CLIPPED]
    np.testing.assert_allclose(squares(of), expected, rtol=1e-10)
    # so a sample at the limit says nothing of what is looked for, and others all
    slopes = np.asarray(jax.grad(squares)(of))
    np.testing.assert_allclose(slopes[CLIPPED], 0.0, atol=1e-12)
    np.testing.assert_allclose(
        slopes[~CLIPPED], 2.0 * alone @ left[~CLIPPED], rtol=1e-9
    )
