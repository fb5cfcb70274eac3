"""A tuned scene is the scene as it was, but for what was tuned."""

import tomllib
from pathlib import Path

import pytest

from jblast.inference.tuning.unknowns import TUNABLES
from jblast.report.tune import key_words
from jblast.report.tune_files import moved, scene_text, tuned_document
from jblast.scene.reader.scene import scene_from_document
from jblast.scene.reader.tables import keys_of

SCENES = [
    path
    for path in sorted(Path("calibration").rglob("*.toml"))
    if "\noutcomes = " not in path.read_text("utf-8")  # else a study
]
DOCUMENT = {
    "charge": [{"name": "a", "mass_kg": 1.0}, {"name": "b", "mass_kg": 2.0}],
    "sensor": [{"name": 'a "b" \\ c', "kind": "microphone"}, {"name": "d"}],
    "air": {"wind_m_s": [1.0, {"normal": [0.0, 1.0]}]},
    "clock": [{"name": "phone"}],
}


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.name)
def test_a_scene_that_is_written_reads_as_it_was(path):
    document = tomllib.loads(path.read_text("utf-8"))
    assert tomllib.loads(scene_text(document, ["a comment"])) == document


def test_numbers_go_where_their_keys_are():
    values = {
        "low_pass_hz": 900.0,
        "charge_mass_kg.b": 3.0,
        "wind_north_m_s": -2.0,
        "clock_offset_s.phone": 0.5,
        "clock_offset_s.d": 0.25,
        "ambient_level_pa": 0.1,
    }
    tuned = tuned_document(DOCUMENT, values, 'a "b" \\ c')
    tuned = tomllib.loads(scene_text(tuned))
    assert tuned["sensor"][0]["filter_hz"] == ["none", 900.0]
    assert [one["mass_kg"] for one in tuned["charge"]] == [1.0, 3.0]
    assert tuned["air"]["wind_m_s"] == [1.0, -2.0]
    assert tuned["clock"][0]["offset_s"] == 0.5
    assert tuned["sensor"][1]["clock_offset_s"] == 0.25
    assert tuned["ambient"] == {"level_pa": 0.1}
    assert scene_from_document({"air": tuned["air"]}, "s").beliefs.keys() == {
        "charge_mass_kg"
    }
    assert "filter_hz" not in DOCUMENT["sensor"][0]


def test_a_recording_of_the_scene_is_named_from_where_the_new_one_stands(tmp_path):
    document = {"ambient": {"file": "sound/birds.wav"}}
    source = str(tmp_path / "scene.toml")
    named = moved(document, source, tmp_path / "out")["ambient"]["file"]
    assert named == "../sound/birds.wav"


@pytest.mark.parametrize("row", TUNABLES.values(), ids=lambda row: row.name)
def test_what_can_be_tuned_stands_in_a_scene_file(row):
    assert row.key.name in keys_of(row.key.table)
    assert row.key.name in key_words(row.name, "mic")
