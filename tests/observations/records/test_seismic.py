"""Records of continuous recorders: order, repeats, gaps, drift, channels, clocks."""

import warnings
from datetime import UTC, datetime
from io import BytesIO

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations.records.formats import Scaling, open_record

with warnings.catch_warnings():  # of its own age
    warnings.simplefilter("ignore", DeprecationWarning)
    import obspy

BEGAN = obspy.UTCDateTime("2024-05-17T11:53:00Z")
RATE = 100.0
SAMPLES = np.arange(3000, dtype=np.int32) % 997


def packed(samples, later_s=0.0, channel="HDF", began=BEGAN, rate=RATE):
    """One miniSEED record, or more of 4096 bytes, as ObsPy writes them."""
    header = {"sampling_rate": rate, "starttime": began + later_s}
    header |= {"network": "XX", "station": "D01", "channel": channel}
    file = BytesIO()
    trace = obspy.Trace(np.asarray(samples, np.int32), header)
    trace.write(file, format="MSEED", reclen=4096, encoding="INT32")
    return file.getvalue()


def opened(tmp_path, *records):
    path = tmp_path / "a.mseed"
    path.write_bytes(b"".join(records))
    return open_record(path, Scaling(sensitivity=1.0))


def parts(step_s=1 / RATE):
    """Six records of 500 samples, as a clock with this step dates them."""
    return [packed(SAMPLES[at : at + 500], at * step_s) for at in range(0, 3000, 500)]


def test_records_are_sorted_and_repeated_ones_read_once(tmp_path):
    one, two, *more = parts()
    # a copy with another number and flag is the same record
    copy = b"000077Q" + two[7:]
    (found,) = opened(tmp_path, two, one, copy, *more, one)
    np.testing.assert_array_equal(found.samples(0, 3000)[0], SAMPLES)
    assert (found.start_s, found.rate_hz) == (0.0, RATE)
    assert found.epoch == datetime(2024, 5, 17, 11, 53, tzinfo=UTC)
    assert found.notes == ("2 repeated records are ignored",)


def test_samples_of_two_records_are_used_once_if_they_are_equal(tmp_path):
    again = packed(SAMPLES[300:800], 3.0)
    (found,) = opened(tmp_path, *parts(), again)
    np.testing.assert_array_equal(found.samples(0, 3000)[0], SAMPLES)
    with pytest.raises(InputError, match=r"an overlap of 2 s with other samples"):
        opened(tmp_path, *parts(), packed(SAMPLES[300:800] + 1, 3.0))


def test_a_drifting_clock_is_that_of_the_records(tmp_path):
    # 200 ppm fast, as in `clock_drift.mseed` of issue 41
    (found,) = opened(tmp_path, *parts(1 / 100.02))
    assert found.rate_hz == pytest.approx(100.02, rel=1e-6)
    assert found.time_s(2500) == pytest.approx(2500 / 100.02, abs=2e-6)
    assert found.record(0, 2500).start_s == pytest.approx(2500 / 100.02, abs=2e-6)
    assert found.notes == (
        "trace XX.D01..HDF: 100.02 Hz by the times of its records, 100 Hz in its "
        "header",
    )


def test_a_gap_gives_segments_of_one_channel(tmp_path):
    records = parts()
    late = packed(SAMPLES[2500:], 2500 / RATE + 12.0)
    first, second = opened(tmp_path, *records[:2], late, *records[3:5])[::2]
    assert first.names == second.names == ("a",)
    assert (first.length, second.length) == (1000, 500)
    assert second.epoch == datetime(2024, 5, 17, 11, 53, 37, tzinfo=UTC)
    np.testing.assert_array_equal(second.samples(0, 500)[0], SAMPLES[2500:])
    assert "2 gaps, the first of 5 s after 2024-05-17T11:53:10.000Z" in first.notes[0]


def test_a_file_that_ends_within_a_record_is_read_up_to_it(tmp_path):
    (found,) = opened(tmp_path, *parts()[:5], parts()[5][:1000])
    assert found.length == 2500
    assert found.notes == ("cut short: the last 1,000 bytes are no record",)


def test_a_channel_of_two_rates_is_refused(tmp_path):
    with pytest.raises(InputError, match="one sampling rate, got 100 and 200 Hz"):
        opened(tmp_path, parts()[0], packed(SAMPLES[:500], 5.0, rate=2 * RATE))


def test_ground_channels_are_left_out_by_their_code(tmp_path):
    ground = packed(SAMPLES[:500] + 7, channel="EHZ")
    (found,) = opened(tmp_path, ground, *parts())
    assert found.names == ("a",)
    np.testing.assert_array_equal(found.samples(0, 3000)[0], SAMPLES)
    expected = "left out, not pressure: XX.D01..EHZ (ground motion)"
    assert found.notes == (expected,)
    with pytest.raises(InputError, match=r"expected pressure, .*EHZ \(ground motion"):
        opened(tmp_path, ground)
    # codes of no known instrument, as of loggers with names of their own
    assert opened(tmp_path, packed(SAMPLES, channel="p0"))[0].length == 3000


@pytest.mark.parametrize("began", ["1970-01-01T00:00:00", "1980-01-06T00:10:00"])
def test_a_clock_that_was_not_set_has_no_time_of_day(tmp_path, began):
    records = [
        packed(SAMPLES[:500], later, began=obspy.UTCDateTime(began))
        for later in (3.0, 99.5)
    ]
    first, second = opened(tmp_path, *records)
    assert (first.epoch, first.start_s, first.clock_is_set) == (None, 0.0, False)
    assert (second.epoch, second.start_s) == (None, 96.5)
    assert f"its clock was not set: it begins in {began[:4]}" in first.notes[-1]
    # a record of a real blast of 1980
    (old,) = opened(
        tmp_path, packed(SAMPLES, began=obspy.UTCDateTime("1980-05-18T15:32:11Z"))
    )
    assert old.epoch == datetime(1980, 5, 18, 15, 32, 11, tzinfo=UTC)
