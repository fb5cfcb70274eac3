"""A log of ten thousand rows is answered, in memory that a laptop has."""

import json
import subprocess
import sys

import numpy as np
import pytest

from jblast.waves import kingery_bulmash_arrival_time, sound_speed_in_air

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
