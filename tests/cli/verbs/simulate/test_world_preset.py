"""jblast world --preset: marked in all that it writes, refused where it contradicts."""

import json

import pytest

from jblast.report.world import MARK

SCENE = """
[world]
count = 1
region_m = { box = [[-10, -10, 0], [10, 10, 0]] }
time_s = [0.2, 0.4]
[[sensor]]
name = "gauge"
kind = "pressure"
position_m = [40, 0, 1.5]
records = { air_arrival_s = 1e-6 }
"""
CODED = ("--preset", "thesis-as-coded")


@pytest.fixture
def run(jblast):
    scene = jblast.file("scene.toml", SCENE)
    words = ("world", scene, "--out", jblast.path("run"), "--seconds", "0.7")
    return (*words, *CODED)


def test_a_run_by_a_preset_is_marked_in_what_it_prints_and_writes(jblast, run):
    code, out, err = jblast(*run)
    assert (code, err) == (0, ""), err
    assert out.startswith(f"preset thesis-as-coded: {MARK}\n")
    told = json.loads(jblast.text("run/run.json"))
    assert told["preset"]["name"] == "thesis-as-coded"
    assert told["preset"]["mark"] == MARK
    for name in ("blasts.csv", "perceived.csv", "observations.csv"):
        assert MARK in jblast.text(f"run/{name}")


@pytest.mark.slow
def test_its_page_is_marked_and_its_readings_are_not_fitted(jblast, run):
    assert jblast(*run)[0] == 0
    code, _, err = jblast("report", jblast.path("run"))
    assert code == 0, err
    assert MARK in jblast.text("run/report.html")
    code, _, err = jblast("report", jblast.path("run"), "--fit", "--force")
    assert code == 2
    assert "--fit: expected a run without a preset" in err


def test_a_scene_that_contradicts_a_preset_is_refused(jblast, run):
    jblast.file("scene.toml", SCENE + '[law]\nair_arrival_s = "kingery_bulmash"\n')
    code, _, err = jblast(*run)
    assert code == 2
    assert "[law] air_arrival_s: expected 'wu_hao' (preset" in err
