"""A mission from the shell: what is refused, and one that is flown."""

import csv
import json

import pytest
from jsonschema import Draft202012Validator

from docs.generate.documents import schema
from jblast.missions import grid_plan, read_plan, write_plan
from jblast.scene import Place
from tests.cli.cli_files import says, table

HOME = Place(35.3075, -80.7353, 200.0)
SCENE = """
[charge]
mass_kg = 0.5
position_m = [1.0, 4.0, 0.0]
time_s = 8.0
[vehicle]
model = "crazyflie"
mission = "short.plan"
"""


def scene(jblast, text=SCENE):
    plan = grid_plan(HOME, width_m=6.0, depth_m=0.0, spacing_m=1.0, up_m=3.0)
    write_plan(plan, jblast.path("short.plan"))
    return jblast.file("scene.toml", text)


@pytest.mark.slow
def test_a_mission_is_flown_from_ground_to_ground_and_told(jblast):
    options = ("--out", jblast.path("out"), "--plan-out", jblast.path("b.plan"))
    code, out, err = jblast("fly", scene(jblast), *options, "--debug")
    assert (code, err) == (0, ""), err
    assert out.startswith("Crazyflie on ")
    # the lines of the head depend on the length of the plan's path
    head = " ".join(out.partition("\n\n")[0].split())
    assert "landed, disarmed after" in head
    assert "4 of 4 waypoints reached" in head
    document = json.loads(jblast.text("out/fly.json"), parse_constant=pytest.fail)
    Draft202012Validator(schema("fly_mission")).validate(document)
    points = document["waypoints"]
    assert [one["index"] for one in points] == [1, 2, 3, 4]
    assert all(one["reached"] and one["error_m"] < 1.0 for one in points)
    times = [one["time_s"] for one in points]
    assert times == sorted(times)
    assert document["completed"]
    assert document["disarmed_s"] == times[-1]
    (blast,) = document["disturbances"]
    assert blast["waypoint"] in (2, 3)
    assert blast["peak_deviation_m"] > blast["error_before_m"]
    written = {path.name for path in (jblast.directory / "out").iterdir()}
    assert written == {
        *("fly.json", "flight.csv", "flight.png", "map.png", "report.html"),
        *("mission.geojson", "mission.kml"),
    }
    rows = list(csv.DictReader(jblast.text("out/flight.csv").splitlines()[1:]))
    assert float(rows[0]["up_m"]) == 0.0
    assert abs(float(rows[-1]["up_m"])) < 1e-9
    features = json.loads(jblast.text("out/mission.geojson"))["features"]
    kinds = [one["properties"]["kind"] for one in features]
    assert kinds == ["planned", "flown", "home", *["waypoint"] * 4, "blast"]
    lon, lat, _ = features[-1]["geometry"]["coordinates"]
    assert abs(lat - HOME.lat_deg - 4.0 / 111e3) < 1e-6
    assert abs(lon - HOME.lon_deg) < 2e-5
    assert read_plan(jblast.path("b.plan")).items == tuple(
        read_plan(jblast.path("short.plan")).items
    )


@pytest.mark.slow
def test_by_its_instruments_it_lands_as_well_and_each_blast_is_told(jblast):
    options = ("--estimator", "ekf", "--out", jblast.path("out"), "--json")
    code, out, err = jblast("fly", scene(jblast), *options, "--debug")
    assert (code, err) == (0, ""), err
    document = json.loads(out)
    Draft202012Validator(schema("fly_mission")).validate(document)
    assert document["completed"]
    assert document["estimator"] == "ekf"
    (thrown,) = document["estimates"]
    # fixes are 0.4 m off, and the filter is better than one
    assert 0.01 < thrown["place_before_m"] < 0.5
    assert thrown["place_m"] >= thrown["place_before_m"]
    # it believes to be on its way: of the truth the estimate's error is left
    errors = [one["path_error_rms_m"] for one in document["waypoints"]]
    assert 0.02 < max(errors) < 0.8
    words = jblast("fly", scene(jblast), "--estimator", "ekf")[1]
    assert "Error of the estimate" in words


# what of the scene is changed to what, then options
REFUSED = table("""
short.plan -> a.plan; => a.plan | no such file
time_s = 8.0 -> time_s = 8.0;--vehicles 3 => --vehicles | expected 1
time_s = 8.0 -> time_s = 8.0;--estimator ekf --step 0.03 => expected at most 0.02 s
position_m = [1.0, 4.0, 0.0] -> range_m = 5.0; => range_m
model -> position_m = [0, 0, 3] / model; => starts in the air
time_s = 8.0 -> time_s = 8.0;--plan-out short.plan => exists already
time_s = 8.0 -> time_s = 8.0;--plan-out b.kml => b.kml | .plan
""")


@pytest.mark.parametrize(("asked", "said"), REFUSED)
def test_what_cannot_be_flown_is_refused(jblast, monkeypatch, asked, said):
    monkeypatch.chdir(jblast.directory)
    change, _, options = asked.partition(";")
    text = SCENE.replace(*change.replace(" / ", "\n").split(" -> "))
    says(jblast.refused("fly", scene(jblast, text), *options.split()), said)
