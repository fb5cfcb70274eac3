"""Noise has the level and the colour that were requested."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import signal

from jblast.sensors.noise import BLOCK, coloured_noise

RATE, LEVEL, BLOCKS = 48_000.0, 0.3, 150
SLOPES = (-6.0, -3.0, 0.0, 3.0, 12.0)


def independent(slope, one):
    """Return the number of independent samples: of a falling colour, those of a band
    of some 20 Hz about the corner alone."""
    return 20 * one.size / RATE if slope < 0 else one.size


@pytest.fixture(scope="module")
def samples():
    def drawn(slope):
        noise = coloured_noise(jax.random.key(1), RATE, jnp.asarray(LEVEL), slope)
        return jax.lax.scan(noise.drawn, noise.start(), jnp.arange(BLOCKS))[1].ravel()

    return np.asarray(jax.vmap(drawn)(jnp.asarray(SLOPES)))


def test_the_rms_is_the_level_and_the_spectrum_has_the_slope(samples):
    for slope, one in zip(SLOPES, samples, strict=True):
        few = independent(slope, one)
        assert np.sqrt(np.mean(one**2)) == pytest.approx(LEVEL, rel=5 / few**0.5)
        assert abs(np.mean(one)) < 0.05 * LEVEL
        frequency, spectrum = signal.welch(one, RATE, nperseg=BLOCK)
        octaves = np.log2(frequency[4:-4] / 1000.0)
        weight = np.sqrt(frequency[4:-4])  # as many decades as bins
        fitted = np.polyfit(octaves, 10 * np.log10(spectrum[4:-4]), 1, w=1 / weight)[0]
        # 300 half-overlapped segments: 0.3 dB a bin, and Hann's leak where it is steep
        assert fitted == pytest.approx(slope, abs=0.1 if abs(slope) < 10 else 0.4)


def test_no_block_repeats_and_blocks_join_without_a_seam(samples):
    blocks = samples[SLOPES.index(0.0)].reshape(BLOCKS, BLOCK)
    alike = np.corrcoef(blocks) - np.eye(BLOCKS)
    assert np.abs(alike).max() < 6 / BLOCK**0.5
    steps = np.abs(np.diff(samples[0]))
    seams = steps[BLOCK - 1 :: BLOCK]
    assert seams.mean() == pytest.approx(steps.mean(), rel=5 / len(seams) ** 0.5)


def test_samples_are_linear_in_the_level_and_differentiable_in_the_slope():
    @jax.jit
    def last(level, slope):
        noise = coloured_noise(jax.random.key(0), RATE, level, slope)
        return noise.drawn(noise.start(), 0)[1][-1]

    told = jax.jit(jax.value_and_grad(last, (0, 1)))
    (none, (at_none, _)), (two, (at_two, slope)) = told(0.0, -3.0), told(2.0, -3.0)
    assert float(none) == 0.0
    assert [float(at_none), float(at_two)] == pytest.approx([float(two) / 2] * 2)
    nearby = (last(2.0, -3.0 + 1e-5) - last(2.0, -3.0 - 1e-5)) / 2e-5
    assert float(slope) == pytest.approx(float(nearby), rel=1e-5)
