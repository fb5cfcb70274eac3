"""Logs and records as people have them, and may not: one message that says where.

Each names the file, the row and the column where there is one, what was expected and
what came.
"""

from pathlib import Path

import numpy as np
import pytest

from tests.cli.cli_files import says, table

AT = "sensor,quantity,value,sigma"
DEGREES = "lat_deg,lon_deg,alt_m"
UTC = f"sensor,quantity,value_utc,sigma,{DEGREES} / a,air_arrival_s,"
LOGS = table(f"""
{AT.replace("value", "value_kpa,value_psi")},range_m / a,x,5,1,1,20 =>\
 line 1 | 'value_kpa' and 'value_psi'
{AT},range_m,range_ft / a,air_arrival_s,1,1,2,6 =>\
 line 1 | range_m once | 'range_m' and 'range_ft'
{AT},{DEGREES},east_m,north_m,up_m / a,air_arrival_s,1,1,3,3,1,,, /\
 b,air_arrival_s,1,1,,,,1,0,0 =>\
 line 3, column east_m | expected all places | got metres beside degrees
{AT},{DEGREES},east_m,north_m,up_m / a,air_arrival_s,1,1,3,3,1,3,4,5 =>\
 line 2, column east_m | got metres beside degrees
{UTC}15:08:18.3,0.01,33.9,35.5,10 =>\
 line 2, column value_utc | expected a date | got '15:08:18.3'
{UTC}2020-08-04T15:08:18.3,1,3,3,1 =>\
 line 2, column value_utc | expected a zone | got '2020-08-04T15:08:18.3'
{AT},range_m / a,peak_overpressure_pa,"1,234",9,20 => line 2, column value | 1,234
time_s,pressure_pa{"".join(f" / {i / 100},{i % 7}" for i in range(50))} =>\
 line 1 | time_s, pressure_pa | a record of samples
{AT},range_m / a,peak_overpressure_furlong,5,1,20 => line 2, column quantity | furlong
""")


@pytest.mark.parametrize(("content", "said"), LOGS)
def test_a_bad_log_is_told_by_row_and_column(jblast, content, said):
    log = jblast.file("log.csv", content.replace(" / ", "\n") + "\n")
    says(jblast.refused("fit", log), f"log.csv | {said}")
    code, out, err = jblast("check", log)
    told = " ".join(f"{out} {err}".split())
    assert code == 2
    assert all(word in told for word in ["log.csv", *said.split(" | ")]), told


def test_a_workbook_with_two_tables_is_told_by_sheet_and_row(jblast):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("openpyxl")
    row = {"sensor": "a", "quantity": "air_arrival_s", "value": 0.05, "sigma": 1e-3}
    table = pandas.DataFrame([row | {"range_m": 30.0}])
    sheets, one = jblast.path("sheets.xlsx"), jblast.path("one.xlsx")
    with pandas.ExcelWriter(sheets) as book:
        for name in "AB":
            table.to_excel(book, sheet_name=name, index=False)
    with pandas.ExcelWriter(one) as book:
        for start in (0, 5):
            table.to_excel(book, index=False, startrow=start)
    message = jblast.refused("fit", sheets)
    assert "expected one sheet with one table, got 'A', 'B'" in message
    assert "row 6, column quantity: unknown quantity" in jblast.refused("fit", one)


@pytest.mark.parametrize("verb", ["fit", "check", "pick"])
def test_ten_gigabytes_are_refused_before_they_are_read(jblast, verb):
    path = Path(jblast.path("huge.csv"))
    with path.open("wb") as file:
        file.truncate(10 * 1024**3)  # a hole: it takes no room on the disk
    message = jblast.refused(verb, str(path))
    assert "expected" in message
    assert "got 10.7 GB" in message


TIME = np.arange(400) * 1e-3
PULSE = np.where(TIME >= 0.2, 900.0 * np.exp(-(TIME - 0.2) / 0.02), 0.0)


def record(time=TIME, pressure=PULSE, header="time_s,pressure_pa"):
    rows = zip(time, pressure, strict=True)
    return header + "\n" + "".join(f"{t:.6f},{p:.3f}\n" for t, p in rows)


def changed(values, index, value):
    values = values.copy()
    values[index] = value
    return values


ONCE = np.delete(np.arange(400), range(100, 120))
RECORDS = [
    (record(changed(TIME, 100, TIME[99])), "line 102 | a time after | got 0.099 s"),
    (record(changed(TIME, 100, TIME[50])), "line 102 | a time after | got 0.05 s"),
    (record(TIME[ONCE], PULSE[ONCE]), "line 102 | every 0.001 s | a gap of 0.021 s"),
    (record(pressure=np.full(400, np.nan)), "pressure_pa | got 'nan'"),
    (record(pressure=changed(PULSE, 100, np.nan)), "line 102 | a number | got 'nan'"),
    (record(header="time_s,voltage_v"), "column voltage_v | --sensitivity"),
]


@pytest.mark.parametrize(("content", "said"), RECORDS)
def test_a_bad_record_is_told_by_row_and_column(jblast, content, said):
    says(jblast.refused("pick", jblast.file("rec.csv", content)), f"rec.csv | {said}")


def test_all_bad_records_are_told_in_one_message(jblast):
    """That others beside them are picked, and kept, stands in `test_pick`."""
    files = [jblast.file(f"r{i}.csv", text) for i, (text, _) in enumerate(RECORDS)]
    message = jblast.refused("pick", *files)
    assert message.count("\n") == 1
    assert all(file in message for file in files)
