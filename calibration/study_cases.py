"""The studies whose speed is measured, from texts."""

import tempfile
from pathlib import Path

from jblast.study import Study, read_study

AIR = """
[charge]
mass_kg = { lognormal = [10.0, 2.0] }
position_m = [{ normal = [0.0, 1.0] }, 0.0, 0.0]
[law]
scatter = false
air_arrival_s = "kingery_bulmash"
peak_overpressure_pa = "kingery_bulmash"
"""
HOVER = """
[charge]
mass_kg = { lognormal = [1.0, 1.2] }
position_m = [5.0, 0.0, 0.0]
time_s = 0.5
[vehicle]
model = "crazyflie"
position_m = [0.0, 0.0, 2.0]
"""
PLACES = [(20.0 + 5.0 * n, 3.0 * n, 0.0) for n in range(16)]


def study_of(scene: str, study: str) -> Study:
    """Return a study from texts."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "scene.toml").write_text(scene)
        path = Path(folder) / "study.toml"
        path.write_text(f'scene = "scene.toml"\n{study}')
        return read_study(path)


def sensors(count: int, records: str = "") -> str:
    """Return the tables of so many sensors."""
    return "".join(
        f'[[sensor]]\nname = "s{n}"\nposition_m = {list(PLACES[n])}\n{records}\n'
        for n in range(count)
    )


def air_study(count: int, samples: int) -> Study:
    """Return the study of arrivals and pressures at so many sensors."""
    asked = '["air_arrival_s", "peak_overpressure_pa"]'
    head = f'samples = {samples}\nkeep = "summary"\noutcomes = {asked}\n'
    return study_of(AIR + sensors(count), head)
