"""What a user installs: versions that agree, pinned packages, data files."""

import re
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
LOCKS = sorted((ROOT / ".ci").glob("*.lock"))
DATA = sorted(path.name for path in (ROOT / "jblast/waves/data").iterdir())
each_lock = pytest.mark.parametrize("lock", LOCKS, ids=lambda path: path.name)


def requirements(lock: Path) -> dict[str, str]:
    """By package name: the whole entry, its hashes included."""
    lines = lock.read_text().replace("\\\n", " ").splitlines()
    entries = [line for line in lines if line and not line.lstrip().startswith("#")]
    return {re.split(r"[=<>@ \[;]", entry)[0]: entry for entry in entries}


def test_the_version_is_the_same_wherever_it_stands():
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.M)
    assert cited is not None
    assert PROJECT["version"] == jblast.__version__ == cited[1]


def test_there_is_a_lock_for_each_use_and_one_of_what_installs_them():
    assert [lock.name for lock in LOCKS] == [
        "dev.lock",
        "docs.lock",
        "run.lock",
        "setup.lock",
    ]
    assert list(requirements(ROOT / ".ci/setup.lock")) == ["uv"]


@each_lock
def test_every_locked_package_has_one_version_and_its_hashes(lock):
    for name, entry in requirements(lock).items():
        assert re.match(r"[\w.-]+==[\w.]+ ", entry), name
        assert "--hash=sha256:" in entry, name


@each_lock
def test_locks_name_no_place_to_download_from(lock):
    assert not re.search(r"://|--(extra-)?index-url|--find-links", lock.read_text())


@pytest.mark.parametrize("name", ["dev.lock", "docs.lock", "run.lock"])
def test_every_dependency_is_locked(name):
    lock = ROOT / ".ci" / name
    names = {re.split(r"[<>=\[ ]", need)[0] for need in PROJECT["dependencies"]}
    assert names <= requirements(lock).keys()


def test_all_locks_pin_the_same_versions():
    run, dev, docs = (
        {
            (name, version)
            for name, version in re.findall(
                r"^([\w.-]+)==([\w.]+)", (ROOT / ".ci" / lock).read_text(), re.M
            )
        }
        for lock in ("run.lock", "dev.lock", "docs.lock")
    )
    assert run <= dev
    assert run <= docs
    developed = {name for name, _ in dev}
    assert {pin for pin in docs if pin[0] in developed} <= dev


def test_every_dependency_says_why_it_is_one():
    text = (ROOT / "pyproject.toml").read_text()
    lines = [line for line in text.splitlines() if line.startswith("    ")]
    for need in PROJECT["dependencies"]:
        (line,) = (line for line in lines if line.startswith(f'    "{need}",'))
        assert re.search(r"# \w+", line), need


def test_type_checkers_are_told_that_the_package_is_typed():
    assert files("jblast").joinpath("py.typed").is_file()


@pytest.mark.parametrize("name", DATA)
def test_data_files_are_found_as_resources(name):
    assert files("jblast.waves").joinpath("data", name).is_file()


def test_the_explosion_is_found_as_a_resource_and_is_small():
    folder = files("jblast.sensors.camera").joinpath("explosion")
    index = tomllib.loads(folder.joinpath("views.toml").read_text("utf-8"))
    sheets = [folder.joinpath(view["file"]) for view in index["view"]]
    assert len(sheets) >= 32
    assert all(sheet.is_file() for sheet in sheets)
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
    assert {f"jblast/waves/data/{name}" for name in DATA} <= packed
    assert "jblast/py.typed" in packed
    assert {name for name in packed if name.startswith("jblast/")} == ours
    assert any(name.endswith("licenses/LICENSE") for name in packed)
