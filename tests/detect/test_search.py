"""Channels searched at once, and block by block."""

import numpy as np
import pytest

from jblast.detect.search import Channel, search, search_as_stream

RATE = 8000.0
TEMPLATE = np.hanning(80)


@pytest.fixture(scope="module")
def channel():
    samples = np.random.default_rng(0).standard_normal(24_000)
    samples[12_345 : 12_345 + 80] += 5 * TEMPLATE
    return Channel("gate", "gate.wav", 1, samples, RATE)


def test_a_stream_has_the_outputs_of_the_whole(channel):
    whole = search(channel, TEMPLATE)
    # shorter than ten seconds: the noise is that of all of it, in both
    streamed = search_as_stream(channel, TEMPLATE, block_s=0.0371)
    known = streamed.statistic.size
    assert known == channel.samples.size - whole.kernel.reach
    np.testing.assert_allclose(streamed.statistic, whole.statistic[:known], atol=1e-9)
    np.testing.assert_allclose(streamed.detections, whole.detections, rtol=1e-9)
    assert whole.detections[0].time_s == pytest.approx(12_345 / RATE, abs=2e-4)
    assert streamed.latency_s > whole.latency_s


def test_how_much_was_taken_in_is_told(channel):
    told = []
    search_as_stream(channel, TEMPLATE, block_s=1.0, pushed=told.append)
    assert told == [8000, 16_000, 24_000]
