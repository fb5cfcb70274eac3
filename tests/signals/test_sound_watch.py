"""Search of sound: the same arrivals in packets of any size, in bounded memory."""

import tracemalloc
from typing import Any

import numpy as np
import pytest

from calibration.everyday_sounds import RATE_HZ, door, speech
from jblast.errors import InputError
from jblast.signals import (
    Channel,
    SoundWatch,
    bank_of_pulses,
    blast_template,
    search,
    white_noise,
)
from jblast.signals.picked_arrivals import picked_arrivals
from jblast.signals.templates import DURATIONS, blast_templates

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


def channel(samples, rate=RATE):
    return Channel("gate", "gate.wav", 1, samples, rate)


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
    """All sounds with the number of samples pushed at their report, and all outputs."""
    found, outputs = [], []
    for start in range(0, samples.size + packet, packet):
        part = samples[start : start + packet]
        reported = watch.push(part) if part.size else watch.finish()
        found += [(one, start + part.size) for one in reported]
        outputs.append(watch.statistic)
    return found, np.concatenate(outputs)


@pytest.mark.parametrize("templates", ["bank", "template"])
def test_a_file_has_the_same_arrivals_whole_and_in_packets_of_any_size(
    bank, sound, templates
):
    shapes = bank if templates == "bank" else [blast_template(5.0, 100.0, RATE)]
    options: dict[str, Any] = {"forms": templates == "bank"}
    whole = search(channel(sound), shapes, **options)
    assert len(whole.detections) >= len(BLASTS)
    assert whole.statistic.size == sound.size
    every = sorted(whole.detections + whole.others)
    for packet in (1781, 110_400):
        watch = SoundWatch(shapes, RATE, noise=whole.noise, **options)
        found, outputs = watched(watch, sound, packet)
        assert [one for one, _ in found] == every
        np.testing.assert_array_equal(outputs, whole.statistic)


@pytest.fixture(scope="module")
def learnt(bank, sound):
    return watched(SoundWatch(bank, RATE), sound, sound.size)


@pytest.mark.parametrize("packet", [7777])
def test_a_stream_has_the_same_arrivals_in_packets_of_any_size(
    bank, sound, learnt, packet
):
    watch = SoundWatch(bank, RATE)
    found, outputs = watched(watch, sound, packet)
    np.testing.assert_array_equal(outputs, learnt[1])
    assert [one for one, _ in found] == [one for one, _ in learnt[0]]
    # a packet is a part of the delay; the first arrival waits for the noise
    for one, reported in found[1:]:
        assert reported / RATE - one.time_s <= watch.latency_s + packet / RATE


def test_blasts_of_all_durations_are_found_and_other_sounds_are_not(
    bank, sound, learnt
):
    found = [one for one, _ in learnt[0]]
    whole = search(channel(sound), bank)
    for sounds in (found, whole.detections + whole.others):
        blasts = sorted(one.time_s for one in sounds if one.is_blast)
        np.testing.assert_allclose(blasts, list(BLASTS), atol=5e-4)
        others = {round(one.time_s) for one in sounds if not one.is_blast}
        assert others >= {6, 10}


def test_louder_noise_is_learnt():
    rate, rng = 8000.0, np.random.default_rng(3)
    bank = bank_of_pulses(rate)
    samples = rng.standard_normal(round(20 * rate))
    samples[round(5 * rate) :] *= 20.0
    add(samples, bank[6], 17.0, 400.0, rate)
    found, outputs = watched(SoundWatch(bank, rate), samples, 800)
    assert [round(one.time_s, 2) for one, _ in found if one.is_blast] == [17.0]
    assert max(one.time_s for one, _ in found if not one.is_blast) < 13.0
    # the largest of 14 outputs, each with a deviation of 1
    late = outputs[round(13 * rate) : round(16 * rate)]
    assert 0.6 < late.std() < 1.1
    assert 0.5 < late.mean() < 2.0


