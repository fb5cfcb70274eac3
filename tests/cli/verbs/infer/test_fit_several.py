"""Several logs in one command: a table, one event, and one bad log among them."""

import csv
import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from docs.generate.documents import schema
from jblast.waves import kingery_bulmash_arrival_time, kingery_bulmash_pressure
from tests.cli.cli_files import HEADER
from tests.test_schemas import check


def pressures(mass: float, shot: str = "") -> list[str]:
    rows = []
    for name, distance in (("a", 20.0), ("b", 40.0)):
        value = float(kingery_bulmash_pressure(distance, mass))
        column = f",{shot}" if shot else ""
        rows.append(
            f"{name},peak_overpressure_pa,{value!r},{0.02 * value!r},"
            f"{distance},0,0{column}\n"
        )
    return rows


def log(*rows: str, columns: str = "") -> str:
    return HEADER.replace("\n", f"{columns}\n") + "".join(rows)


@pytest.mark.slow
def test_several_logs_give_a_table_and_a_bad_one_fails_alone(jblast, tmp_path):
    good = jblast.file("good.csv", log(*pressures(15.0)))
    other = jblast.file("other.csv", log(*pressures(40.0)))
    bad = jblast.file("bad.csv", log("a,peak_overpressure_pa,-1,1,20,0,0\n"))
    out = jblast.path("out")
    code, said, _ = jblast("fit", good, bad, other, "--out", out)
    assert code == 4
    assert "2 of 3 logs fitted" in said
    assert said.index("good") < said.index("other") < said.index("Not fitted")
    assert "bad: " in said
    assert "column value" in " ".join(said.split())
    with (tmp_path / "out" / "answers.csv").open() as file:
        rows = {row["log"]: row for row in csv.DictReader(file)}
    assert float(rows["good"]["value"]) == pytest.approx(15.0, rel=1e-3)
    assert float(rows["other"]["value"]) == pytest.approx(40.0, rel=1e-3)
    told = json.loads((tmp_path / "out" / "fits.json").read_text("utf-8"))
    check(schema("fits"), told)
    for name in ("good", "other", "bad"):
        made = told["logs"][name]["provenance"]
        held = Path(jblast.path(f"{name}.csv")).read_bytes()
        own = {"name": f"{name}.csv", "sha256": hashlib.sha256(held).hexdigest()}
        assert made["logs"] == [own]
        assert made["command"].startswith("jblast fit")
    assert "column value" in rows["bad"]["error"]
    assert rows["bad"]["value"] == ""


EVENT = """
[charge]
mass_kg = 15.0
position_m = ["free", "free", 0.0]
time_s = "free"
[air]
relative_humidity = 0.0
[law]
air_arrival_s = "kingery_bulmash"
scatter = false
"""


@pytest.mark.slow
def test_recordings_of_one_event_have_clocks_of_their_own(jblast):
    at, start, late = np.array([3.0, -2.0, 0.0]), 1.5, 12.25
    places = [(30, 0, 0), (0, 40, 0), (-50, 5, 0), (10, -60, 0), (25, 25, 0)]
    places += [(-30, -30, 0)]
    rows = []
    for i, place in enumerate(places):
        distance = float(np.linalg.norm(np.array(place) - at))
        time = float(kingery_bulmash_arrival_time(distance, 15.0))
        reading = start + time + late * (i % 2)
        east, north, up = place
        rows.append(f"s{i},air_arrival_s,{reading!r},1e-4,{east},{north},{up}\n")
    north = jblast.file("north.csv", log(*rows[::2]))
    south = jblast.file("south.csv", log(*rows[1::2]))
    scene = jblast.file("scene.toml", EVENT)
    code, said, err = jblast(
        "fit", north, south, "--one-event", "--scene", scene, "--json"
    )
    assert code == 0, err
    answer = json.loads(said)
    estimates = answer["estimates"]
    # sound of dry standard air is 340.292 m/s, the law's is 340.29: 1e-6 s at 60 m
    assert estimates["clock_offset_s.south"]["value"] == pytest.approx(late, abs=1e-5)
    assert estimates["charge_east_m"]["value"] == pytest.approx(3.0, abs=1e-3)
    assert answer["n_observations"] == 6


def test_no_log_at_all_that_can_be_fitted_exits_2(jblast):
    bad = [
        jblast.file(f"{name}.csv", log("a,peak_overpressure_pa,-1,1,20,0,0\n"))
        for name in "xy"
    ]
    code, _, err = jblast("fit", *bad)
    assert code == 2
    assert "none of 2 logs" in err
    assert err.count("expected") == 2  # the reason of each
