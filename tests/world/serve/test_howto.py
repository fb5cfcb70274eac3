"""The manual's program flies in a process of its own, and gets the path of one process.

The server is `jblast serve` as a user starts it; world and program are the page's.
Slow: three processes that start from nothing.
"""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from docs.generate import documents
from jblast.scene import read_world
from jblast.vehicle import blast_load, hold_of, simulate, start_of, vehicle_of
from jblast.world import draw_world
from tests.cli.cli_files import JBLAST

PAGE = Path(__file__).parents[3] / "docs" / "howto" / "serve.md"
SECONDS, SEED = 1.5, 3
pytestmark = pytest.mark.slow


def block(language: str) -> str:
    """Return the first block of a language on the page."""
    (found, *_) = re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(), re.S)
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("served")
    (folder / "world.toml").write_text(block("toml"))
    (folder / "drone.py").write_text(block("python"))
    return folder


@pytest.fixture(scope="module")
def served(folder):
    """The path of the program, and the answer of the server."""
    words = ["serve", str(folder / "world.toml"), "--listen", "127.0.0.1:0", "--json"]
    words += ["--seconds", f"{SECONDS:g}", "--seed", str(SEED), "--lead", "0.5"]
    words += ["--patience", "600"]  # programs compile for long on a busy machine
    env = os.environ | {"PYTHONPATH": str(PAGE.parents[2])}
    pipe = subprocess.PIPE
    server = subprocess.Popen([*JBLAST, *words], stdout=pipe, stderr=pipe, text=True)
    try:
        assert server.stderr is not None
        line = server.stderr.readline()
        (address,) = re.findall(r"with 3 blasts on (\S+), 100 packets", line)
        out = folder / "path.npy"
        drone = [sys.executable, str(folder / "drone.py"), address, str(out)]
        subprocess.run(drone, check=True, env=env)
        server.send_signal(signal.SIGINT)
        said, errors = server.communicate(timeout=60)
    finally:
        server.kill()
        server.wait()
    assert (server.returncode, errors) == (0, "")
    return np.load(out), json.loads(said)


@pytest.fixture(scope="module")
def alone(folder):
    """The path of one process, in one go."""
    scene = draw_world(*read_world(folder / "world.toml"), SEED).scene
    assert scene.vehicle is not None
    flight = simulate(
        vehicle_of(scene.vehicle),
        start_of(scene.vehicle),
        duration_s=SECONDS,
        control=hold_of(scene.vehicle, integral=False),
        loads=(blast_load(scene),),
        ground_up_m=0.0,
        store_every=20,
    )
    return np.asarray(flight.position_m)


def test_the_path_of_the_program_is_that_of_one_process(served, alone):
    """To rounding: each packet's flight counts time from its own beginning, by 1e-16 s
    another front; what that moves grows by the flight's few time constants."""
    thrown = np.linalg.norm(alone - alone[0], axis=1).max()
    assert thrown > 0.02
    np.testing.assert_allclose(served[0], alone, rtol=0, atol=1e-11)


def test_a_server_that_is_interrupted_says_what_came_of_it(served):
    document = served[1]
    Draft202012Validator(documents.schema("serve")).validate(document)
    assert document["blasts"] == 3
    assert document["packets"] == 150
    assert document["dropped"] == []
