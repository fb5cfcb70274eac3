"""jblast report: what a world's folder holds stands on one page, and nothing else."""

import hashlib
import json
import re

import numpy as np
import pytest
import soundfile

from jblast.report import world_page
from jblast.study.flight_tables import COLUMNS
from tests.report import example

SCENE = """
[world]
count = 2
region_m = { ring = [10, 20] }
time_s = [1, 4]
[[sensor]]
name = "east <b>"
position_m = [60, 0, 1.5]
records = { air_arrival_s = 1e-4 }
"""
HOLD = {
    "peak_deviation_m": 0.25,
    "peak_time_s": 0.5,
    "recovery_time_s": None,
    "peak_overpressure_pa": 8e3,
    "flies_on": True,
}
RUN = {
    "schema": 1,
    "scene": "world.toml",
    "seed": 3,
    "seconds": 6.0,
    "command": "jblast world world.toml --out run --seed 3",
    "date": "2026-01-02T03:04:05+00:00",
    "versions": {"jblast": "0.2.0"},
    "blasts": [
        {"shot": "1", "time_s": 1.25, "position_m": [12.0, 3.0, 0.0], "mass_kg": 2.0},
        {"shot": "2", "time_s": 3.5, "position_m": [-9.0, 7.0, 0.0], "mass_kg": 5.0},
    ],
    "perceived": [
        {"shot": "2", "entity": "east <b>", "sense": "pressure", "time_s": 3.7},
    ],
    "flight": {
        "vehicle": "iris",
        "target_m": [5.0, 0.0, 3.0],
        "tolerance_m": 0.05,
        "holds": {"with_integral": HOLD},
    },
    "sound": {
        "sensors": {"mic": {"kind": "microphone", "file": "mic.wav"}},
    },
    "camera": None,
    "warnings": ["one wave came late"],
}


@pytest.fixture
def world(jblast):
    """A folder as `jblast world` writes it, small."""
    scene = jblast.file("world.toml", SCENE)
    made = json.loads(json.dumps(RUN))
    made["scene"] = str(scene)
    made["scene_sha256"] = hashlib.sha256(SCENE.encode()).hexdigest()
    made["sound"]["sensors"]["mic"]["full_scale_pa"] = 200.0
    (jblast.directory / "run/sound").mkdir(parents=True)
    jblast.file("run/run.json", json.dumps(made))
    names = ["time_s", *(name for part in COLUMNS.values() for name in part)]
    names.append("path_error_m")
    rows = [[t, *np.full(len(names) - 1, 0.1)] for t in np.linspace(0.0, 6.0, 20)]
    table = "\n".join(",".join(f"{x:g}" for x in row) for row in rows)
    jblast.file("run/flight.csv", f"# iris\n{','.join(names)}\n{table}\n")
    sound = np.zeros(6000)
    sound[1300] = 0.5
    soundfile.write(jblast.path("run/sound/mic.wav"), sound, 1000)
    return made


def test_the_page_tells_all_and_needs_nothing_beside_it(jblast, world):
    code, said, err = jblast("report", jblast.path("run"))
    assert code == 0, err
    assert said.startswith("Written: ")
    page = jblast.text("run/report.html")
    assert "2 blasts in 6 s" in page
    assert page.count("data:image/png;base64,") == 2
    assert not re.search(r'(src|href)="(?!data:)', page)
    words = re.sub(r"<[^>]+>", " ", page)
    for told in ("1.2500", "12.00", "3.7000", "0.25 m", "8 kPa", "one wave came late"):
        assert told in words, told
    assert "east &lt;b&gt;" in page  # a name is no markup
    assert world["scene_sha256"] in page


def test_a_loud_sample_is_drawn_however_short_it_is(jblast, world):
    from jblast.report.world_page import read_run

    (wave,) = read_run(jblast.path("run")).waveforms
    assert len(wave.time_s) == 2000
    assert wave.greatest.max() == pytest.approx(100.0, rel=1e-3)  # half of full scale
    assert wave.time_s[wave.greatest.argmax()] == pytest.approx(1.3, abs=6.0 / 2000)


def test_it_is_made_anew_but_no_other_file_is_overwritten(jblast, world):
    run, page = jblast.path("run"), jblast.file("mine.html", "mine")
    assert jblast("report", run)[0] == 0
    assert jblast("report", run)[0] == 0
    assert "exists already" in jblast.refused("report", run, "--out", page)
    assert jblast.text("mine.html") == "mine"
    assert jblast("report", run, "--out", page, "--force")[0] == 0


def test_what_is_missing_or_broken_is_named(jblast, world):
    run = jblast.path("run")
    assert "run.json: no such file" in jblast.refused("report", jblast.path("nowhere"))
    wav = jblast.directory / "run/sound/mic.wav"
    wav.write_bytes(b"RIFF")
    assert "mic.wav: expected sound" in jblast.refused("report", run)
    (jblast.directory / "run/flight.csv").unlink()
    assert "flight.csv: expected a table" in jblast.refused("report", run)
    jblast.file("run/run.json", '{"schema": 1}')
    said = jblast.refused("report", run)
    assert "run.json: expected the JSON of `jblast world --out`" in said


def fitted(jblast, monkeypatch, **answers):
    """Return exit code and stdout of `report --fit` with these answers of the fits."""
    rows = "".join(
        f"mic,air_arrival_s,{time},1e-4,60,0,1.5,{shot}\n"
        for shot, time in (("1", 1.4), ("2", 3.7))
    )
    head = "sensor,quantity,value,sigma,east_m,north_m,up_m,shot\n"
    jblast.file("run/observations.csv", head + rows)
    monkeypatch.setattr(world_page, "fit_each", lambda *_: answers)
    monkeypatch.setattr(world_page, "world_page", lambda *_: "")  # figures take seconds
    code, out, err = jblast("report", jblast.path("run"), "--fit")
    assert err == ""
    assert list(json.loads(jblast.text("run/fits.json"))["logs"]) == list(answers)
    return code, out


def test_an_unidentified_parameter_has_no_interval_that_misses(
    jblast, world, monkeypatch
):
    world["blasts"][0]["time_s"] = 1e-4  # as fitted
    jblast.file("run/run.json", json.dumps(world))
    fits = {"1": example.not_identifiable(), "2": example.three_parameters()}
    code, out = fitted(jblast, monkeypatch, **fits)
    assert code == 4  # mass and sound speed of the first
    assert "Blast 1: not reliable" in out
    # the time of each, and the mass of the second: 209 kg for 5 kg, 0.4 s for 3.5 s
    assert "1 of 3 90 % intervals contain the truth; the remaining ones are" in out
    good = dict.fromkeys(fits, fits["2"])
    assert fitted(jblast, monkeypatch, **good)[0] == 0
