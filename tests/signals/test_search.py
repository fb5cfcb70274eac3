"""Channels searched at once, and block by block."""

import numpy as np
import pytest

from jblast.signals.search import OTHER_FRONT, Channel, search, search_as_stream
from jblast.signals.templates import blast_templates

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


def test_a_loud_blast_of_another_front_is_within_its_error():
    """From a quarter of the distance, or clipped: the bound alone is 2e-8 s here."""
    rate, at, rng = 48_000.0, 9000, np.random.default_rng(4)
    template, near = blast_templates([5.0, 5.0], [100.0, 25.0], rate)
    clipped = np.minimum(template, 0.4 * template.max())
    for blast in (template, near, clipped):
        samples = 1e-4 * rng.standard_normal(24_000)
        samples[at : at + blast.size] += blast / blast.max()
        channel = Channel("gate", "gate.wav", 1, samples, rate)
        found = search(channel, template, front_samples=OTHER_FRONT).detections
        (loudest,) = [one for one in found if one.snr_db > 40]
        assert 0.4 / rate < loudest.sigma_s < 0.6 / rate
        assert abs(loudest.time_s - at / rate) < 2 * loudest.sigma_s
