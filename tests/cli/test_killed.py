"""A walk that is killed outright goes on where it was, to the same answer."""

import json
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from tests.cli.cli_files import JBLAST

DATA = Path(__file__).parents[2] / "calibration" / "data"
WAITED = 300.0
"""Seconds until something must have been kept."""


def walk(out: Path, *options: str) -> subprocess.Popen:
    """Begin a fit by walkers."""
    log, scene = DATA / "hta_1.csv", DATA / "hta_1.toml"
    asked = [str(log), "--scene", str(scene), "--posterior", "emcee"]
    command = [*JBLAST, "fit", *asked]
    return subprocess.Popen(
        [*command, "--out", str(out), *options],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )


def finish(command: subprocess.Popen) -> None:
    _, said = command.communicate()
    assert command.returncode == 0, said.decode()


@pytest.mark.slow
@pytest.mark.parametrize("way", [signal.SIGKILL, signal.SIGINT])
def test_a_killed_walk_goes_on_to_the_answer_of_an_unbroken_one(tmp_path, way):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    finish(walk(whole))
    command = walk(broken)
    kept = broken / "walk"
    begun = time.monotonic()
    while not list(kept.glob("steps-*.npz")):
        assert command.poll() is None, command.stderr
        assert time.monotonic() - begun < WAITED
        time.sleep(0.01)
    command.send_signal(way)
    command.communicate()
    stretches = [len(list(path.glob("steps-*.npz"))) for path in (kept, whole / "walk")]
    assert stretches[0] < stretches[1]
    if way == signal.SIGKILL:  # nothing was reported: the same command goes on
        assert command.returncode == -signal.SIGKILL
        assert [path.name for path in broken.iterdir()] == ["walk"]
        finish(walk(broken))
    else:  # what was sampled is reported, and said to be cut short
        assert command.returncode == 4
        answer = json.loads((broken / "fit.json").read_text())
        assert not answer["converged"]
        assert any("stopped by Ctrl-C" in said for said in answer["warnings"])
        finish(walk(broken, "--force"))
    answers = [json.loads((out / "fit.json").read_text()) for out in (whole, broken)]
    made = [answer.pop("provenance") for answer in answers]
    assert answers[0] == answers[1]
    # another command at another time, of the same files
    assert made[0]["logs"] == made[1]["logs"]
    assert made[0]["scene"] == made[1]["scene"]
    for one in (whole / "walk").glob("*.npz"):
        with np.load(one) as a, np.load(kept / one.name) as b:
            for name in a.files:
                np.testing.assert_array_equal(a[name], b[name])
