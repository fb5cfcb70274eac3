"""An instrument consists of filters, noise, a full scale and bits, in this order."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import signal

from jblast.scene import Instrument
from jblast.sensors.instrument import clipping_level, instrument_chain, limited
from jblast.sensors.noise import BLOCK

RATE, KEY = 10_000.0, jax.random.key(0)
INPUT = np.cumsum(np.random.default_rng(0).normal(size=3 * BLOCK))


@jax.jit
def chained(instrument, samples=INPUT):
    chain = instrument_chain(instrument, KEY)
    blocks = jnp.asarray(samples).reshape(-1, BLOCK)

    def step(state, block):
        return chain.recorded(state, *block)

    numbers = jnp.arange(len(blocks))
    return jax.lax.scan(step, chain.start(), (numbers, blocks))[1].ravel()


def butterworth(samples, high, low):
    """Return samples filtered by SciPy."""
    for corner, side in ((high, "highpass"), (low, "lowpass")):
        sections = signal.butter(2, corner, side, fs=RATE, output="sos")
        samples = signal.sosfilt(sections, samples)
    return samples


def test_an_ideal_instrument_records_the_signal():
    assert np.array_equal(chained(Instrument(RATE)), INPUT)


def test_filters_are_those_of_another_implementation():
    noise = np.random.default_rng(0).standard_normal(3 * BLOCK)
    filtered = chained(Instrument(RATE, high_pass=4.0, low_pass=1600.0), noise)
    # poles 1e-3 from the unit circle, two deep: roundings times 1e3 in each
    np.testing.assert_allclose(filtered, butterworth(noise, 4.0, 1600.0), atol=1e-10)


def test_slopes_by_corner_and_signal_are_those_of_differences():
    pulse = np.exp(-np.arange(3 * BLOCK) / 50.0)

    @jax.jit
    def energy(corners, scale):
        instrument = Instrument(RATE, high_pass=corners[0], low_pass=corners[1])
        return jnp.sum(jnp.square(chained(instrument, scale * pulse)[::7]))

    at = jnp.array([20.0, 2e3])
    slopes = jax.jit(jax.grad(energy, argnums=(0, 1)))(at, 1.3)
    for i, step in enumerate((1e-3, 1e-1)):
        shift = step * np.eye(2)[i]
        up, down = (energy(at + sign * shift, 1.3) for sign in (1, -1))
        np.testing.assert_allclose(slopes[0][i], (up - down) / (2 * step), rtol=1e-6)
    np.testing.assert_allclose(slopes[1], 2 * energy(at, 1.3) / 1.3, rtol=1e-12)


def test_filter_noise_full_scale_and_bits_come_in_this_order():
    alone = np.asarray(chained(Instrument(RATE, noise=0.5), np.zeros_like(INPUT)))
    assert alone.std() == pytest.approx(0.5, rel=5 / (2 * alone.size) ** 0.5)
    whole = np.asarray(chained(Instrument(RATE, 20.0, 0.5, 8, 50.0, 900.0)))
    heard = butterworth(INPUT, 50.0, 900.0) + alone
    expected = np.clip(np.round(heard / 20.0 * 128), -128, 127) * 20.0 / 128
    # a sample on the edge between two codes may fall to either by rounding
    assert np.mean(whole != expected) < 1e-3
    assert np.abs(whole - expected).max() <= 20.0 / 128 * (1 + 1e-9)


SIGNAL = np.array([-np.inf, -1e30, -300.0, -200.0, -1e-3, 0.0, 99.9, 200.0, 1e9])


@pytest.mark.parametrize("bits", [8, 16, 24, 32])
def test_samples_are_the_nearest_codes_of_their_bits(bits):
    codes = 2 ** (bits - 1)
    expected = np.clip(np.round(SIGNAL / 200.0 * codes), -codes, codes - 1)
    given = limited(jnp.asarray(SIGNAL), Instrument(full_scale=200.0, bits=bits))
    assert np.array_equal(np.asarray(given) / 200.0 * codes, expected)


def test_compression_is_odd_monotonic_and_within_the_full_scale():
    soft = Instrument(full_scale=200.0, saturation="compress")
    given = np.asarray(limited(jnp.asarray(SIGNAL), soft))
    assert given[[0, 1, -1]].tolist() == [-200.0, -200.0, 200.0]
    assert given[-2] == -given[3] == pytest.approx(200 / 2 ** (1 / 8))
    assert given[-3] == pytest.approx(99.9, rel=5e-4)
    curve = np.diff(np.asarray(limited(jnp.linspace(0, 3000, 4000), soft)))
    assert (curve[:2000] > 0).all()
    assert (curve >= 0).all()
    with jax.enable_x64(False):
        single = Instrument(full_scale=200.0, saturation="compress")
        low = limited(jnp.asarray(SIGNAL.astype(np.float32)), single)
    assert np.asarray(low) == pytest.approx(given, 1e-6)


@pytest.mark.parametrize("saturation", ["clip", "compress"])
@pytest.mark.parametrize("bits", [None, 8, 24])
def test_the_clipping_level_separates_clipped_records_from_others(saturation, bits):
    of = Instrument(full_scale=200.0, bits=bits, saturation=saturation)
    quiet, loud = limited(jnp.array([190.0, 201.0]), of)
    # the limit itself is rounded when a sample is written
    assert abs(float(quiet)) < clipping_level(of) * (1 - 1e-6) <= abs(float(loud))
    assert clipping_level(Instrument()) == np.inf
