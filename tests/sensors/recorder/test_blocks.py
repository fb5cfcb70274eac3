"""Blocks of records begin at exact times; noise has its level and colour."""

import math
from fractions import Fraction
from itertools import islice

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import signal

from jblast.errors import InputError
from jblast.scene import Instrument
from jblast.sensors.instrument import instrument_chain
from jblast.sensors.noise import BLOCK, coloured_noise
from jblast.sensors.recorder import Recorder, Source, block_start

KEY = jax.random.key(0)


class Counted(Source):
    """Numbers of the samples: lost, repeated or swapped ones show."""

    def start(self):
        return jnp.zeros(())

    def block(self, state, block):
        return state + BLOCK, state + jnp.arange(BLOCK, dtype=float)


class Late(Source):
    """Ones in the second block."""

    def span(self, rate):
        return 1.5 * BLOCK / rate, 1.6 * BLOCK / rate

    def block(self, state, block):
        return state, jnp.where(block.number == 1, 1e6, 0.0) * jnp.ones(BLOCK)


def recorder(*sources, rate=200.0):
    chain = instrument_chain(Instrument(rate=rate), KEY)
    return Recorder(sources, (chain,), jnp.zeros(()), rate)


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from([200.0, 8000.0, 44_100.0, 48_000.0, 12_345.678]),
    st.one_of(st.floats(3.0, 90.0), st.sampled_from([50.0, 10.0, 30.0])),
)
def test_packets_hold_consecutive_samples_and_begin_in_time(rate, packets_hz):
    expected = 0
    for index, samples in enumerate(
        islice(recorder(Counted(), rate=rate).packets(packets_hz), 30)
    ):
        late = float(expected / Fraction(rate) - index / Fraction(packets_hz))
        assert -1e-9 <= late < 1 / rate + 1e-9
        np.testing.assert_array_equal(samples, expected + np.arange(len(samples)))
        expected += len(samples)


def test_a_record_has_the_samples_of_its_duration():
    made = recorder(Counted())
    for n in (0, 1, BLOCK - 1, BLOCK, BLOCK + 1):
        np.testing.assert_array_equal(made.samples(n / 200.0), np.arange(n))
    for wrong in (-1.0, math.inf, math.nan):
        with pytest.raises(InputError, match="duration_s: expected a finite time"):
            made.samples(wrong)


@pytest.mark.parametrize("packets_hz", [-10.0, 0.0, math.inf, math.nan, 201.0])
def test_a_packet_without_samples_is_rejected_before_the_first(packets_hz):
    with pytest.raises(InputError, match="at most 200 packets per second"):
        recorder(Counted()).packets(packets_hz)


def test_a_source_is_heard_within_its_span_only_and_others_are_not_affected():
    made = recorder(Counted(), Late())
    samples = np.concatenate(list(islice(made.packets(50.0), 4 * BLOCK // 4)))
    late = np.zeros(4 * BLOCK)
    late[BLOCK : 2 * BLOCK] = 1e6
    np.testing.assert_array_equal(samples, np.arange(4 * BLOCK) + late)
    np.testing.assert_array_equal(made.samples(4 * BLOCK / 200.0), samples)


@pytest.mark.parametrize("rate", [44_100.0, 48_000.0, 200.0, 333.25, 1e6])
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_blocks_begin_at_exact_fractions(rate, dtype):
    index = (0, 1, 11, 12_345, 2_000_000)
    with jax.enable_x64(dtype == "float64"):
        starts = [block_start(jnp.asarray(i), rate) for i in index]
    for i, (whole, rest) in zip(index, starts, strict=True):
        exact = i * BLOCK / Fraction(rate)
        error = abs(Fraction(float(whole)) + Fraction(float(rest)) - exact)
        is_exact = rate == int(rate) and rate < 1e6
        # the rest is rounded once; where no whole number counts, the start is
        scale = 1.0 if is_exact else max(1.0, float(exact))
        assert error <= scale * np.finfo(dtype).eps
        assert float(whole) == int(whole)


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
