"""What `make` says of a set-up that cannot be, and that a broken one starts again."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture
def set_up(tmp_path):
    """Return what runs `.ci/setup` in an empty folder with a Python made of `sh`."""
    shutil.copytree(ROOT / ".ci", tmp_path / ".ci")

    def run(body: str) -> str:
        python = tmp_path / "python"
        python.write_text(f"#!/bin/sh\n{body}\n")
        python.chmod(0o755)
        ended = subprocess.run(
            [tmp_path / ".ci/setup", "run"],
            cwd=tmp_path,
            env={**os.environ, "PYTHON": str(python)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert ended.returncode != 0
        assert not (tmp_path / ".venv/run").exists()
        return ended.stdout + ended.stderr

    return run


@pytest.mark.parametrize("version", ["(3, 10)", "(3, 14)"])
def test_an_unsupported_python_is_named(set_up, version):
    change = f"import sys; sys.version_info = {version}"
    said = set_up(f'(echo "{change}"; cat) | "{sys.executable}" "$@"')
    major, minor = version.strip("()").split(", ")
    assert "jblast needs Python 3.11, 3.12 or 3.13" in said
    assert f"is {major}.{minor}" in said


def test_the_step_that_failed_is_named(set_up):
    said = set_up('[ "$1" = - ] && exit 0; echo "no network"; exit 1')
    assert "no network" in said
    assert "Set-up of .venv stopped while making an empty .venv." in said


def test_what_was_cut_short_starts_from_an_empty_folder(set_up, tmp_path):
    (tmp_path / ".venv").mkdir()
    said = set_up('[ "$1" = - ] && exit 0; echo "asked: $*"; exit 1')
    assert "asked: -m venv --clear .venv" in said
