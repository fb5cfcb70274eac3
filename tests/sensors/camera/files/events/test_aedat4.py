"""AEDAT4: ours is read, and others' are, by dv-processing."""

import dv_processing as dv
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.sensors.camera.files.aedat4 import PACKET
from jblast.sensors.camera.files.event_files import read_events, write_events
from tests.sensors.camera.files.events.test_read import events_of


def others(path, config, *streams: str):
    """Write five events into each stream by dv-processing."""
    writer = dv.io.MonoCameraWriter(str(path), config)
    for stream in streams:
        store = dv.EventStore()
        for k in range(5):
            store.push_back(10**15 + 7 * k, 3 * k, 2 * k, k % 2 == 0)
        writer.writeEvents(store, streamName=stream)
    return path


@pytest.mark.parametrize("compression", ["NONE", "LZ4", "ZSTD"])
def test_files_of_dv_processing_are_read(tmp_path, compression):
    kind = getattr(dv.CompressionType, compression)
    config = dv.io.MonoCameraWriter.EventOnlyConfig("a camera", (346, 260), kind)
    found = read_events(others(tmp_path / "a.aedat4", config, "events"))
    assert found.x.tolist() == [0, 3, 6, 9, 12]
    assert found.y.tolist() == [0, 2, 4, 6, 8]
    assert found.t.tolist() == [10**15 + 7 * k for k in range(5)]  # time of the day
    assert found.p.tolist() == [1, 0, 1, 0, 1]
    assert (found.width, found.height) == (346, 260)


def test_dv_processing_finds_ours_by_time(tmp_path):
    count = 2 * PACKET + 5
    rng = np.random.default_rng(0)
    t = np.sort(rng.integers(0, 10**8, count))
    columns = rng.integers(0, 640, count), rng.integers(0, 480, count), t, t % 2
    path = tmp_path / "a.aedat4"
    write_events(path, [events_of(*columns)], 640, 480)
    file = dv.io.MonoCameraRecording(str(path))
    assert file.getEventResolution() == (640, 480)
    assert file.getTimeRange() == (t[0], t[-1])
    some = file.getEventsTimeRange(4 * 10**7, 5 * 10**7)
    assert some is not None
    inside = (t >= 4 * 10**7) & (t < 5 * 10**7)
    names = ("x", "y", "timestamp", "polarity")
    for name, expected in zip(names, columns, strict=True):
        np.testing.assert_array_equal(some.numpy()[name], expected[inside])


def test_files_without_events_are_refused(tmp_path):
    config = dv.io.MonoCameraWriter.FrameOnlyConfig("a camera", (346, 260))
    path = tmp_path / "a.aedat4"
    writer = dv.io.MonoCameraWriter(str(path), config)
    writer.writeFrame(dv.Frame(5, np.zeros((260, 346), np.uint8)))
    del writer
    with pytest.raises(InputError, match=r"a\.aedat4: expected one stream of events"):
        read_events(path)
    config = dv.io.MonoCameraWriter.EventOnlyConfig("a camera", (346, 260))
    with pytest.raises(InputError, match=r"b\.aedat4: .* packets of events, got none"):
        read_events(others(tmp_path / "b.aedat4", config))
