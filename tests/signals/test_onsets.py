"""Stretches of long recordings: each bang in one, whatever the blocks."""

import numpy as np
import pytest

from jblast.observations.records import recording
from jblast.observations.records.recording import Recording
from jblast.signals.onsets import stretches

RATE = 8000.0
OFFSET = 30.0


def held(samples: np.ndarray, rate_hz: float = RATE) -> Recording:
    """Channels in memory."""
    names = tuple(f"m.{k + 1}" for k in range(len(samples)))
    return Recording(
        source="m.wav",
        names=names,
        rate_hz=rate_hz,
        length=samples.shape[1],
        read=lambda start, stop: samples[:, start:stop],
        start_s=100.0,
    )


def noise_with_bangs(
    seconds: float, bangs: list, rate: float = RATE, noise: float = 1.0
) -> np.ndarray:
    """White noise on an offset, and pulses: (time [s], peak)."""
    rng = np.random.default_rng(3)
    samples = OFFSET + noise * rng.standard_normal((round(seconds * rate),))
    for at, peak in bangs:
        since = np.arange(samples.size) / rate - at
        inside = (since >= 0) & (since < 0.1)
        samples[inside] += (
            peak * (1 - since[inside] / 0.01) * np.exp(-since[inside] / 0.01)
        )
    return samples


@pytest.mark.parametrize("block", [24_001, 10**7])
def test_bangs_are_found_wherever_blocks_end(monkeypatch, block):
    monkeypatch.setattr(recording, "BLOCK_SAMPLES", block)
    bangs = [(4.0, 100.0), (9.0, 200.0), (14.999, 50.0)]
    samples = np.array([noise_with_bangs(20.0, bangs), noise_with_bangs(20.0, [])])
    first, second = stretches(held(samples))
    assert len(first.records) == 3
    for record, (at, peak) in zip(first.records, bangs, strict=True):
        # half a second before the onset, which is told up to five bins early
        assert 100 + at - 0.506 < record.start_s < 100 + at - 0.499
        assert record.samples.size == 2 * RATE
        assert abs(record.samples - OFFSET).max() == pytest.approx(peak, abs=5.0)
    assert first.quieter == 0
    assert len(second.records) == 1  # where noise alone is loudest


def test_what_is_twenty_decibels_quieter_is_left_out_and_counted():
    samples = noise_with_bangs(20.0, [(4.0, 1000.0), (9.0, 60.0), (14.0, 200.0)])
    (told,) = stretches(held(samples[None]))
    assert len(told.records) == 2
    assert told.quieter == 1


def test_a_recording_that_begins_with_the_bang_is_looked_at_there():
    samples = noise_with_bangs(20.0, [(0.01, 200.0), (9.0, 100.0)])
    (told,) = stretches(held(samples[None]))
    assert [record.start_s for record in told.records] == [
        100.0,
        pytest.approx(108.5, abs=0.01),
    ]


def test_bangs_in_silence_are_found_and_silence_is_not():
    samples = noise_with_bangs(20.0, [(4.0, 100.0), (9.0, 200.0)], noise=0.0)
    (told,) = stretches(held(samples[None]))
    assert len(told.records) == 2
    (told,) = stretches(held(np.full((1, 160_000), OFFSET)))
    assert len(told.records) == 1


def test_a_short_recording_is_taken_whole():
    (told,) = stretches(held(noise_with_bangs(1.5, [])[None]))
    assert told.records[0].samples.size == 1.5 * RATE
    (told,) = stretches(held(np.zeros((1, 1))))
    assert told.records[0].samples.size == 1
