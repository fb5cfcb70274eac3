"""Records and streams are the same samples, and packets begin when they say."""

import math
from fractions import Fraction
from itertools import islice

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.sensors.samples import (
    BLOCK,
    block_start,
    coloured_noise,
    first_samples,
    noise_block,
    noise_start,
    packets,
    sample_count,
)

RATE = 44_100.0


@pytest.fixture(scope="module")
def noise():
    """Return noise as it is set up, its first state, and a long record of it."""
    noise = coloured_noise(jax.random.key(0), RATE, 2.0, -3.0)
    start = noise_start(noise)
    return noise, start, first_samples(noise_block, noise, start, 9 * BLOCK + 7)


def counted(setup, state, index):
    """Number the samples: what is lost, repeated or swapped shows."""
    return state + BLOCK, state + jnp.arange(BLOCK, dtype=float)


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 3 * BLOCK), st.integers(1, 12))
def test_a_stream_is_the_record_whatever_its_packets(noise, size, taken):
    setup, start, record = noise
    taken = min(taken, record.size // size)
    made = packets(noise_block, setup, start, RATE, packets_hz=RATE / size)
    samples = np.concatenate([[], *(one.samples for one in islice(made, taken))])
    assert np.array_equal(samples, record[: samples.size])
    assert abs(samples.size - taken * size) <= 1  # the float nearest to rate / size


@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from([200.0, 8000.0, 44_100.0, 48_000.0, 12_345.678]),
    st.one_of(st.floats(0.011, 0.3), st.sampled_from([0.02, 0.1, 1 / 30])),
    st.floats(-1e3, 1e6),
)
def test_packets_tell_exactly_which_samples_they_hold_and_when_they_begin(
    rate, packet_s, start_s
):
    if rate * packet_s < 1:
        packet_s = 1.0
    made = packets(
        counted, None, jnp.asarray(0.0), rate, packet_s=packet_s, start_s=start_s
    )
    expected = 0
    for index, one in enumerate(islice(made, 30)):
        assert (one.number, one.first_sample) == (index, expected)
        assert one.samples.tolist() == list(
            range(expected, expected + one.samples.size)
        )
        exact = Fraction(start_s) + one.first_sample / Fraction(repr(rate))
        assert one.start_s == float(exact)
        late = float(one.first_sample / Fraction(repr(rate)) - index * packet_s)
        assert -1e-9 <= late < 1 / rate + 1e-9
        expected += one.samples.size


def test_a_record_ends_where_it_is_asked_to():
    for n in (0, 1, BLOCK - 1, BLOCK, BLOCK + 1):
        samples = first_samples(counted, None, jnp.asarray(0.0), n)
        assert samples.tolist() == list(range(n))
    assert sample_count(1.0, 44_100.0) == 44_100
    for wrong in (-1.0, math.inf, math.nan):
        with pytest.raises(ValueError, match="duration_s: expected a finite time"):
            sample_count(wrong, 100.0)


@pytest.mark.parametrize("rate", [44_100.0, 48_000.0, 200.0, 333.25, 1e6])
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_blocks_start_when_exact_fractions_say(rate, dtype):
    index = np.array([0, 1, 11, 12_345, 2_000_000])
    with jax.enable_x64(dtype == "float64"):
        starts = [block_start(jnp.asarray(i), rate) for i in index.tolist()]
    for i, (whole, rest) in zip(index.tolist(), starts, strict=True):
        exact = i * BLOCK / Fraction(rate)
        error = abs(Fraction(float(whole)) + Fraction(float(rest)) - exact)
        is_exact = rate == int(rate) and rate < 1e6
        # the rest is rounded once; where no whole number counts, the start is
        scale = 1.0 if is_exact else max(1.0, float(exact))
        assert error <= scale * np.finfo(dtype).eps
        assert float(whole) == int(whole)


@pytest.mark.parametrize(
    ("packet", "said"),
    [
        ({}, "either packet_s or packets_hz"),
        ({"packet_s": 0.1, "packets_hz": 10.0}, "either packet_s or packets_hz"),
        ({"packet_s": -0.1}, "packet_s: expected a positive"),
        ({"packet_s": 0.0}, "packet_s: expected a positive"),
        ({"packets_hz": math.inf}, "packets_hz: expected a positive"),
        ({"packets_hz": 201.0}, "one or more samples per packet at 200 Hz, got 201"),
    ],
)
def test_a_packet_that_cannot_be_is_refused_before_the_first(packet, said):
    with pytest.raises(ValueError, match=said):
        packets(counted, None, jnp.asarray(0.0), 200.0, **packet)
