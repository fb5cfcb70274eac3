"""One call in Python answers as the command does with the same defaults."""

import json
import math

import numpy as np
import pytest

import jblast as library
from jblast.errors import InputError
from jblast.inference.fitting.fit_input import fit_input
from jblast.observations import Observations, read, to_pandas
from jblast.report.fit_report import fit_document
from jblast.report.flights import flights_answer
from jblast.report.world import run_world
from jblast.study.flight_results import Flights
from jblast.study.flights import has_mission, scene_to_run
from tests.cli.cli_files import HEADER, TWO

FLOWN_CHARGE = "[charge]\nmass_kg = 1.0\n"
FLIGHT = (
    FLOWN_CHARGE
    + """[vehicle]
model = "crazyflie"
position_m = [5.0, 0.0, 2.0]
control = { integral = true }
"""
)
BY_LAND = """
[world]
count = 1
region_m = { box = [[-10, -10, 0], [10, 10, 0]] }
time_s = [0.2, 0.4]
[[sensor]]
name = "gauge"
position_m = [40, 0, 1.5]
records = { air_arrival_s = 1e-4, peak_overpressure_pa = "5%" }
[[sensor]]
name = "north"
position_m = [0, 50, 1.5]
records = { air_arrival_s = 1e-4, peak_overpressure_pa = "5%" }
[[sensor]]
name = "west"
position_m = [-50, -20, 1.5]
records = { air_arrival_s = 1e-4, peak_overpressure_pa = "5%" }
[[sensor]]
name = "south"
position_m = [10, -60, 1.5]
records = { air_arrival_s = 1e-4, peak_overpressure_pa = "5%" }
"""
SHOTS = HEADER.replace("\n", ",shot\n") + (
    "a,air_arrival_s,0.05,0.001,30,0,1,one\nb,air_arrival_s,0.09,0.001,40,0,1,two\n"
)


def same(document, told) -> None:
    """Assert that a document is what the command printed."""
    assert json.loads(json.dumps(document)) == told


@pytest.mark.slow
def test_a_file_and_a_data_frame_are_fitted_as_by_the_command(jblast):
    path = jblast.file("log.csv", TWO)
    code, out, _ = jblast("fit", path, "--json")
    told = json.loads(out)
    answer = library.fit(path)
    same(fit_document(answer), told)
    assert answer.exit_code == code
    words = library.fit(to_pandas(read(path)), laws="auto").summary.estimates
    for name, one in words.items():
        # the same rows by the same program
        assert one.value == pytest.approx(told["estimates"][name]["value"], rel=1e-12)


def test_names_of_parameters_and_laws_are_those_of_the_command(jblast):
    path = jblast.file("log.csv", TWO)
    ready = fit_input(path, freed=["origin_time_s"], laws="kingery_bulmash")
    assert "origin_time_s" in ready.scene.beliefs
    assert dict(ready.scene.scene.law)["air_arrival_s"] == "kingery_bulmash"
    scene = jblast.file("s.toml", '[law]\nair_arrival_s = "wu_hao"\n')
    named = {"air_arrival_s": "kinney_graham"}
    for laws, law in (((), "wu_hao"), (named, "kinney_graham")):
        ready = fit_input(path, scene=scene, laws=laws)
        assert dict(ready.scene.scene.law)["air_arrival_s"] == law
    with pytest.raises(InputError, match=r"^laws nonsense: expected auto, NAME or QUA"):
        library.fit(path, laws=["nonsense"])
    assert "--law nonsense: expected auto" in jblast.refused(
        "fit", path, "--law", "nonsense"
    )


def test_a_log_of_several_shots_is_one_log_each(jblast):
    path = jblast.file("log.csv", SHOTS)
    ready = fit_input(path)
    assert list(ready.logs) == ["log: one", "log: two"]
    assert all(isinstance(log, Observations) for log in ready.logs.values())
    with pytest.raises(InputError, match=r"expected one log, got 2 \(log: one, log: t"):
        library.fit(path)


def test_files_are_logs_of_their_own_or_of_one_event(jblast):
    paths = [jblast.file(f"{name}.csv", TWO) for name in ("one", "two")]
    bad = jblast.file("bad.csv", TWO.replace("20000", "many"))
    ready = fit_input([*paths, bad])
    assert list(ready.readable()) == ["one", "two"]
    assert "expected a finite number" in str(ready.logs["bad"])
    ready = fit_input(paths, one_event=True)
    assert len(ready.only()) == 4
    assert "clock_offset_s.two" in ready.scene.beliefs


@pytest.mark.slow
def test_equations_are_found_as_by_the_command(jblast):
    angles = 0.1 * np.arange(200)
    rows = (f"{t / 2},{math.cos(t)},{-2 * math.sin(t)}\n" for t in angles.tolist())
    path = jblast.file("orbit.csv", "time_s,x_m,v_m_s\n" + "".join(rows))
    code, out, _ = jblast("discover", path, "--json")
    told = json.loads(out)
    search = library.discover_law(path)
    assert search.certain == told["certain"] == (code == 0)
    assert search.members == told["ensemble"]
    assert search.threshold == told["threshold"]
    for state, name in enumerate(search.found.states):
        terms = {t["term"]: t["coefficient"] for t in told["equations"][name]["terms"]}
        row = search.found.coefficients[state]
        names = search.found.candidates.names
        assert {names[j]: row[j] for j in np.flatnonzero(row)} == terms


@pytest.mark.slow
def test_a_vehicle_flies_as_by_the_command(jblast):
    path = jblast.file("scene.toml", FLIGHT)
    words = ("--seconds", "0.6", "--step", "0.002")
    _, out, _ = jblast("fly", path, *words, "--json")
    flights = library.fly(path, seconds=0.6, step_s=0.002)
    assert isinstance(flights, Flights)
    answer = flights_answer(flights, scene=path, seed=0)
    same({"schema": 1} | answer.to_dict(), json.loads(out))


def test_several_vehicles_or_controllers_on_a_mission_are_refused(jblast):
    plan = jblast.path("grid.plan")
    jblast("plan", plan, "--grid", "6,0,1", "--home", "35.3,-80.7,200")
    mission = '[vehicle]\nmodel = "crazyflie"\nmission = "grid.plan"\n'
    path = jblast.file("scene.toml", FLOWN_CHARGE + mission)
    assert has_mission(scene_to_run(path))
    with pytest.raises(InputError, match=r"^vehicles: expected 1 on a mission, got 2"):
        library.fly(path, vehicles=2)
    with pytest.raises(InputError, match=r"^controllers: expected none on a mission"):
        library.fly(path, controllers=["cascade"])


@pytest.mark.slow
def test_a_world_is_written_as_by_the_command(jblast):
    path = jblast.file("world.toml", BY_LAND)
    code, out, _ = jblast("world", path, "--out", jblast.path("one"), "--json")
    run = run_world(path, jblast.path("other"))
    told, document = json.loads(out), json.loads(jblast.text("other/run.json"))
    assert code == 0
    # a call has no words of a command line
    assert told.keys() == document.keys()
    assert told["perceived"] == document["perceived"]
    assert len(run.run.perceived) == len(told["perceived"]) > 0
    for name in ("blasts.csv", "perceived.csv", "observations.csv"):
        assert jblast.text(f"one/{name}") == jblast.text(f"other/{name}")
    with pytest.raises(InputError, match="cannot be written"):
        run_world(path, jblast.path("world.toml"))
