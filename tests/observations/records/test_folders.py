"""A folder gives its records; a record's clock is even; what is none is refused."""

from datetime import UTC, datetime

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations.records.formats import record_files
from jblast.observations.records.recording import PressureRecord
from tests.observations.records.formats.test_csv import text


def test_a_folder_gives_its_records_by_name(tmp_path):
    record = "time_s,p_pa\n0,1\n1,2\n"
    for name in ("b.csv", "a.CSV", ".hidden.csv"):
        text(tmp_path, record, name)
    stations = text(tmp_path, "sensor,east_m,north_m,up_m\na,0,0,0\n", "places.csv")
    other = text(tmp_path, "sensor,lat_deg,lon_deg\na,0,0\n", "degrees.csv")
    notes = text(tmp_path, "a note", "README.md")
    (tmp_path / "deeper").mkdir()
    files, left_out = record_files([tmp_path], str(stations))
    assert files == (tmp_path / "a.CSV", tmp_path / "b.csv")
    assert left_out == (notes, other)
    # a file that is named is taken, whatever it is
    assert record_files([notes, tmp_path])[0] == (notes, *files)


def test_a_folder_without_records_is_refused(tmp_path):
    with pytest.raises(InputError, match="folder of records of samples, got none"):
        record_files([tmp_path])
    text(tmp_path, "a note", "README.md")
    with pytest.raises(InputError, match="got 1 other files"):
        record_files([tmp_path])


def test_times_begin_where_the_record_does_and_step_by_the_rate():
    record = PressureRecord("a", np.zeros(5), rate_hz=4.0, start_s=10.0)
    np.testing.assert_array_equal(record.time_s, [10.0, 10.25, 10.5, 10.75, 11.0])
    assert record.seconds == 1.25


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"rate_hz": 0.0}, "rate_hz must be positive"),
        ({"rate_hz": float("nan")}, "rate_hz must be positive"),
        ({"start_s": float("inf")}, "start_s must be finite"),
        ({"epoch": datetime(2026, 1, 1)}, "epoch must have a time zone"),
    ],
)
def test_what_is_no_record_is_refused(changed, named):
    good = {"rate_hz": 1.0, "start_s": 0.0, "epoch": datetime(2026, 1, 1, tzinfo=UTC)}
    with pytest.raises(ValueError, match=named):
        PressureRecord("a", np.zeros(2), **(good | changed))
