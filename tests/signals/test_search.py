"""Pulses of blasts, and a bank of them."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.signals.search import (
    BANK_SCALED_DISTANCE,
    DURATION_RATIO,
    DURATIONS,
    OTHER_FRONT,
    Channel,
    bank_of_pulses,
    search,
    search_as_stream,
    search_bank,
)
from jblast.signals.templates import blast_template, blast_templates

RATE = 8000.0


def likeness(one, other):
    """Greatest correlation of two pulses, of any size and delay, in white noise."""
    n = 2 * max(one.size, other.size)
    product = np.fft.rfft(one, n) * np.conj(np.fft.rfft(other, n))
    return np.fft.irfft(product, n).max() / np.sqrt((one @ one) * (other @ other))


def test_a_bank_has_a_pulse_near_any_blast():
    bank, rate = bank_of_pulses(48_000.0), 48_000.0
    positive = [np.argmax(samples < 0) / rate for samples in bank]
    np.testing.assert_allclose(positive, DURATIONS, atol=1 / rate)
    # half a step longer than a pulse of 5 kg
    size = 5 ** (1 / 3) * DURATION_RATIO**0.5
    between = blast_template(size**3, BANK_SCALED_DISTANCE * size, rate)
    ratios = np.argmax(between < 0) / rate / np.array(DURATIONS)
    steps = np.log(ratios) / np.log(DURATION_RATIO)
    best = max(likeness(between, samples) for samples in bank)
    assert np.abs(steps).min() < 0.51
    assert 0.92 < best <= 1.0


def test_a_bank_finds_what_one_pulse_finds_and_a_little_less_loud():
    template = blast_template(2.0, 60.0, RATE)
    rng = np.random.default_rng(0)
    samples = rng.standard_normal(32_000)
    samples[20_000 : 20_000 + template.size] += 4 * template / template.max()
    channel = Channel("gate", "gate.wav", 1, samples, RATE)
    (one,) = search(channel, template).detections
    bank = search_bank(channel, bank_of_pulses(RATE), 1.0)
    (found,) = bank.detections
    assert found.time_s == pytest.approx(20_000 / RATE, abs=1e-3)
    assert one.snr_db - 2.0 < found.snr_db < one.snr_db + 0.5
    assert bank.threshold > search(channel, template).threshold
    assert bank.statistic.max() >= 0.99 * found.statistic


def test_a_pulse_of_minutes_is_no_template():
    with pytest.raises(InputError, match="a blast of 60 s at most"):
        blast_template(1e20, 5e6, RATE)


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
