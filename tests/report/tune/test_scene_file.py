"""A tuned scene is the user's file, with its comments and other numbers."""

import copy
import tomllib
from functools import partial
from pathlib import Path

import pytest
import tomlkit

from jblast.inference.tuning.scene_file import put_values, tuned_scene
from jblast.inference.tuning.unknowns import TUNABLES
from jblast.report.messages import sentence_of
from jblast.report.tune import change_words, key_words
from jblast.results import problem
from jblast.scene.keys import keys_of

SCENE = """# my scene
[[charge]]
name = "a"
mass_kg = 1.0
[[charge]]
name = "b"
mass_kg = 2.0  # weighed

[[sensor]]
name = 'a "b" \\ c'
[[sensor]]
name = "d"
[air]
wind_m_s = [1.0, { normal = [0.0, 1.0] }]  # from the north
[[clock]]
name = "phone"
[ambient]
file = "sound/birds.wav"
"""
VALUES = {
    "low_pass_hz": 900.0,
    "charge_mass_kg.b": 3.0,
    "wind_north_m_s": -2.0,
    "clock_offset_s.phone": 0.5,
    "clock_offset_s.d": 0.25,
    "ambient_level_pa": 0.1,
    "camera_threshold_darker": 0.3,
}


def test_numbers_go_where_their_keys_are_and_comments_stay(tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE, "utf-8")
    change = partial(put_values, values=VALUES, sensor='a "b" \\ c')
    text = tuned_scene(str(scene), str(tmp_path / "out"), change, ["mass", "second"])
    assert text.startswith("# tuned by jblast ")
    for comment in ("# second", "# my scene", "# weighed", "# from the north"):
        assert comment in text
    expected = tomllib.loads(SCENE)
    expected["sensor"][0]["filter_hz"] = ["none", 900.0]
    expected["sensor"][1]["clock_offset_s"] = 0.25
    expected["charge"][1]["mass_kg"] = 3.0
    expected["air"]["wind_m_s"][1] = -2.0
    expected["clock"][0]["offset_s"] = 0.5
    expected["ambient"] = {"file": "../sound/birds.wav", "level_pa": 0.1}
    expected["camera"] = {"threshold": [0.2, 0.3]}
    assert tomllib.loads(text) == expected
    tables = copy.deepcopy(tomllib.loads(SCENE))
    assert put_values(tables, {"charge_mass_kg": 5.0}, None)["charge"][0] == {
        "name": "a",
        "mass_kg": 5.0,
    }


@pytest.mark.parametrize(
    "path", sorted(Path("calibration").rglob("*.toml")), ids=lambda path: path.name
)
def test_an_unchanged_scene_is_the_same_text(path, tmp_path):
    text = tuned_scene(str(path), str(path.parent), lambda tables: None, ["nothing"])
    own = path.read_text("utf-8")
    assert text.partition("\n")[2] == own or "[ambient]" in own
    assert tomlkit.parse(text).unwrap() == tomllib.loads(own)


@pytest.mark.parametrize("row", TUNABLES.values(), ids=lambda row: row.name)
def test_what_can_be_tuned_stands_in_a_scene_file(row):
    assert row.key.name in keys_of(row.key.table)
    assert row.key.name in key_words(row.name, "mic")


def test_a_key_names_its_sensor_or_charge():
    assert key_words("noise_pa", "mic") == "[[sensor]] 'mic' noise_pa"
    assert key_words("charge_mass_kg.b", None) == "[[charge]] 'b' mass_kg"
    assert key_words("wind_north_m_s", "mic") == "[air] wind_m_s[1]"
    assert key_words("clock_offset_s.d", None) == "[[sensor]] 'd' clock_offset_s"


INFINITE = float("inf")
CHANGES = [
    (0.1, 0.05, "-50.0 %"),
    (INFINITE, INFINITE, ""),
    (0.0, 0.1, ""),
    (0.1, INFINITE, ""),
]


@pytest.mark.parametrize(("before", "after", "words"), CHANGES)
def test_a_change_that_is_no_number_is_not_printed(before, after, words):
    assert change_words(before, after) == words


def test_names_of_a_null_direction_are_joined():
    note = problem("not_separated", names=["a", "b"])
    assert "does not separate a and b: a joint change" in sentence_of(note)
