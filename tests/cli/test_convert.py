"""`jblast convert`, `scene` and `check` of logs."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from jblast.observations import read, starter_scene
from jblast.scene import read_scene
from tests.cli.cli_files import HEADER

FORENSIC = (
    "Sensor;Quantity;Value;Sigma;East (ft);North (ft);Note\n"
    "gate;peak_overpressure_psi;1,5;0,1;100;0;near\n"
    "gate;Arrival (ms);81,25;0,5;100;0;\n"
    "mast;peak_level_db;164;1,5;0;400;phone\n"
    "mast;positive_duration_ms;NA;;0;400;\n"
)


def test_a_log_is_written_in_our_units_with_what_was_done(jblast):
    code, out, _ = jblast(
        "convert", jblast.file("theirs.txt", FORENSIC), "--out", jblast.path("log.csv")
    )
    assert code == 0
    assert "peak_overpressure_psi was converted to peak_overpressure_pa" in out
    text = jblast.text("log.csv")
    assert text.startswith("# converted from theirs.txt by jblast ")
    for said in (
        "decimal comma",
        "left out: line 5",
        "up = 0",
        "columns: Note",
        "20 uPa",
    ):
        assert said in text
    ours = read(jblast.path("log.csv"))
    theirs = read(jblast.path("theirs.txt"))
    np.testing.assert_array_equal(ours.value, theirs.value)
    np.testing.assert_array_equal(ours.sigma, theirs.sigma)
    np.testing.assert_array_equal(ours.position, theirs.position)
    assert not ours.understood


def test_a_wide_table_is_told_the_option_and_made_long_by_it(jblast):
    frame = pd.DataFrame(
        {
            "sensor": ["a", "b"],
            "range_m": [20, 40],
            "air_arrival_ms": [30.0, 90.0],
            "sigma_air_arrival_ms": [1.0, 1.0],
            "peak_overpressure_kpa": [40.0, np.nan],
        }
    )
    frame.to_excel(jblast.path("wide.xlsx"), index=False)
    wide = jblast.path("wide.xlsx")
    code, _, said = jblast("convert", wide)
    assert (code, "read a wide table with --wide" in said) == (2, True)
    code, _, _ = jblast("convert", wide, "--wide", "--out", jblast.path("long.csv"))
    assert code == 0
    long = read(jblast.path("long.csv"))
    assert long.sensor == ("a", "a", "b")
    np.testing.assert_allclose(long.value, [0.03, 4e4, 0.09])
    np.testing.assert_allclose(long.sigma, [0.001, np.nan, 0.001])


DATA = Path(__file__).parents[2] / "calibration" / "data"
SOURCE_TABLES = {
    "acoustic_ford2021",
    "charge_200g_incident_2m",
    "hrr5_infrapy_detections",
    "hrr5_infrasound_arrivals",
    "point_source_s1x4",
    "rotorpy_flights",
    "seismic_ford2021",
}
"""No logs, but what calibration scripts read."""

ASKED = {"six_clips": {"date": "2024-05-17", "zone": "UTC"}}
"""What the logs do not say themselves."""


@pytest.mark.parametrize(
    "log",
    [log for log in sorted(DATA.glob("*.csv")) if log.stem not in SOURCE_TABLES],
    ids=lambda log: log.stem,
)
def test_the_scene_of_a_real_log_reads_back(tmp_path, log):
    asked = ASKED.get(log.stem, {})
    said = read(log, date=asked.get("date"), zone=asked.get("zone"))
    text = starter_scene(said)
    (tmp_path / "scene.toml").write_text(text)
    assert "charge_mass_kg" in read_scene(tmp_path / "scene.toml").beliefs


BAD = (
    HEADER
    + "a,air_arrival_s,0.25,-1,120,0,0\n"
    + "b,air_arrival_s,0.5,0.001,0,200,0\n"
    + "c,air_arrival_s,0.72,0.001,-280,0,0\n"
    + "d,air_arrival_s,3600.95,0.001,-280,-220,0\n"
    + "e,air_arrival_s,soon,0.001,100,-220,0\n"
)


def test_map_coordinates_are_no_mistake(jblast):
    code, text, _ = jblast("check", str(DATA.parents[1] / "tests" / "data" / "utm.csv"))
    assert code == 0
    assert text.splitlines()[0] == "The log can be fitted: no faults or warnings"
    assert "charge mass, charge east, charge north and origin time" in " ".join(
        text.split()
    )


def test_the_json_has_every_line_that_the_text_has(jblast):
    code, text, _ = jblast("check", jblast.file("log.csv", BAD), "--json")
    document = json.loads(text)
    assert (code, document["schema"], document["rows"]) == (2, 1, 3)
    assert len(document["faults"]) == 2
    (warning,) = document["warnings"]
    assert warning["kind"] == "clock_of_another_zone"
    assert (warning["lines"], warning["sensors"]) == ([5], ["d"])


@pytest.mark.parametrize(
    "name", ["five_microphones", "camera_and_bang", "hri_2", "hta_1", "trinity"]
)
def test_logs_that_ship_are_not_doubted(jblast, name):
    code, text, _ = jblast(
        "check", str(DATA / f"{name}.csv"), "--scene", str(DATA / f"{name}.toml")
    )
    assert code == 0
    assert text.splitlines()[0] == "The log can be fitted: no faults or warnings"
