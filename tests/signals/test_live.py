"""Live sound: the outputs and blasts of a whole recording, in bounded memory."""

import numpy as np
import pytest

from calibration.everyday_sounds import RATE_HZ, door, speech
from jblast.signals.live import SoundWatch, search_bank_as_stream
from jblast.signals.noise import noise_spectrum
from jblast.signals.search import (
    DURATIONS,
    Channel,
    bank_of_pulses,
    search,
    search_bank,
)

RATE = 48_000.0
BLASTS = {0.7: (6, 60.0), 3.0: (0, 12.0), 5.0: (5, 30.0), 8.0: (10, 10.0)}
"""Time [s]: number of the pulse, and its peak over the noise's deviation."""


@pytest.fixture(scope="module")
def bank():
    return bank_of_pulses(RATE)


def coloured(seconds, seed=0, rate=RATE):
    """Noise whose spectrum falls like that of wind, of variance 1."""
    size = round(seconds * rate)
    white = np.random.default_rng(seed).standard_normal(size)
    gain = np.maximum(np.fft.rfftfreq(size, 1 / rate), 5.0) ** -0.6
    noise = np.fft.irfft(np.fft.rfft(white) * gain, size)
    return noise / noise.std()


def add(samples, sound, at_s, peak, rate=RATE):
    start = round(at_s * rate)
    samples[start : start + sound.size] += peak * sound / np.abs(sound).max()


@pytest.fixture(scope="module")
def sound(bank):
    samples = coloured(11.0)
    for at_s, (nth, peak) in BLASTS.items():
        add(samples, bank[nth], at_s, peak)
    rng, repeats = np.random.default_rng(1), round(RATE / RATE_HZ)
    for at_s, make in ((6.3, door), (9.5, speech)):
        other = make(rng)[: round(1.2 * RATE_HZ)]
        at = np.arange(repeats * other.size) / repeats
        add(samples, np.interp(at, np.arange(other.size), other), at_s, 40.0)
    return samples


def watched(watch, samples, packet):
    """All blasts, rejected arrivals and outputs."""
    found, rejected, outputs = [], [], []
    for start in range(0, samples.size + packet, packet):
        part = samples[start : start + packet]
        found += watch.push(part) if part.size else watch.finish()
        rejected += watch.rejected
        outputs.append(watch.statistic)
    return found, rejected, np.concatenate(outputs)


@pytest.fixture(scope="module")
def whole(bank, sound):
    return search_bank_as_stream(Channel("gate", "", 1, sound, RATE), bank, 1.0)


@pytest.mark.parametrize("packet", [480, 4800, 7777])
def test_the_size_of_packets_changes_nothing(bank, sound, whole, packet):
    watch = SoundWatch(bank, RATE, front_samples=0.1)
    found, rejected, outputs = watched(watch, sound, packet)
    np.testing.assert_array_equal(outputs, whole.statistic)
    assert outputs.size == sound.size
    assert tuple((one.arrival, one.fit) for one in rejected) == whole.rejected
    assert tuple(one.arrival for one in found) == whole.detections
    # reported within the latency, of which a packet is a part
    for one in found[1:]:
        delay_s = one.reported / RATE - one.arrival.time_s
        assert 0.5 < delay_s <= watch.latency_s + packet / RATE


def test_blasts_of_all_durations_are_found_and_other_sounds_are_not(whole):
    times = [one.time_s for one in whole.detections]
    np.testing.assert_allclose(times, list(BLASTS), atol=5e-4)
    assert len(whole.rejected) >= 2
    assert {round(one.time_s) for one, _ in whole.rejected} >= {6, 10}


@pytest.mark.slow
def test_with_the_same_noise_a_stream_finds_what_a_whole_recording_does(bank, sound):
    channel = Channel("gate", "", 1, sound, RATE)
    noise = noise_spectrum(coloured(11.0), RATE)
    one = search_bank(channel, bank, 1.0, noise=noise)
    other = search_bank_as_stream(channel, bank, 1.0, noise=noise)
    np.testing.assert_allclose(other.detections, one.detections, rtol=1e-9)
    np.testing.assert_allclose(other.fits, one.fits, rtol=1e-6)
    assert len(one.detections) == len(BLASTS)
    times = [[pair[0].time_s for pair in each.rejected] for each in (one, other)]
    np.testing.assert_allclose(*times, rtol=1e-9)
    # the outputs of each filter alone
    single = search(channel, bank[5], 1.0, noise=noise)
    alone = search_bank_as_stream(channel, [bank[5]], 1.0, noise=noise)
    kernel = single.kernel
    inside = slice(kernel.before, sound.size - kernel.reach)
    np.testing.assert_allclose(
        alone.statistic[inside], single.statistic[inside], atol=1e-9
    )


@pytest.mark.slow
def test_early_sound_has_no_more_false_alarms_than_requested():
    rate, trials = 8000.0, 40
    bank, per_hour, alarms = bank_of_pulses(rate), 900.0, 0
    for seed in range(trials):
        watch = SoundWatch(bank, rate, per_hour, any_form=True)
        found = [*watch.push(coloured(3.0, seed, rate)), *watch.finish()]
        alarms += len(found)
    # 30 expected at most, by the Bonferroni threshold fewer
    assert 1 <= alarms <= 40


def test_louder_noise_is_learnt():
    rate, rng = 8000.0, np.random.default_rng(3)
    bank = bank_of_pulses(rate)
    samples = rng.standard_normal(round(20 * rate))
    samples[round(5 * rate) :] *= 20.0
    add(samples, bank[6], 17.0, 400.0, rate)
    watch = SoundWatch(bank, rate)
    found, rejected, outputs = watched(watch, samples, 800)
    assert [round(one.arrival.time_s, 2) for one in found] == [17.0]
    assert max(one.arrival.time_s for one in rejected) < 13.0
    # the largest of 14 outputs, each with a deviation of 1
    late = outputs[round(13 * rate) : round(16 * rate)]
    assert 0.6 < late.std() < 1.1
    assert 0.5 < late.mean() < 2.0


@pytest.mark.parametrize("rate", [200.0, 1000.0, 8000.0])
def test_a_blast_after_exact_silence_is_found(rate):
    samples = np.zeros(round(6 * rate))
    bank = bank_of_pulses(rate)
    assert len(bank) == sum(one * rate >= 1 for one in DURATIONS)
    add(samples, bank[-4], 2.0, 30.0, rate)
    found, rejected, _ = watched(SoundWatch(bank, rate), samples, round(0.1 * rate))
    assert [one.arrival.time_s for one in found] == [pytest.approx(2.0, abs=0.5 / rate)]
    assert rejected == []


@pytest.mark.parametrize("size", [0, 10, 1000, 20_000])
def test_a_stream_that_ends_early_has_no_blasts(bank, size):
    watch = SoundWatch(bank, RATE)
    assert watch.push(coloured(1.0)[:size]) == ()
    assert watch.finish() == ()
