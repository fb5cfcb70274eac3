"""A study that tests share: one program for all."""

from pathlib import Path

from jblast.study import Study, read_study

SCENE = """
[charge]
mass_kg = { lognormal = [10.0, 2.0] }
position_m = [0.0, 0.0, 0.0]
time_s = { normal = [0.0, 0.05] }
[law]
scatter = false
air_arrival_s = "wu_hao"
[[sensor]]
name = "near"
position_m = [20.0, 0.0, 0.0]
[[sensor]]
name = "far"
position_m = [0.0, 50.0, 0.0]
"""
STUDY = """
scene = "scene.toml"
seed = 7
samples = 300
outcomes = ["air_arrival_s"]
"""


def written(folder: Path, study: str = STUDY, scene: str = SCENE) -> Path:
    """Write a study and its scene; return the study's path."""
    (folder / "scene.toml").write_text(scene)
    path = folder / "study.toml"
    path.write_text(study)
    return path


def study_in(folder: Path, study: str = STUDY, scene: str = SCENE) -> Study:
    """Return the study that was written."""
    return read_study(written(folder, study, scene))
