import tracemalloc

import numpy as np
import pytest

from calibration.cases import RATE, coloured, pulse, rumble
from jblast.errors import InputError
from jblast.signals import detections, filtered_by, matched_kernel, stream

NOISE, SHAPE = rumble(), pulse(0.02)
KERNEL = matched_kernel(SHAPE, RATE, NOISE)


def bangs(size: int = 2**17) -> np.ndarray:
    sound = coloured(np.random.default_rng(11), NOISE, size)[0]
    for at in (3000, 40_000, 41_500, size - 1500):
        sound[at:][: SHAPE.size] += 20 / KERNEL.response * SHAPE
    return sound


@pytest.mark.parametrize("block_s", [0.1, 0.01, 0.002])
def test_a_stream_is_the_recording_filtered(block_s):
    sound = bangs()
    whole = filtered_by(sound, KERNEL)
    listening = stream(SHAPE, RATE, noise_spectrum=NOISE, block_s=block_s)
    rng, at, found, out = np.random.default_rng(12), 0, [], []
    while at < sound.size:
        step = int(rng.integers(0, 3000))
        found += listening.push(sound[at : at + step])
        out.append(listening.statistic)
        at += step
    found += listening.finish()
    joined = np.concatenate([*out, listening.statistic])
    # transforms of other lengths round otherwise: 1e-16 of a loud low rumble
    assert np.allclose(joined, whole.statistic[: joined.size], atol=1e-9)
    assert joined.size == whole.stop
    assert listening.threshold is not None
    said = detections(whole, listening.threshold)
    assert len(said) == 3
    assert np.allclose(np.array(found), np.array(said), rtol=1e-9)


def test_a_blast_is_told_within_the_latency():
    listening = stream(SHAPE, RATE, noise_spectrum=NOISE, block_s=0.01)
    sound, at, step = bangs(), 40_000, 48
    for start in range(0, sound.size, step):
        found = listening.push(sound[start : start + step])
        if any(abs(one.time_s * RATE - at) < 2 for one in found):
            told = start + step
            break
    else:
        pytest.fail("not heard")
    assert listening.latency_s is not None
    assert 2 * SHAPE.size - 2 <= told - at <= listening.latency_s * RATE + step


def test_the_noise_is_learnt_from_the_first_of_it_and_blasts_in_it_are_found():
    sound = bangs()
    listening = stream(SHAPE, RATE, learn_s=2.0)
    first = listening.push(sound[:48_000])
    assert (first, listening.kernel, listening.latency_s) == ((), None, None)
    rest = [*listening.push(sound[48_000:]), *listening.finish()]
    times = [round(one.time_s * RATE) for one in rest]
    assert {3000, 40_000}.issubset(times)


def test_a_stream_that_ends_early_answers_for_what_came():
    listening = stream(SHAPE, RATE, learn_s=60.0)
    assert listening.push(bangs(2**16)) == ()
    assert round(listening.finish()[0].time_s * RATE) == 3000


def test_a_stream_that_breaks_keeps_what_it_had():
    sound = bangs()
    broken, sane = (stream(SHAPE, RATE, noise_spectrum=NOISE) for _ in range(2))
    found = [*broken.push(sound[:50_000])]
    with pytest.raises(InputError, match=r"expected finite .* nan at sample 7"):
        broken.push(np.r_[np.zeros(7), np.nan])
    found += [*broken.push(sound[50_000:]), *broken.finish()]
    assert found == [
        *sane.push(sound[:50_000]),
        *sane.push(sound[50_000:]),
        *sane.finish(),
    ]


def test_memory_is_constant():
    listening = stream(SHAPE, RATE, noise_spectrum=NOISE)
    sound = coloured(np.random.default_rng(13), NOISE, 2**16)[0]
    tracemalloc.start()
    held = []
    for _ in range(30):
        for start in range(0, 13 * 4800, 4800):
            listening.push(sound[start : start + 4800])
        held.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert held[-1] - held[4] < 2000  # bytes; one block is 38 kB


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"block_s": 0.0}, "block_s: expected a positive number"),
        ({"learn_s": -1.0}, "learn_s: expected a positive number"),
        ({"false_alarms_per_hour": 0.0}, "false_alarms_per_hour: expected"),
        (
            {"threshold": -3.0, "noise_spectrum": NOISE},
            "threshold: expected a positive",
        ),
    ],
)
def test_options_that_make_no_stream_are_refused(options, said):
    with pytest.raises(InputError, match=said):
        stream(SHAPE, RATE, **options)
