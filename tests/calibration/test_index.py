"""The index of calibration and the folder hold the same, in both directions."""

import re
from fnmatch import fnmatch
from pathlib import Path

import pytest

from docs.generate.results import index_rows

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "calibration"
RESULTS = FOLDER / "results"
INDEX = (FOLDER / "INDEX.md").read_text("utf-8")
ROWS = index_rows(ROOT)
SHARED = re.findall(r"^\| `(\w+)` \| [^|]+ \| ([^|]+) \|$", INDEX, re.MULTILINE)
"""Modules without a measurement of their own, and the scripts that import them."""
EXAMPLES = re.findall(r"^\| (data/[^|]+) \| [^|]+ \| ([^|]+) \|$", INDEX, re.MULTILINE)
SHOWN_BY = ("docs/**/*.md", "*.md", "calibration/results/*.md", "notebooks/*.ipynb")


def files(folder: Path) -> set[str]:
    """Return all files below a folder, relative to it."""
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def matches(names: set[str], patterns: list[str]) -> set[str]:
    return {name for name in names if any(fnmatch(name, one) for one in patterns)}


def scripts() -> list[str]:
    """Return the scripts of the index that measure."""
    return [row[0].split()[0] for row in ROWS if not row[0].startswith("git ")]


def located(name: str) -> Path:
    """Return the place that an entry of the data column names."""
    top = name.partition("/")[0]
    return (FOLDER if top in ("data", "scenes", "studies", "results") else ROOT) / name


def test_every_script_is_listed_and_every_listed_script_exists():
    listed = {*scripts(), *(name for name, _ in SHARED)}
    assert listed == {path.stem for path in FOLDER.glob("*.py")} - {"__init__"}


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_parts_data_results_and_pages_of_a_row_exist(row):
    command, _, data, kept, pages = row
    script, _, part = command.partition(" ")
    text = (FOLDER / f"{script}.py").read_text("utf-8") if script != "git" else ""
    if part and text:
        assert re.search(rf'"{part}": ', text), f"{script} has no part {part}"
    for pattern in kept:
        assert matches(files(RESULTS), [pattern]), f"no result {pattern}"
    for pattern in data:
        place = located(pattern)
        assert list(place.parent.glob(place.name)), f"no data {pattern}"
    assert pages, f"{command} names no page"
    for page in pages:
        assert (ROOT / page).is_file(), f"no page {page}"


def test_every_result_is_kept_by_one_script_or_command():
    kept = [pattern for row in ROWS for pattern in row[3]]
    assert matches(files(RESULTS), kept) == files(RESULTS)
    exact = [pattern for pattern in kept if "*" not in pattern]
    assert len(exact) == len({*exact})


def test_every_result_is_shown_by_a_page_or_is_an_input():
    # a page is made of a kept page with its picture; numbers of a picture stand beside
    texts = [path.read_text("utf-8") for one in SHOWN_BY for path in ROOT.glob(one)]
    inputs = [one.removeprefix("results/") for row in ROWS for one in row[2]]
    every = files(RESULTS)
    shown = {
        name
        for name in every
        if name in inputs
        or any(f"({name})" in t or f"results/{name}" in t for t in texts)
    }
    stems = {name.rpartition(".")[0] for name in shown}
    beside = {name for name in every if name.rpartition(".")[0] in stems}
    assert every - shown - beside == set()


def test_all_data_are_read_by_a_script_or_shown_as_an_example():
    patterns = [one for row in ROWS for one in row[2]]
    patterns += [one.strip() for entry, _ in EXAMPLES for one in entry.split(",")]
    every = {
        f"{part}/{name}"
        for part in ("data", "scenes", "studies")
        for name in files(FOLDER / part)
    }
    assert matches(every, patterns) == every
    for _, page in EXAMPLES:
        assert (ROOT / page.strip()).is_file(), page


@pytest.mark.parametrize(("name", "users"), SHARED, ids=lambda entry: entry)
def test_shared_code_is_imported_by_the_scripts_named(name, users):
    for user in re.findall(r"`(\w+)`", users):
        text = (FOLDER / f"{user}.py").read_text("utf-8")
        assert name in text, f"{user} does not use {name}"


@pytest.mark.parametrize("script", sorted({*scripts()}))
def test_a_script_is_run_as_its_own_text_says(script):
    """Its docstring names the command, and the parts that the index has."""
    text = (FOLDER / f"{script}.py").read_text("utf-8")
    assert "__main__" in text, script
    parts = {row[0].partition(" ")[2] for row in ROWS if row[0].split()[0] == script}
    for part in parts - {""}:
        assert f"{script} {part}" in text.partition("\nimport")[0], (script, part)
