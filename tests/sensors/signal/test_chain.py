"""An instrument is its parts, one after the other."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import signal

from jblast.scene import Instrument
from jblast.sensors.instrument import chain_block, chain_start, instrument_chain
from jblast.sensors.samples import BLOCK

RATE = 10_000.0
INPUT = np.cumsum(np.random.default_rng(0).normal(size=3 * BLOCK))


def written(instrument, samples=INPUT):
    chain = instrument_chain(instrument, jax.random.key(0))

    def step(state, of_block):
        return chain_block(chain, state, *of_block)

    blocks = jnp.asarray(samples).reshape(-1, BLOCK)
    _, out = jax.lax.scan(step, chain_start(chain), (jnp.arange(len(blocks)), blocks))
    return np.asarray(out).reshape(-1)


def test_an_ideal_instrument_writes_what_there_is():
    assert np.array_equal(written(Instrument(RATE)), INPUT)


def test_filter_noise_full_scale_and_bits_come_in_this_order():
    alone = written(Instrument(RATE, noise=0.5), np.zeros_like(INPUT))
    assert alone.std() == pytest.approx(0.5, rel=5 / (2 * alone.size) ** 0.5)
    whole = written(Instrument(RATE, 20.0, 0.5, 8, 50.0, 900.0))
    high = signal.butter(2, 50.0, "highpass", fs=RATE, output="sos")
    low = signal.butter(2, 900.0, "lowpass", fs=RATE, output="sos")
    heard = signal.sosfilt(low, signal.sosfilt(high, INPUT)) + alone
    expected = np.clip(np.round(heard / 20.0 * 128), -128, 127) * 20.0 / 128
    # a sample on the edge between two codes may fall to either by rounding
    assert np.mean(whole != expected) < 1e-3
    assert np.abs(whole - expected).max() <= 20.0 / 128 * (1 + 1e-9)


def test_noise_without_a_slope_is_white_and_with_one_has_a_colour():
    quiet = np.zeros_like(INPUT)
    for slope, sign in ((None, 0.0), (-6.0, 1.0), (6.0, -1.0)):
        noise = written(Instrument(RATE, noise=0.5, noise_slope=slope), quiet)
        alike = np.corrcoef(noise[1:], noise[:-1])[0, 1]
        assert alike == pytest.approx(sign * abs(alike), abs=0.05)
        assert (abs(alike) > 0.5) == (slope is not None)
