"""`jblast fit` of a log whose rows name records of samples."""

import json
import subprocess

import numpy as np
import pytest

from calibration.cases import (
    MASS,
    RANGES,
    Recorder,
    readings,
    recorded,
)
from tests.cli.cli_files import JBLAST

HEAD = "sensor,quantity,value,sigma,east_m,north_m,up_m,record\n"


@pytest.fixture
def log(tmp_path):
    """A log of three simulated gauges, 15 to 28 m from 15 kg."""
    rng = np.random.default_rng(5)
    records = recorded(rng, readings(rng, scatter=True), Recorder(snr=20.0))
    rows = HEAD
    for gauge in (2, 3, 4):
        one = records[gauge]
        pairs = zip(one.time_s.tolist(), one.samples.tolist(), strict=True)
        text = "time_s,pressure_pa\n" + "".join(f"{t:.9f},{p:.3f}\n" for t, p in pairs)
        (tmp_path / f"g{gauge}.csv").write_text(text)
        rows += f"g{gauge},overpressure_record,,,{RANGES[gauge]},0,0,g{gauge}.csv\n"
    (tmp_path / "log.csv").write_text(rows)
    return tmp_path / "log.csv"


@pytest.mark.slow  # a process of its own, that compiles
def test_a_log_of_samples_is_answered_from_a_shell(log):
    words = ("fit", str(log), "--law", "kingery_bulmash", "--json")
    done = subprocess.run([*JBLAST, *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    mass = answer["estimates"]["charge_mass_kg"]
    assert mass["q05"] < MASS < mass["q95"]
    # laws scatter by 10 % a shot, which no record takes away
    assert 0.02 < mass["log_sd"] < 0.15
    assert answer["converged"]


def test_a_law_of_what_is_read_off_samples_may_be_named(jblast):
    row = "a,overpressure_record,,,10,0,0,none.csv\n"
    words = ("fit", jblast.file("log.csv", HEAD + row), "--law")
    said = jblast.refused(*words, "kingery_bulmash")
    assert "none.csv" in said
    said = jblast.refused(*words, "ground_motion")
    assert "expected a law for a quantity of the log" in said
