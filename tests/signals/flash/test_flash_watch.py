"""Flashes in frames and events as they come: the same as in a whole film."""

import numpy as np
import pytest

from jblast.sensors.camera.files.recorded_events import RecordedEvents
from jblast.signals.flash import (
    FlashWatch,
    detect_flashes,
    event_changes,
)
from jblast.signals.flash.search import DECISION_FRAMES
from jblast.signals.flash.watch import LIGHT_OFFSET, Watch
from tests.signals.flash.films import RATE, SHAPE, growing

HEIGHT = 4.5


@pytest.fixture(scope="module")
def film():
    times, first = growing(at=(20.0, 30.0), last=10.0, frames=300)
    _, second = growing(burst_s=0.1504, at=(60.0, 30.0), last=10.0, frames=300)
    light = np.maximum(first, second)
    light[230:, 20:35, 30:45] = 1.0  # a lamp
    return times, light


def watched(watch, packets):
    """All flashes, other spots and statistics, and the number of frames then."""
    found, others, statistic, count = [], [], [], 0
    for packet in [*packets, None]:
        flashes = watch.finish() if packet is None else watch.push(*packet)
        count += 0 if packet is None else len(packet[0])
        found += [(flash, count) for flash in flashes]
        others += watch.candidates
        statistic += list(watch.statistic)
    return found, others, np.array(statistic)


@pytest.mark.slow
@pytest.mark.parametrize("size", [7])
def test_frames_as_they_come_have_the_flashes_of_the_film(film, size):
    times, light = film
    whole = detect_flashes([film], RATE, HEIGHT)
    packets = [
        (times[i : i + size], light[i : i + size]) for i in range(0, len(times), size)
    ]
    found, others, statistic = watched(FlashWatch(RATE, HEIGHT), packets)
    np.testing.assert_array_equal(statistic, whole.statistic)
    assert [one.growth for one, _ in found] == [one.growth for one in whole.flashes]
    assert tuple(sorted(others)) == whole.candidates
    assert len(found) == 2
    for one, count in found:
        alarm = round(one.alarm_s * RATE)
        assert alarm + DECISION_FRAMES < count <= alarm + DECISION_FRAMES + size


@pytest.fixture(scope="module")
def events(film):
    """Events of a film, with 0.4 s of rest in front of each blast."""
    _, light = film
    level = np.log(light[:210] + LIGHT_OFFSET)
    reference, rows = level[0].copy(), []
    for frame, log in enumerate(level):
        steps = np.trunc((log - reference) / 0.2).astype(int)
        reference += 0.2 * steps
        for y, x in zip(*np.nonzero(steps), strict=True):
            sign, count = np.sign(steps[y, x]), abs(steps[y, x])
            late = 400_000 * (1 + (frame > 120))
            t = 1000 * frame + late + np.arange(count) * 900 // count
            rows += [(time, x, y, int(sign > 0)) for time in t]
    t, x, y, p = np.array(sorted(rows)).T
    small = x.astype(np.uint16), y.astype(np.uint16)
    height, width = SHAPE
    return RecordedEvents(
        *small, t.astype(np.int64), p.astype(np.uint8), width=width, height=height
    )


def test_events_as_they_come_have_the_flashes_of_the_file(events):
    whole = detect_flashes(event_changes(events), 1000.0, HEIGHT, changes=True)
    changes = [*event_changes(events)]
    assert sum(not image.any() for _, (image,) in changes) > 800
    packets = [
        [np.concatenate(columns) for columns in zip(*changes[i : i + 7], strict=True)]
        for i in range(0, len(changes), 7)
    ]
    watch = FlashWatch(1000.0, HEIGHT, changes=True)
    found, others, statistic = watched(watch, packets)
    np.testing.assert_array_equal(statistic, whole.statistic)
    assert [one.growth for one, _ in found] == [one.growth for one in whole.flashes]
    assert tuple(sorted(others)) == whole.candidates
    assert len(found) == 2
    shift = found[1][0].growth.time_s - found[0][0].growth.time_s
    assert shift == pytest.approx(0.12 + 0.4, abs=2e-3)


def test_a_step_without_a_change_is_as_one_with_a_change_of_zero():
    rng = np.random.default_rng(0)
    changes = [0.02 * rng.standard_normal(SHAPE).astype(np.float32) for _ in range(30)]
    changes[5][20:30, 20:30] = 1.0
    zero = np.zeros(SHAPE, np.float32)
    rested, pushed = Watch(SHAPE), Watch(SHAPE)
    for nth, change in enumerate(changes):
        seen = rested.change(change), pushed.change(change)
        assert seen[0].statistic == pytest.approx(seen[1].statistic, rel=1e-5)
        for _ in range(int(rng.integers(0, 90)) if nth < len(changes) - 1 else 0):
            rest, zeros = rested.rest(), pushed.change(zero)
            assert rest.statistic == pytest.approx(zeros.statistic, rel=1e-5)
            assert rest[1:] == zeros[1:]
