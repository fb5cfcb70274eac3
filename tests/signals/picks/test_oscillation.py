"""Sines and cosines of additions and products alone, against NumPy's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.signals.picks.pulse_means import oscillation, sine_and_cosine


@pytest.mark.parametrize("farthest", [1.0, 1e3, 1e6])
def test_sines_and_cosines_are_numpys_to_two_units_in_the_last_place(farthest):
    phase = np.random.default_rng(0).uniform(-farthest, farthest, 10_000)
    sine, cosine = jax.jit(sine_and_cosine)(jnp.asarray(phase))
    np.testing.assert_allclose(sine, np.sin(phase), rtol=0, atol=5e-16)
    np.testing.assert_allclose(cosine, np.cos(phase), rtol=0, atol=5e-16)


def test_an_oscillation_is_the_exponential_of_a_complex_number():
    elapsed = np.linspace(0.0, 400.0, 300)
    real, imaginary = jax.jit(oscillation)(
        jnp.asarray(-0.02), jnp.asarray(1.3), jnp.asarray(elapsed)
    )
    size = np.exp(-0.02 * elapsed)
    np.testing.assert_allclose(real, size * np.cos(1.3 * elapsed), rtol=0, atol=1e-14)
    np.testing.assert_allclose(
        imaginary, size * np.sin(1.3 * elapsed), rtol=0, atol=1e-14
    )
