"""Logs and records as people have them, and may not: one message that says where.

Each names the file, the row and the column where there is one, what was expected and
what came.
"""

from pathlib import Path

import numpy as np
import pytest

from tests.cli.cli_files import HEADER, TWO, says, table

# a log beneath the header of others, or a slash and a whole one; " / " ends a line
LOGS = table("""
/sensor,quantity,value / a,air_arrival_s,1 => line 1 | missing column sigma
a,air_arival_s,1,0.1,30,0,1 => line 2 | air_arival_s | did you mean air_arrival_s
a,air_arrival_s,abc,0.1,30,0,1 => line 2 | value | a finite number | 'abc'
a,air_arrival_s,1,-0.1,30,0,1 => sigma | -0.1
a,air_arrival_s,1,0,30,0,1 => sigma | positive
a,positive_duration_s,-1,0.1,30,0,1 => value | positive_duration_s | -1
a,air_arrival_s,1,1,3,0,1 / a,air_arrival_s,1,1,3,0,1 => line 3 | duplicate of line 2
a,air_arrival_s,nan,0.1,30,0,1 => a value in some row
a,air_arrival_s,1,inf,30,0,1 => sigma | inf
a,air_arrival_s,1,0.1,-inf,0,1 => east_m | -inf
/ => empty | header
/# nothing here => empty | header
 => nothing after the header
a,air_arrival_s,1 => line 2 | 7 fields | got 3
a,air_arrival_s,1,0.1,30,0,1,9 => line 2 | got 8
a,impulse_kPa_ms,1,0.1,30,0,1 => impulse_kPa_ms | positive_impulse_kpa_ms
/sensor,impulse_kPa_ms,range_m / a,1,2 => impulse_kPa_ms | positive_impulse_kpa_ms
a,air_arival_s,abc,-1,30 / b,impulse_kPa_ms,nan,0,1,2,3 => line 2
/sensor,quantity,value,sigma / a,air_arrival_s,1,.1 => range_m
""")
SCENES = table("""
[charge] / mas_kg = 1 => [charge] mas_kg | mass_kg
[chrge] => chrge | did you mean charge
[charge] / mass_kg = -1 => mass_kg | positive | -1
[charge => broken TOML | line 1
[charge] / mass_kg = { uniform = [3, 1] } => mass_kg | hi of uniform | above 3, got 1
[law] / air_arrival_s = "kingery" => kingery_bulmash
[[charge]] / name = "x" / [[charge]] / name = "y" => shot | 'x', 'y' | got nothing
[camera] => [camera] position_m | or mount with offset_m, got nothing
[vehicle] => [vehicle] model | got nothing
[world] / count = 0 => [world] count | got 0
[law] / positive_duration_s = "ford_2020" => _duration_s | did you mean ford_2021
[air] / altitude_m = 100 / temperature_k = 280 => altitude_m | temperature_k
[charge] / mass_kg = 1.0 => nothing to fit | --free
[[sensor]] / name = "a" / position_m = [1, 2, 3] => sensor 'a' | [30, 0, 1] | [1, 2, 3]
""")
OPTIONS = table("""
--free clock_offset_s.c => no such clock | expected one of a, b
--free clock_offset_s => clock_offset_s.NAME
--free charge_mass_kg.main => did you mean charge_mass_kg
--free charge_mas_kg => did you mean charge_mass_kg
--free charge_range_m,charge_east_m => charge_range_m | charge_east_m
--law nobody => expected auto | 'nobody'
--law air_arrival=wu_hao => did you mean air_arrival_s
--law air_arrival_s=ford_2021 => wu_hao | 'ford_2021'
--law ford_2021 => a quantity of the log
--law arrival_difference_s=wu_hao => air_arrival_s and ground_arrival_s
--noise cauchy => student | gaussian
--seed 3 => unrecognized
--scene  => expected a path
""")


@pytest.mark.parametrize(("rows", "said"), LOGS)
def test_a_bad_log_exits_2_with_says(jblast, rows, said):
    text = rows[1:] if rows[:1] == "/" else HEADER + rows
    text = "".join(f"{line}\n" for line in text.split(" / ") if line)
    says(jblast.refused("fit", jblast.file("log.csv", text), "--json"), said)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (TWO.encode("utf-16-le"), "control character"),
    ],
)
def test_a_log_in_another_encoding_is_refused(jblast, content, said):
    says(jblast.refused("fit", jblast.file("log.csv", content)), said)


@pytest.mark.parametrize(("content", "said"), SCENES)
def test_a_bad_scene_exits_2_with_says(jblast, content, said):
    content = content.replace(" / ", "\n") + "\n"
    log, scene = jblast.file("log.csv", TWO), jblast.file("scene.toml", content)
    says(jblast.refused("fit", log, "--scene", scene), said)


@pytest.mark.parametrize(("option", "said"), OPTIONS)
def test_a_bad_option_exits_2(jblast, option, said):
    err = jblast.refused("fit", jblast.file("log.csv", TWO), *option.split(" ", 1))
    assert all(part in err for part in said.split(" | "))


def test_a_log_and_a_scene_that_are_not_there_are_named(jblast):
    says(jblast.refused("fit", jblast.path("no.csv")), "no.csv | no such")
    log = jblast.file("log.csv", TWO)
    err = jblast.refused("fit", log, "--scene", jblast.path("no.toml"))
    says(err, "no.toml | no such")


def test_a_place_that_cannot_be_written_is_refused_before_the_fit(jblast, tmp_path):
    log = jblast.file("log.csv", TWO)
    (tmp_path / "full").mkdir()
    jblast.file("full/held", "mine")
    jblast.file("full/fit.json", "mine")
    for out, words in (
        ("full", "fit.json | exists already | --force"),
        ("full/held", "File exists"),
        ("full/held/deeper", "Not a directory"),
    ):
        says(jblast.refused("fit", log, "--out", jblast.path(out)), words)
    assert jblast.text("full/held") == "mine"


def test_debug_adds_the_traceback(jblast):
    code, out, err = jblast("fit", jblast.path("no.csv"), "--debug")
    assert (code, out) == (2, "")
    assert "Traceback" in err
    assert err.splitlines()[-1].startswith("jblast: ")


def test_no_verb_and_an_unknown_verb_exit_2_and_say_which_there_are(jblast):
    for arguments in ((), ("frobnicate",)):
        err = jblast.refused(*arguments)
        assert all(verb in err for verb in ("fit", "scene", "simulate"))


def test_help_names_every_parameter_that_can_be_freed(jblast):
    from jblast.scene import PARAMETERS

    code, out, _ = jblast("fit", "--help")
    assert code == 0
    assert ", ".join(PARAMETERS) in " ".join(out.split())
    assert "sensor,quantity,value,sigma" in out


AT = "sensor,quantity,value,sigma"
DEGREES = "lat_deg,lon_deg,alt_m"
UTC = f"sensor,quantity,value_utc,sigma,{DEGREES} / a,air_arrival_s,"
ROWS = table(f"""
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


@pytest.mark.parametrize(("content", "said"), ROWS)
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
