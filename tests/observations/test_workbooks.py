"""Spreadsheets and Parquet hold one table; what is in the way is told by its place."""

import datetime
import io
from typing import Any

import numpy as np
import pandas as pd
import pytest

from jblast.errors import InputError
from jblast.observations import read
from jblast.report.messages import sentences_of

FRAME = pd.DataFrame(
    {
        "Sensor": ["a", "b", "c"],
        "quantity": ["peak_overpressure_kpa", "air_arrival_ms", "air_arrival_ms"],
        "Value": [1 / 3, 12.5, 20],
        "sigma": [0.1, np.nan, 1],
        "range (ft)": [100, 200, 300],
    }
)
ENGINES: dict[str, Any] = {"log.xlsx": "openpyxl", "log.ods": "odf"}


def saved(path, *parts, **where):
    """A workbook of frames, each where it is said to be."""
    with pd.ExcelWriter(path, engine=ENGINES[path.name]) as book:
        for frame, at in parts:
            frame.to_excel(book, index=False, **at)
    return path


@pytest.mark.parametrize("name", ["log.xlsx", "log.ods", "log.parquet"])
def test_a_table_is_read_to_the_last_digit(tmp_path, name):
    path = tmp_path / name
    if name in ENGINES:
        saved(path, (FRAME, {}))
    else:
        FRAME.to_parquet(path)
    for source in (path, io.BytesIO(path.read_bytes())):
        log = read(source)
        np.testing.assert_array_equal(log.value, [1e3 / 3, 12.5e-3, 20e-3])
        np.testing.assert_allclose(log.slant_range, [30.48, 60.96, 91.44])
        assert log.understood[0].kind in ("sheet", "format")


@pytest.mark.parametrize("name", ENGINES)
def test_two_sheets_are_refused(tmp_path, name):
    parts = [(FRAME, {"sheet_name": "x"}), (FRAME, {"sheet_name": "y"})]
    with pytest.raises(InputError, match="'x', 'y'"):
        read(saved(tmp_path / name, *parts))


OTHER = pd.DataFrame({"station": ["x"], "weather": ["dry"], "who": ["me"]})
TITLE = pd.DataFrame({"Shot 12": []})


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ([(FRAME, {}), (FRAME, {"startrow": 6})], "row 7, .*'quantity'"),
        ([(FRAME, {}), (FRAME, {"startrow": 4})], "row 5, .*'quantity'"),
        ([(FRAME, {}), (OTHER, {"startrow": 4})], "row 5, .*'weather'"),
        ([(FRAME, {}), (FRAME, {"startcol": 6})], "row 1: .*sensor once, got"),
        ([(FRAME, {}), (OTHER, {"startcol": 6})], "row 1: unknown column 'station'"),
        (
            [(FRAME, {}), (FRAME, {"startcol": 28, "startrow": 2})],
            "row 1: .*a name above every column",
        ),
        (
            [(OTHER, {}), (FRAME, {"startrow": 3})],
            "row 1: .*got 'station, weather, who'",
        ),
        ([(pd.DataFrame(), {})], "only empty ones"),
    ],
)
def test_two_tables_or_none_are_refused(tmp_path, parts, said):
    with pytest.raises(InputError, match=f"log.xlsx: .*{said}"):
        read(saved(tmp_path / "log.xlsx", *parts))


def test_titles_above_the_names_are_read_with_them(tmp_path):
    rows = [
        ["Gauge", "Position", None, None, "Readings", None],
        [None, "east", "north", "up", "air_arrival", "peak_overpressure"],
        ["-", "m", "m", "m", "ms", "kPa"],
        ["gate", 60, 10, 0, 146.472093, 7.705322],
    ]
    path = tmp_path / "log.xlsx"
    pd.DataFrame(rows).to_excel(path, index=False, header=False)
    log = read(path, wide=True)
    assert log.sensor == ("gate", "gate")
    np.testing.assert_allclose(log.value, [0.146472093, 7705.322])
    np.testing.assert_array_equal(log.position, [[60, 10, 0]] * 2)
    assert log.where(0).endswith("row 4")
    said = sentences_of(log.understood)
    assert "rows 1 and 2 were read as one header" in said
    assert "Gauge was read as sensor" in said
    titled = saved(path, (TITLE, {}), (FRAME, {"startrow": 1}))
    assert len(read(titled)) == 3


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (
            datetime.datetime(2026, 5, 3),
            "row 3, column Value: .*a date, into",
        ),
        (True, "row 3, column Value: .*got 'True'"),
        ("1 234", "row 3, column Value: .*got '1 234'"),
        ("0,5", "one decimal mark"),
    ],
)
def test_a_cell_that_is_no_number_is_named(tmp_path, value, said):
    frame = FRAME.astype(object)
    frame.loc[1, "Value"] = value
    with pytest.raises(InputError, match=said):
        read(saved(tmp_path / "log.xlsx", (frame, {})))


@pytest.mark.parametrize("name", ["log.xlsx", "log.ods", "log.parquet"])
def test_a_damaged_file_is_told(tmp_path, name):
    (tmp_path / name).write_bytes(b"PK\x03\x04 and no more")
    with pytest.raises(InputError, match=r"expected a complete .*which cannot be read"):
        read(tmp_path / name)
