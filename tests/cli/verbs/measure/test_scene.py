import json
from pathlib import Path

import pytest

from jblast.observations import read, starter_scene
from jblast.scene import read_scene
from tests.cli.cli_files import HEADER, TWO

DATA = Path(__file__).parents[4] / "calibration" / "data"
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

PLACELESS = "sensor,quantity,value,sigma\n"
LOGS = {
    "a flash and its shock": HEADER
    + "a,flash_time_s,10.000001,0.0001,300,0,1\na,air_arrival_s,10.75,0.001,300,0,1\n",
    "one sensor at no place": PLACELESS + "a,peak_overpressure_pa,9000,450\n",
    "ranges": "sensor,quantity,value,sigma,range_m\n"
    "a,peak_overpressure_pa,9000,450,30\nb,peak_overpressure_pa,3000,,60\n",
    "differences": HEADER
    + "a,arrival_difference_s,0.75,0.001,300,0,1\n"
    + "b,arrival_difference_s,1.3,0.001,500,0,1\n",
}


def test_a_scene_is_printed_or_written_and_never_over_another(jblast):
    log = jblast.file("log.csv", TWO)
    code, text, err = jblast("scene", log)
    assert (code, err) == (0, "")
    out = jblast.path("scene.toml")
    code, said, _ = jblast("scene", log, "--out", out)
    assert code == 0
    assert f"jblast fit {log} --scene {out}" in said
    assert jblast.text("scene.toml") == text
    assert "exists already" in jblast.refused("scene", log, "--out", out)
    assert jblast("scene", log, "--out", out, "--force")[0] == 0
    assert "cannot be written" in jblast.refused(
        "scene", log, "--out", jblast.path("log.csv/scene.toml")
    )


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


@pytest.mark.slow
def test_a_flash_frees_the_time_so_that_its_shock_can_be_told(jblast):
    log = jblast.file("log.csv", LOGS["a flash and its shock"])
    scene = jblast.path("scene.toml")
    assert jblast("scene", log, "--out", scene)[0] == 0
    code, out, _ = jblast("fit", log, "--scene", scene, "--json")
    assert code == 0
    assert json.loads(out)["estimates"]["origin_time_s"]["value"] == pytest.approx(10)
