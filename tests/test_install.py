"""Installation: versions that agree, pinned packages, data files, set-up that stops."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from importlib.resources import files
from pathlib import Path

import pytest

import jblast

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
LOCKS = {path.stem: path.read_text() for path in (ROOT / ".ci").glob("*.lock")}


def pins(lock: str) -> dict[str, str]:
    """Return the version of each package of a lock."""
    lines = LOCKS[lock].replace("\\\n", " ").splitlines()
    entries = [line for line in lines if line and not line.lstrip().startswith("#")]
    found = [re.match(r"([\w.-]+)==([\w.]+) .*--hash=sha256:", one) for one in entries]
    assert all(found), entries[found.index(None)]
    return {one[1]: one[2] for one in found if one}


def test_the_version_is_the_same_wherever_it_stands():
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.M)
    assert cited is not None
    assert PROJECT["version"] == jblast.__version__ == cited[1]


def test_locks_pin_every_dependency_once_with_its_hash():
    assert list(pins("setup")) == ["uv"]
    run, dev, docs = map(pins, ("run", "dev", "docs"))
    assert run.items() <= dev.items()
    assert run.items() <= docs.items()
    assert {name: docs[name] for name in docs if name in dev}.items() <= dev.items()
    names = {re.split(r"[<>=\[ ]", need)[0] for need in PROJECT["dependencies"]}
    assert names <= run.keys()
    for text in LOCKS.values():
        assert not re.search(r"://|--(extra-)?index-url|--find-links", text)


def test_every_dependency_has_its_reason():
    lines = (ROOT / "pyproject.toml").read_text().splitlines()
    for need in PROJECT["dependencies"]:
        (line,) = (line for line in lines if line.startswith(f'    "{need}",'))
        assert re.search(r"# \w+", line), need


def test_the_explosion_is_found_as_a_resource_and_is_small():
    folder = files("jblast.sensors.camera").joinpath("explosion")
    index = tomllib.loads(folder.joinpath("views.toml").read_text("utf-8"))
    sheets = [folder.joinpath(view["file"]) for view in index["view"]]
    assert len(sheets) >= 32
    assert sum(len(sheet.read_bytes()) for sheet in sheets) <= 8e6


@pytest.mark.slow
def test_the_wheel_holds_the_whole_package_and_its_data(tmp_path):
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation"]
    command += ["--outdir", str(tmp_path), str(ROOT)]
    subprocess.run(command, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    packed = set(zipfile.ZipFile(wheel).namelist())
    ours = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "jblast").rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }
    assert "jblast/py.typed" in packed
    assert {name for name in packed if name.startswith("jblast/")} == ours
    assert any(name.endswith("licenses/LICENSE") for name in packed)


@pytest.mark.parametrize(
    ("python", "message"),
    [
        (
            '(echo "import sys; sys.version_info = (3, 14)"; cat) |'
            f' "{sys.executable}" "$@"',
            "jblast needs Python 3.11, 3.12 or 3.13, and",
        ),
        ('[ "$1" = - ] && exit 0; exit 1', "stopped while making an empty .venv."),
        ('[ "$1" = - ] && exit 0; echo "asked: $*"; exit 1', "asked: -m venv --clear"),
    ],
    ids=["unsupported", "failed", "cut short"],
)
def test_a_set_up_that_stops_names_its_step(tmp_path, python, message):
    shutil.copytree(ROOT / ".ci", tmp_path / ".ci")
    (tmp_path / ".venv").mkdir()
    script = tmp_path / "python"
    script.write_text(f"#!/bin/sh\n{python}\n")
    script.chmod(0o755)
    ended = subprocess.run(
        [tmp_path / ".ci/setup", "run"],
        cwd=tmp_path,
        env={**os.environ, "PYTHON": str(script)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode != 0
    assert not (tmp_path / ".venv/run").exists()
    assert message in ended.stdout + ended.stderr
