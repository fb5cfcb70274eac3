"""An instrument is its parts: filters, noise, a full scale and bits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import signal

from jblast.scene import Instrument
from jblast.sensors.instrument import (
    chain_block,
    chain_start,
    clipping,
    instrument_chain,
    quantised,
    saturated,
)
from jblast.sensors.samples import BLOCK

SIGNAL = np.array([-np.inf, -1e30, -300.0, -200.0, -1e-3, 0.0, 99.9, 200.0, 1e9])


def written(samples, instrument):
    return quantised(saturated(jnp.asarray(samples), instrument), instrument)


def test_an_instrument_without_a_full_scale_writes_down_anything():
    ideal = Instrument()
    assert written(SIGNAL, ideal).tolist() == SIGNAL.tolist()
    told = clipping(jnp.asarray(SIGNAL), ideal)
    assert (bool(told.clipped), float(told.level)) == (False, np.inf)


@pytest.mark.parametrize("bits", [8, 16, 24, 32])
def test_samples_are_the_nearest_codes_of_their_bits(bits):
    codes = 2 ** (bits - 1)
    expected = np.clip(np.round(SIGNAL / 200.0 * codes), -codes, codes - 1)
    given = written(SIGNAL, Instrument(full_scale=200.0, bits=bits))
    assert np.array_equal(np.asarray(given) / 200.0 * codes, expected)


def test_compression_is_odd_grows_and_stays_within_the_full_scale():
    soft = Instrument(full_scale=200.0, saturation="compress")
    given = np.asarray(written(SIGNAL, soft))
    assert given[[0, 1, -1]].tolist() == [-200.0, -200.0, 200.0]
    assert given[-2] == -given[3] == pytest.approx(200 / 2 ** (1 / 8))
    assert given[-3] == pytest.approx(99.9, rel=5e-4)
    dense = np.linspace(0, 3000, 4000)
    curve = np.asarray(written(dense, soft))
    assert (np.diff(curve) > 0)[:2000].all()
    assert (np.diff(curve) >= 0).all()
    with jax.enable_x64(False):
        single = Instrument(full_scale=200.0, saturation="compress")
        assert written(SIGNAL.astype(np.float32), single) == pytest.approx(given, 1e-6)


def test_slopes_are_those_of_the_curve_and_bits_leave_them():
    inside = jnp.asarray([-150.0, -1e-3, 0.0, 120.0])
    for saturation in ("clip", "compress"):
        of = Instrument(full_scale=200.0, saturation=saturation)
        coarse = Instrument(full_scale=200.0, bits=8, saturation=saturation)
        slope = jax.vmap(jax.grad(lambda x, of=of: written(x, of)))
        slope_of_bits = jax.vmap(jax.grad(lambda x, of=coarse: written(x, of)))
        step = 1e-4
        near = np.asarray(written(inside + step, of) - written(inside - step, of))
        assert slope(inside) == pytest.approx(near / (2 * step), rel=1e-6)
        assert slope_of_bits(inside) == pytest.approx(
            np.asarray(slope(inside)), rel=1e-12
        )
        beyond = jnp.asarray([-1e9, 1e5, jnp.inf])
        assert slope(beyond) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("saturation", ["clip", "compress"])
@pytest.mark.parametrize("bits", [None, 8, 24])
def test_a_record_tells_whether_it_clipped_and_at_what_level(saturation, bits):
    of = Instrument(full_scale=200.0, bits=bits, saturation=saturation)
    quiet, loud = np.zeros((2, 50))
    quiet[7], loud[9] = 190.0, 201.0
    low = np.where(loud > 0, -201.0, 0.0)
    signals = written(np.stack([quiet, loud, low]), of)
    told = clipping(signals, of)
    assert told.clipped.tolist() == [False, True, True]
    assert 0.9 * 200 < float(told.level) <= 200
    # what was there is no less than what is told
    assert float(told.level) <= np.abs(np.asarray(signals[1])).max() * (1 + 1e-12)


RATE = 10_000.0
INPUT = np.cumsum(np.random.default_rng(0).normal(size=3 * BLOCK))


def chained(instrument, samples=INPUT):
    chain = instrument_chain(instrument, jax.random.key(0))

    def step(state, of_block):
        return chain_block(chain, state, *of_block)

    blocks = jnp.asarray(samples).reshape(-1, BLOCK)
    _, out = jax.lax.scan(step, chain_start(chain), (jnp.arange(len(blocks)), blocks))
    return np.asarray(out).reshape(-1)


def test_an_ideal_instrument_writes_what_there_is():
    assert np.array_equal(chained(Instrument(RATE)), INPUT)


def test_filter_noise_full_scale_and_bits_come_in_this_order():
    alone = chained(Instrument(RATE, noise=0.5), np.zeros_like(INPUT))
    assert alone.std() == pytest.approx(0.5, rel=5 / (2 * alone.size) ** 0.5)
    whole = chained(Instrument(RATE, 20.0, 0.5, 8, 50.0, 900.0))
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
        noise = chained(Instrument(RATE, noise=0.5, noise_slope=slope), quiet)
        alike = np.corrcoef(noise[1:], noise[:-1])[0, 1]
        assert alike == pytest.approx(sign * abs(alike), abs=0.05)
        assert (abs(alike) > 0.5) == (slope is not None)
