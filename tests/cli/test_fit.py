"""Several logs in one command: a table, one event, and one bad log among them."""

import json
import subprocess
import sys

import numpy as np
import pytest

from jblast.waves import kingery_bulmash_arrival_time, sound_speed_in_air
from tests.cli.cli_files import HEADER


def log(*rows: str, columns: str = "") -> str:
    return HEADER.replace("\n", f"{columns}\n") + "".join(rows)


EVENT = """
[charge]
mass_kg = 15.0
position_m = ["free", "free", 0.0]
time_s = "free"
[air]
relative_humidity = 0.0
[law]
air_arrival_s = "kingery_bulmash"
scatter = false
"""


@pytest.mark.slow
def test_recordings_of_one_event_have_clocks_of_their_own(jblast):
    at, start, late = np.array([3.0, -2.0, 0.0]), 1.5, 12.25
    places = [(30, 0, 0), (0, 40, 0), (-50, 5, 0), (10, -60, 0), (25, 25, 0)]
    places += [(-30, -30, 0)]
    rows = []
    for i, place in enumerate(places):
        distance = float(np.linalg.norm(np.array(place) - at))
        time = float(kingery_bulmash_arrival_time(distance, 15.0))
        reading = start + time + late * (i % 2)
        east, north, up = place
        rows.append(f"s{i},air_arrival_s,{reading!r},1e-4,{east},{north},{up}\n")
    north = jblast.file("north.csv", log(*rows[::2]))
    south = jblast.file("south.csv", log(*rows[1::2]))
    scene = jblast.file("scene.toml", EVENT)
    code, said, err = jblast(
        "fit", north, south, "--one-event", "--scene", scene, "--json"
    )
    assert code == 0, err
    answer = json.loads(said)
    estimates = answer["estimates"]
    # sound of dry standard air is 340.292 m/s, the law's is 340.29: 1e-6 s at 60 m
    assert estimates["clock_offset_s.south"]["value"] == pytest.approx(late, abs=1e-5)
    assert estimates["charge_east_m"]["value"] == pytest.approx(3.0, abs=1e-3)
    assert answer["n_observations"] == 6


MASS, ROWS, SENSORS = 25.0, 10_000, 1000
SIGMA = 5e-4
HELD_MB = 1000
"""About twice what it takes."""

COMMAND = """
import sys
from pathlib import Path
from jblast.cli.main import main
code = main(sys.argv[1:])
status = Path("/proc/self/status").read_text()
print(status.partition("VmHWM:")[2].split()[0], file=sys.stderr)
sys.exit(code)
"""
"""`jblast`, and then the peak of this program alone, in kB: what `resource` tells of a
child is at least what its parent held."""


@pytest.mark.slow
def test_a_log_of_ten_thousand_rows_is_answered(tmp_path):
    rng = np.random.default_rng(0)
    sound_speed = float(sound_speed_in_air(288.15, 101325.0, 0.5))
    ranges = np.geomspace(40.0, 110.0, SENSORS)
    law = kingery_bulmash_arrival_time(ranges, MASS, sound_speed=sound_speed)
    time = np.repeat(np.asarray(law), ROWS // SENSORS)
    # what a record of the law scatters, 1 %, is Student-t as the reading's error is
    time += np.hypot(SIGMA, 0.01 * time) * rng.standard_t(4, ROWS)
    with open(tmp_path / "big.csv", "w") as file:
        file.write("sensor,quantity,value,sigma,range_m\n")
        for row, value in enumerate(time):
            sensor = row * SENSORS // ROWS
            file.write(f"s{sensor},air_arrival_s,{float(value)!r},{SIGMA},")
            file.write(f"{float(ranges[sensor])!r}\n")
    # a process of its own: this one may hold what other tests have left
    words = (sys.executable, "-c", COMMAND, "fit", str(tmp_path / "big.csv"), "--json")
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    mass = answer["estimates"]["charge_mass_kg"]
    assert answer["n_observations"] == ROWS
    assert answer["converged"]
    assert answer["identifiable"]
    # the shot's own scatter, 1 % of the time, is none here
    assert mass["log_sd"] < 0.1
    assert abs(np.log(mass["value"] / MASS)) < 3 * mass["log_sd"]
    assert float(done.stderr.split()[-1]) / 1e3 < HELD_MB
