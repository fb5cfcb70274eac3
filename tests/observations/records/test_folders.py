"""A folder gives its records, and names what it leaves out."""

from pathlib import Path

import pytest

from jblast.errors import InputError
from jblast.observations.records.formats import record_files
from tests.observations.records.formats.test_csv import text


def test_a_folder_gives_its_records_by_name(tmp_path):
    record = "time_s,p_pa\n0,1\n1,2\n"
    for name in ("b.csv", "a.CSV", ".hidden.csv"):
        text(tmp_path, record, name)
    stations = text(tmp_path, "sensor,east_m,north_m,up_m\na,0,0,0\n", "places.csv")
    other = text(tmp_path, "sensor,lat_deg,lon_deg\na,0,0\n", "degrees.csv")
    notes = text(tmp_path, "a note", "README.md")
    (tmp_path / "deeper").mkdir()
    found = record_files([tmp_path], str(stations))
    assert found.files == (tmp_path / "a.CSV", tmp_path / "b.csv")
    assert found.left_out == (notes, other)
    # a file that is named is taken, whatever it is
    assert record_files([notes, tmp_path]).files == (notes, *found.files)


def test_the_shipped_folder_is_ten_records():
    folder = Path(__file__).parents[3] / "calibration" / "data" / "records_example"
    found = record_files([folder], str(folder / "STATIONS.csv"))
    assert [path.stem for path in found.files] == [f"g{k:02d}" for k in range(1, 11)]


def test_a_folder_without_records_is_refused(tmp_path):
    with pytest.raises(InputError, match="folder of records of samples, got none"):
        record_files([tmp_path])
    text(tmp_path, "a note", "README.md")
    with pytest.raises(InputError, match="got 1 other files"):
        record_files([tmp_path])
