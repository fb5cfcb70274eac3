"""First scenes of logs with latitudes, dates and clocks read back as the log is."""

import numpy as np
import pytest

from jblast.observations import read, resolve_positions, starter_scene
from jblast.observations.grouping import located
from jblast.observations.scenes import for_log
from jblast.scene import default_scene, read_scene

HEAD = "sensor,quantity,value_utc,sigma,clock,lat_deg,lon_deg,alt_m\n"
ROWS = [
    f"{name},{quantity},2024-05-17T12:00:0{second}Z,0.01,{name},{place},1500\n"
    for name, place in (("a", "33.9,35.5"), ("b", "33.9,35.51"), ("c", "33.91,35.5"))
    for quantity, second in (("flash_time_s", 1), ("air_arrival_s", 3))
]


@pytest.fixture
def start(tmp_path):
    def write(text):
        (tmp_path / "log.csv").write_text(text)
        log = read(tmp_path / "log.csv")
        (tmp_path / "scene.toml").write_text(starter_scene(log))
        return log, read_scene(tmp_path / "scene.toml")

    return write


def test_it_frees_what_the_default_scene_does_at_the_same_places(start):
    log, uncertain = start(HEAD + "".join(ROWS))
    assert uncertain.beliefs.keys() == for_log(default_scene(), log).beliefs.keys()
    there = located(log, uncertain)
    assert there.frame == log.frame
    settled = resolve_positions(there, uncertain.scene, uncertain.beliefs)
    np.testing.assert_array_equal(settled.position, log.position)
    assert float(uncertain.scene.air.altitude) == 1500.0


def test_clocks_that_nothing_sets_are_commented_out(start):
    rows = [row for row in ROWS if "flash" not in row]
    log, uncertain = start(HEAD + "".join(rows))
    assert not [name for name in uncertain.beliefs if "clock" in name]
    text = starter_scene(log)
    assert text.count("# [[clock]]") == 2
    assert '# name = "b"' in text
