"""Noise has the level and the colour that were asked for."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import signal

from jblast.sensors.samples import (
    BLOCK,
    coloured_noise,
    first_samples,
    noise_block,
    noise_start,
    power_spectrum,
)

RATE, LEVEL, BLOCKS = 48_000.0, 0.3, 150
SLOPES = (-6.0, -3.0, 0.0, 3.0, 12.0)


def drawn(slope, dtype=jnp.float64):
    noise = coloured_noise(
        jax.random.key(1), RATE, jnp.asarray(LEVEL, dtype), jnp.asarray(slope, dtype)
    )
    return first_samples(noise_block, noise, noise_start(noise), BLOCKS * BLOCK)


def independent(slope, one):
    """Return how many independent numbers a colour is: of one that falls, those of a
    band of some 20 Hz about the corner alone."""
    return 20 * one.size / RATE if slope < 0 else one.size


@pytest.fixture(scope="module")
def samples():
    return np.asarray(jax.vmap(drawn)(jnp.asarray(SLOPES)))


def test_the_rms_is_the_level(samples):
    for slope, one in zip(SLOPES, samples, strict=True):
        few = independent(slope, one)
        assert np.sqrt(np.mean(one**2)) == pytest.approx(LEVEL, rel=5 / few**0.5)
        assert abs(np.mean(one)) < 0.05 * LEVEL


def test_the_spectrum_falls_by_its_slope_and_holds_the_whole_level(samples):
    density = LEVEL**2 / (RATE / 2)
    for slope, one in zip(SLOPES, samples, strict=True):
        frequency, spectrum = signal.welch(one, RATE, nperseg=BLOCK)
        power = np.trapezoid(spectrum, frequency)
        few = independent(slope, one)
        assert power == pytest.approx(LEVEL**2, rel=7 / few**0.5)
        octaves = np.log2(frequency[4:-4] / 1000.0)
        weight = np.sqrt(frequency[4:-4])  # as many decades as bins
        fitted = np.polyfit(octaves, 10 * np.log10(spectrum[4:-4]), 1, w=1 / weight)[0]
        # 300 half-overlapped segments: 0.3 dB a bin, and Hann's leak where it is steep
        assert fitted == pytest.approx(slope, abs=0.1 if abs(slope) < 10 else 0.4)
        if slope == 0:
            assert spectrum[4:-4] == pytest.approx(density, rel=0.4)


def test_nothing_is_repeated_and_blocks_join_without_a_seam(samples):
    white = samples[SLOPES.index(0.0)]
    blocks = white.reshape(BLOCKS, BLOCK)
    alike = np.corrcoef(blocks) - np.eye(BLOCKS)
    assert np.abs(alike).max() < 6 / BLOCK**0.5
    red = samples[0]
    steps = np.abs(np.diff(red))
    seams = steps[BLOCK - 1 :: BLOCK]
    assert seams.mean() == pytest.approx(steps.mean(), rel=5 / len(seams) ** 0.5)


def test_the_colour_is_flat_to_the_corner_and_doubles_by_the_octave():
    spectrum = power_spectrum(np.array([0.0, 10.0, 20.0, 40.0, 80.0]), -3.0)
    tenths = 10 * np.log10(spectrum)
    assert tenths == pytest.approx([0, 0, 0, -3, -6], abs=1e-12)


def test_the_samples_are_the_level_times_some_noise_and_slope_likewise_down_to_zero():
    @jax.jit
    def last(level, slope):
        noise = coloured_noise(jax.random.key(0), RATE, level, slope)
        return noise_block(noise, noise_start(noise), 0)[1][-1]

    one = last(1.0, -3.0)
    told = jax.jit(jax.value_and_grad(last, (0, 1)))
    values, by_both = zip(*(told(level, -3.0) for level in (0.0, 2.0)), strict=True)
    slopes = [by_level for by_level, _ in by_both]
    assert values == pytest.approx([0.0, 2 * float(one)], rel=1e-12)
    assert slopes == pytest.approx([float(one)] * 2, rel=1e-12)
    slope = by_both[1][1]
    nearby = (last(2.0, -3.0 + 1e-5) - last(2.0, -3.0 - 1e-5)) / 2e-5
    assert float(slope) == pytest.approx(float(nearby), rel=1e-5)