@pytest.mark.parametrize("rate", [200.0, 8000.0])
def test_a_blast_after_exact_silence_is_found(rate):
    samples = np.zeros(round(6 * rate))
    bank = bank_of_pulses(rate)
    assert len(bank) == sum(one * rate >= 1 for one in DURATIONS)
    add(samples, bank[-4], 2.0, 30.0, rate)
    found, _ = watched(SoundWatch(bank, rate), samples, round(0.1 * rate))
    # without noise only the samples on both sides of the step bound its time
    assert [one.time_s for one, _ in found] == [pytest.approx(2.0, abs=1 / rate)]
    assert found[0][0].is_blast


@pytest.mark.parametrize("size", [0, 1000])
def test_a_stream_that_ends_early_has_no_blasts(bank, size):
    watch = SoundWatch(bank, RATE)
    assert watch.push(coloured(1.0)[:size]) == ()
    assert watch.finish() == ()


def test_samples_that_are_not_finite_leave_the_stream_as_it_was(bank, sound):
    broken, sane = SoundWatch(bank[:3], RATE), SoundWatch(bank[:3], RATE)
    found = [*broken.push(sound[:80_000])]
    with pytest.raises(InputError, match=r"expected finite .* nan at sample 7"):
        broken.push(np.r_[np.zeros(7), np.nan])
    found += [*broken.push(sound[80_000:200_000]), *broken.finish()]
    assert found == [*sane.push(sound[:200_000]), *sane.finish()]


def test_memory_is_constant(bank):
    watch = SoundWatch(bank[:2], RATE, noise=white_noise(1.0, RATE), forms=False)
    samples, held = coloured(1.0), []
    tracemalloc.start()
    for _ in range(12):
        for start in range(0, samples.size, 4800):
            watch.push(samples[start : start + 4800])
        held.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    # bytes: between blocks of 4096 samples, packets of 4800 wait for up to one
    assert max(held[6:]) - max(held[3:6]) < 40_000


def test_a_bank_finds_what_one_pulse_finds_and_a_little_less_loud():
    rate = 8000.0
    template = blast_template(2.0, 60.0, rate)
    samples = np.random.default_rng(0).standard_normal(32_000)
    add(samples, template, 2.5, 4.0, rate)
    alone = search(channel(samples, rate), [template], forms=False)
    bank = search(channel(samples, rate), bank_of_pulses(rate))
    (one,), (found,) = alone.detections, bank.detections
    assert found.time_s == pytest.approx(2.5, abs=1e-3)
    assert one.snr_db - 2.0 < found.snr_db < one.snr_db + 0.5
    assert bank.threshold > alone.threshold
    assert bank.statistic.max() >= 0.99 * found.statistic


def test_a_loud_blast_does_not_count_as_noise():
    template, samples = np.hanning(400), coloured(6.0)
    samples[100_000:][:400] += 300 * template
    (found,) = search(channel(samples), [template], forms=False).detections
    quiet = search(channel(coloured(6.0)), [template], forms=False)
    true = search(channel(samples), [template], forms=False, noise=quiet.noise)
    assert found.snr_db == pytest.approx(true.detections[0].snr_db, abs=0.5)


def test_a_loud_blast_of_another_front_is_within_the_error_of_its_pick():
    """From a quarter of the distance, or clipped: the bound alone is 2e-8 s here."""
    at, rng = 9000, np.random.default_rng(4)
    template, near = blast_templates([5.0, 5.0], [100.0, 25.0], RATE)
    clipped = np.minimum(template, 0.4 * template.max())
    for blast in (template, near, clipped):
        samples = 1e-4 * rng.standard_normal(24_000)
        samples[at : at + blast.size] += blast / blast.max()
        found = search(channel(samples), [template], forms=False).detections
        (loudest,) = [one for one in found if one.snr_db > 40]
        assert loudest.sigma_s < 0.2 / RATE
        (loudest,) = picked_arrivals([loudest], samples, RATE)
        assert 0.4 / RATE < loudest.sigma_s < 0.8 / RATE
        # the mean over a sample is at its middle
        assert abs(loudest.time_s + 0.5 / RATE - at / RATE) < 2 * loudest.sigma_s


def test_a_recording_shorter_than_its_template_and_the_noise_is_refused():
    short = channel(coloured(0.02))
    with pytest.raises(InputError, match=r"gate\.wav: expected a recording at least"):
        search(short, [np.hanning(900)])
