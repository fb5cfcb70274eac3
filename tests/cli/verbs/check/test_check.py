"""The verb that says everything that is wrong with a log at once."""

import json
from pathlib import Path

import pandas as pd
import pytest

from jblast.observations import read
from tests.cli.cli_files import HEADER, TWO

DATA = Path(__file__).parents[4] / "calibration" / "data"
BAD = (
    HEADER
    + "a,air_arrival_s,0.25,-1,120,0,0\n"
    + "b,air_arrival_s,0.5,0.001,0,200,0\n"
    + "c,air_arrival_s,0.72,0.001,-280,0,0\n"
    + "d,air_arrival_s,3600.95,0.001,-280,-220,0\n"
    + "e,air_arrival_s,soon,0.001,100,-220,0\n"
)


def test_a_clean_log_exits_0_and_is_written_as_it_was_understood(jblast):
    log, out = jblast.file("log.csv", TWO), jblast.path("out.csv")
    code, text, err = jblast("check", log, "--out", out)
    assert (code, err) == (0, "")
    assert text.startswith("The log can be fitted: no faults or warnings\n")
    assert read(out).value.tolist() == read(log).value.tolist()
    code, _, err = jblast("check", log, "--out", out)
    assert code == 2
    assert "exists already" in err


def test_faults_and_warnings_are_all_told_in_one_go(jblast):
    log, out = jblast.file("log.csv", BAD), jblast.path("out.csv")
    code, text, err = jblast("check", log, "--out", out)
    assert (code, err) == (2, "")
    assert "line 2, column sigma" in text
    assert "line 6, column value" in text
    assert "line 5: the clock of d looks 1 h fast" in " ".join(text.split())
    assert not Path(out).exists()
    assert max(map(len, text.splitlines())) <= 96


def test_map_coordinates_are_no_mistake(jblast):
    code, text, _ = jblast("check", str(DATA.parents[1] / "tests" / "data" / "utm.csv"))
    assert code == 0
    assert text.splitlines()[0] == "The log can be fitted: no faults or warnings"
    assert "charge mass, charge east, charge north and origin time" in " ".join(
        text.split()
    )


def test_faults_of_a_workbook_name_its_rows(jblast):
    rows = [line.split(",") for line in BAD.replace("soon", "-").splitlines()]
    frame = pd.DataFrame(rows[1:], columns=rows[0])
    frame.to_excel(jblast.path("log.xlsx"), index=False)
    code, text, _ = jblast("check", jblast.path("log.xlsx"))
    assert code == 2
    assert "row 2, column sigma: expected a positive number" in " ".join(text.split())
    assert "row 5: the clock of d" in " ".join(text.split())
    assert "line" not in text


def test_what_is_wrong_is_told_once(jblast):
    log = (
        "sensor,quantity,value_kpa,sigma_percent,east_m,north_m,up_m\n"
        "a,peak_overpresure,5,10,50,0,0\n"
        "b,peak_overpressure,5,10,50,x,0\n"
        "c,peak_overpressure,5,10,50,,0\n"
    )
    code, text, _ = jblast("check", jblast.file("log.csv", log))
    assert (code, "3 faults" in text) == (2, True)


def test_the_json_has_every_line_that_the_text_has(jblast):
    code, text, _ = jblast("check", jblast.file("log.csv", BAD), "--json")
    document = json.loads(text)
    assert (code, document["schema"], document["rows"]) == (2, 1, 3)
    assert len(document["faults"]) == 2
    (warning,) = document["warnings"]
    assert warning["kind"] == "clock_of_another_zone"
    assert (warning["lines"], warning["sensors"]) == ([5], ["d"])


def test_clips_are_not_doubted_for_clocks_of_their_own(jblast):
    clips = str(DATA / "six_clips.csv")
    code, text, _ = jblast("check", clips, "--date", "2024-05-17", "--zone", "UTC")
    assert code == 0
    assert text.splitlines()[0] == "The log can be fitted: no faults or warnings"
    assert "the centre of the sensors" in " ".join(text.split())
    code, text, _ = jblast("check", clips)
    assert code == 2
    assert text.count("expected a date") == 1


@pytest.mark.parametrize(
    "name", ["five_microphones", "camera_and_bang", "hri_2", "hta_1", "trinity"]
)
def test_logs_that_ship_are_not_doubted(jblast, name):
    code, text, _ = jblast(
        "check", str(DATA / f"{name}.csv"), "--scene", str(DATA / f"{name}.toml")
    )
    assert code == 0
    assert text.splitlines()[0] == "The log can be fitted: no faults or warnings"
