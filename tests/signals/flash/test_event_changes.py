"""Events as changes, millisecond by millisecond."""

import numpy as np

from jblast.sensors.camera.files.recorded_events import RecordedEvents
from jblast.signals.flash.search import event_changes


def test_each_event_counts_once_in_its_millisecond():
    rng = np.random.default_rng(0)
    t = np.sort(rng.integers(0, 100_000, 5000)).astype(np.int64)
    x, y = rng.integers(0, 8, 5000), rng.integers(0, 6, 5000)
    p = rng.integers(0, 2, 5000).astype(np.uint8)
    events = RecordedEvents(x.astype(np.uint16), y.astype(np.uint16), t, p, 8, 6)
    blocks = list(event_changes(events, (0.2, 0.3)))
    times = np.concatenate([times for times, _ in blocks])
    changes = np.concatenate([images for _, images in blocks])
    np.testing.assert_allclose(times, np.arange(1, len(times) + 1) / 1000)
    by_hand = np.zeros_like(changes)
    for column, row, time, sign in zip(x, y, t, p, strict=True):
        by_hand[time // 1000, row, column] += 0.2 if sign else -0.3
    np.testing.assert_allclose(changes, by_hand, atol=1e-6)
