"""Arrivals of a search with the times of their picks."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from jblast.signals import Channel, bank_of_pulses, pulse_fit as module, search
from jblast.signals.detection import Detection
from jblast.signals.picked_arrivals import picked_arrivals
from tests.signals.records.made import picked_at_its_peak

RATE = 8000.0


def arrival(time_s, spread_s=0.0):
    return Detection(time_s, 1e-5, 40.0, 100.0, template_s=0.1, spread_s=spread_s)


def heard(peaks, arrivals, seconds=4.0):
    samples = np.random.default_rng(0).uniform(-0.1, 0.1, round(seconds * RATE))
    for time, size in peaks:
        samples[round(time * RATE)] = size
    return picked_arrivals(arrivals, samples, RATE)


@pytest.fixture
def lengths(monkeypatch):
    """Picks at the largest sample, without a fit; lengths of the records."""
    sizes = []

    def pick_records(records):
        sizes.extend(record.samples.size for record in records)
        return picked_at_its_peak(records)

    monkeypatch.setattr(module, "pick_records", pick_records)
    return sizes


def test_an_arrival_has_the_time_of_its_pick(lengths):
    (found,) = heard([(2.03, 5.0)], [arrival(2.0)])
    assert found.time_s == pytest.approx(2.03)
    # half a sample is added to the error of the pick
    assert found.sigma_s >= 0.5 / RATE
    # 0.25 s before the arrival, and three templates
    assert lengths == [0.55 * RATE]


def test_of_two_arrivals_each_has_its_own_pick(lengths):
    peaks = [(2.02, 3.0), (2.42, 9.0)]
    found = heard(peaks, [arrival(2.0), arrival(2.4)])
    assert [one.time_s for one in found] == pytest.approx([2.02, 2.42])


@pytest.mark.parametrize("peaks", [[], [(2.3, 5.0)]], ids=["no pick", "another sound"])
def test_without_a_pick_the_bank_and_its_template_are_an_error(lengths, peaks):
    (found,) = heard(peaks, [arrival(2.0, spread_s=0.02)])
    assert found == arrival(2.0, 0.02)._replace(sigma_s=found.sigma_s)
    assert found.sigma_s == pytest.approx(math.hypot(0.1 / math.sqrt(12), 0.02))
    assert heard(peaks, []) == ()


def bang(duration_s, level, *, high_pass_hz=None, echo=0.0, clipped=None, noise=1e-3):
    """A Friedlander pulse at 2.0003 s, as a telephone records it."""
    clock = (np.arange(round(4 * 4 * RATE)) + 0.5) / (4 * RATE)
    sound = np.zeros(clock.size)
    for delay, size in ((0.0, 1.0), (0.012, echo)):
        x = (clock - 2.0003 - delay) / duration_s
        sound += size * np.where(x >= 0, (1 - x) * np.exp(-np.maximum(x, 0)), 0.0)
    sound = level * sound.reshape(-1, 4).mean(axis=1)
    sound += noise * np.random.default_rng(3).standard_normal(sound.size)
    if high_pass_hz is not None:
        high_pass: Any = butter(1, high_pass_hz / (RATE / 2), "high")
        sound = lfilter(high_pass[0], high_pass[1], sound)
    largest = np.abs(sound).max()
    return sound if clipped is None else np.clip(sound, *clipped * largest)


CLIP = np.array([-0.1, 0.1])
CASES = {
    "high-pass and echo": bang(0.03, 0.5, high_pass_hz=60.0, echo=0.4),
    "in noise": bang(0.03, 0.5, high_pass_hz=60.0, echo=0.4, noise=0.08),
    "clipped": bang(0.008, 0.5, high_pass_hz=60.0, echo=0.4, clipped=CLIP),
}


@pytest.mark.slow
@pytest.mark.parametrize("sound", CASES.values(), ids=CASES.keys())
def test_the_bang_of_a_telephone_is_timed_within_its_error(sound):
    bank = bank_of_pulses(RATE)
    found = search(Channel("a", "a", 1, sound, RATE), bank, forms=False)
    picks = picked_arrivals(found.detections, sound, RATE)
    one = max(picks, key=lambda arrival: arrival.statistic)
    assert one.sigma_s < 2e-3
    assert one.time_s == pytest.approx(2.0003, abs=3 * one.sigma_s)
