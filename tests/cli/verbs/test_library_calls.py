"""One call in Python answers as the command does with the same defaults."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import jblast as library
from docs.generate import documents
from jblast.errors import InputError
from jblast.inference.fitting.fit_input import fit_input
from jblast.observations import Observations, read, to_pandas
from jblast.report.detect import detect_answer
from jblast.report.fit_report import fit_document
from jblast.report.flights import flights_answer
from jblast.report.world import run_world
from jblast.sensors.camera.files.event_files import EVENT_FORMATS, Written, read_events
from jblast.sensors.camera.files.images import write_png
from jblast.sensors.camera.film import film_to_events
from jblast.sensors.camera.film_writer import write_film
from jblast.signals.detect_files import SoundDetections
from jblast.study.filming import FilmOptions, film_of
from jblast.study.flight_results import Flights
from jblast.study.flights import has_mission, scene_to_run
from tests.cli.cli_files import HEADER, TWO
from tests.cli.verbs.infer.detect.sounds import recording, template, write
from tests.cli.verbs.simulate.render.scenes import CAMERA, CHARGE
from tests.cli.verbs.simulate.test_fly import (
    CHARGE as FLOWN_CHARGE,
    OWN,
    VEHICLE,
)
from tests.cli.verbs.simulate.test_world import BY_LAND

EXAMPLE = Path(__file__).parents[3] / "calibration" / "data" / "records_example"
FLIGHT = FLOWN_CHARGE + VEHICLE + OWN
SILENT = "time_s,pressure_pa\n" + "".join(f"{k},0\n" for k in range(20))
SHOTS = HEADER.replace("\n", ",shot\n") + (
    "a,air_arrival_s,0.05,0.001,30,0,1,one\nb,air_arrival_s,0.09,0.001,40,0,1,two\n"
)


def same(document, told) -> None:
    """Assert that a document is what the command printed."""
    assert json.loads(json.dumps(document)) == told


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
    ready = fit_input(path, laws={"air_arrival_s": "kinney_graham"})
    assert dict(ready.scene.scene.law)["air_arrival_s"] == "kinney_graham"
    with pytest.raises(InputError, match=r"^laws nonsense: expected auto, NAME or QUA"):
        library.fit(path, laws=["nonsense"])
    assert "--law nonsense: expected auto" in jblast.refused(
        "fit", path, "--law", "nonsense"
    )


def test_records_without_a_bang_or_without_stations_are_refused(jblast):
    path = jblast.file("a.csv", SILENT)
    stations = jblast.file("stations", "sensor,east_m,north_m,up_m\na,10,0,0\n")
    with pytest.raises(InputError, match=r"a\.csv: expected records of a blast"):
        library.fit(path, positions=stations)
    with pytest.raises(
        InputError, match="is a folder; for a folder of records also pass positions"
    ):
        library.fit(EXAMPLE)
    assert library.pick_files(path).found.silent == ("a",)


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


def test_sound_is_searched_as_by_the_command(jblast):
    path = write(jblast, "far.wav", recording([[1.0], [1.1]]))
    pulse = template(jblast)
    _, out, _ = jblast("detect", path, "--template", pulse, "--json")
    found = library.detect(path, template=pulse)
    assert isinstance(found, SoundDetections)
    assert found.detected
    document = detect_answer(found).document.to_dict()
    same(document, json.loads(out))
    Draft202012Validator(documents.schema("detect")).validate(document)


def test_the_kind_of_a_recording_is_that_of_its_suffix(tmp_path):
    with pytest.raises(InputError, match="recordings: expected a file, got none"):
        library.detect([])
    with pytest.raises(InputError, match="without sound; got 2 recordings"):
        library.detect(["a.wav", "a.mp4"])
    for suffix in EVENT_FORMATS:
        with pytest.raises(InputError, match="no such file"):
            library.detect(tmp_path / f"a{suffix}", size=(64, 48))
    (tmp_path / "a.wav").touch()
    with pytest.raises(
        InputError, match=r"^fps: expected it with frames or video only"
    ):
        library.detect(tmp_path / "a.wav", fps=50.0)


def test_a_scene_without_a_camera_is_no_place_of_a_film(tmp_path):
    for number in range(2):
        write_png(tmp_path / f"{number}.png", np.zeros((6, 8, 1)))
    scene = library.Scene(library.Charge(mass_kg=1.0))
    with pytest.raises(InputError, match=r"^scene: expected the \[camera\]"):
        library.detect(tmp_path, fps=1000.0, scene=scene)


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


def test_a_film_and_its_events_are_those_of_the_commands(jblast):
    path = jblast.file("scene.toml", CHARGE + CAMERA)
    words = ("--times", "2.0:2.006", "--mode", "rgb", "--json")
    _, out, _ = jblast("render", path, *words, "--out", jblast.path("one"))
    film = film_of(path, FilmOptions(times=(2.0, 2.006), mode="rgb"))
    made = write_film(film, jblast.path("other"), mode="rgb")
    assert made.found is None
    assert json.loads(out)["frames"] == len(film.times) == 3
    frames = Path(jblast.path("one")) / "frames"
    for file in frames.iterdir():
        assert (
            file.read_bytes()
            == (Path(made.files.frames or "") / file.name).read_bytes()
        )
    events, again = jblast.path("events.npz"), jblast.path("again.npz")
    words = ("--fps", "500", "--noise", "off", "--srgb", "--json")
    _, out, _ = jblast("events", str(frames), *words, "--out", events)
    made = film_to_events(frames, again, fps=500.0, noise=False, srgb=True)
    told = json.loads(out)
    assert made.written._asdict() == {key: told[key] for key in Written._fields}
    assert made.threshold == tuple(told["threshold"])
    assert made.darkest == told["darkest"]
    one, other = read_events(events), read_events(again)
    np.testing.assert_array_equal(one.t, other.t)
