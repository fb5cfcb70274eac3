"""jblast report: the folder of a world on one page, and fits beside the truth."""

import hashlib
import json
import re

import numpy as np
import pytest
import soundfile
from jsonschema import Draft202012Validator

from docs.generate import documents

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
RUN = {
    "schema": 1,
    "scene": "world.toml",
    "seed": 3,
    "seconds": 6.0,
    "command": "jblast world world.toml --out run --seed 3",
    "date": "2026-01-02T03:04:05+00:00",
    "versions": {"jblast": "0.2.0"},
    "scene_sha256": hashlib.sha256(SCENE.encode()).hexdigest(),
    "laws": {},
    "blasts": [
        {"shot": "1", "time_s": 1.25, "position_m": [12.0, 3.0, 0.0], "mass_kg": 2.0},
        {"shot": "2", "time_s": 3.5, "position_m": [-9.0, 7.0, 0.0], "mass_kg": 5.0},
    ],
    "perceived": [
        {"shot": "2", "entity": "east <b>", "sense": "pressure", "time_s": 3.7},
    ],
    "not_perceived": 1,
    "readings": 2,
    "flight": None,
    "sound": {
        "seconds": 6.0,
        "laws": {},
        "sensors": {
            "mic": {
                "kind": "microphone",
                "file": "mic.wav",
                "rate_hz": 1000.0,
                "samples": 6000,
                "air_arrival_s": 1.3,
                "ground_arrival_s": None,
                "positive_duration_s": 0.01,
                "clipped": False,
                "clipped_samples": 0,
                "largest_overpressure_pa": 100.0,
                "full_scale_pa": 200.0,
            }
        },
        "skipped": {},
        "warnings": [],
    },
    "imu": None,
    "camera": None,
    "warnings": ["one wave came late"],
    "mission": None,
    "detections": None,
    "fits": None,
}


@pytest.fixture
def run(jblast):
    """A folder as `jblast world` writes it, small."""
    scene = jblast.file("world.toml", SCENE)
    (jblast.directory / "run/sound").mkdir(parents=True)
    jblast.file("run/run.json", json.dumps(RUN | {"scene": scene}))
    sound = np.zeros(6000)
    sound[1300] = 0.5
    soundfile.write(jblast.path("run/sound/mic.wav"), sound, 1000)
    rows = "".join(
        f"mic,air_arrival_s,{time},1e-4,60,0,1.5,{shot}\n"
        for shot, time in (("1", 1.4), ("2", 3.7))
    )
    head = "sensor,quantity,value,sigma,east_m,north_m,up_m,shot\n"
    jblast.file("run/observations.csv", head + rows)
    return jblast.path("run")


def test_the_page_has_all_and_needs_no_other_file(jblast, run):
    code, out, err = jblast("report", run, "--json")
    assert (code, err) == (0, "")
    document = json.loads(out)
    Draft202012Validator(documents.schema("world")).validate(document)
    assert document == RUN | {"scene": jblast.path("world.toml")}
    page = jblast.text("run/report.html")
    assert "2 blasts in 6 s" in page
    # timeline, map, waveforms and spectrograms
    assert page.count("data:image/png;base64,") == 4
    assert not re.search(r'(src|href)="(?!data:)', page)
    words = re.sub(r"<[^>]+>", " ", page)
    for fact in ("1.2500", "12.00", "3.7000", "mic.wav", "one wave came late"):
        assert fact in words, fact
    assert "east &lt;b&gt;" in page
    assert RUN["scene_sha256"] in page


def test_missing_or_broken_files_are_named(jblast, run):
    assert "run.json: no such file" in jblast.refused("report", jblast.path("nowhere"))
    jblast.file("other.toml", SCENE + "\n")
    words = ("report", run, "--scene", jblast.path("other.toml"))
    assert "other.toml: has changed since" in jblast.refused(*words)
    (jblast.directory / "run/sound/mic.wav").write_bytes(b"RIFF")
    assert "mic.wav: expected sound" in jblast.refused("report", run)
    expected = "run.json: expected the output folder of `jblast world --out`"
    for text in ('{"schema": 1}', "[]", "{"):
        jblast.file("run/run.json", text)
        assert expected in jblast.refused("report", run)
