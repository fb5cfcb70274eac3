"""The manual and the front page: what they link to, name and show is there.

`make docs` builds the pages; here is what can be said of them without.
"""

import ast
import builtins
import json
import re
import tomllib
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from jsonschema import Draft202012Validator

import jblast
from docs.generate import blocks, command_line, notebooks, pages, scene_tables
from docs.generate.links import in_repository, site_uri, targets, to_site
from docs.generate.scene_schema import scene_schema
from jblast.cli.parsers import VERBS
from jblast.parameters import PARAMETERS
from jblast.quantities import DERIVED_QUANTITIES, QUANTITIES
from jblast.scene.reader.scene import scene_from_document, world_from_document
from jblast.scene.reader.tables import KEYS, keys_of
from tests.test_import_order import ORDER, WITHIN

ROOT = Path(__file__).parents[1]
FRONT = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
WRITTEN = sorted((ROOT / "docs").rglob("*.md"))
GENERATED = pages.generated()
URIS = {page.uri for page in GENERATED} | set(pages.shown())
FOLDERS = ("jblast", "calibration", "notebooks", "tests", "docs")


def name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


each_page = pytest.mark.parametrize("path", [*FRONT, *WRITTEN], ids=name)


def text(path: Path) -> str:
    return path.read_text("utf-8")


def python_blocks(path: Path) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", text(path), re.M | re.S)


def test_the_navigation_names_every_written_page_and_none_that_is_not_there():
    nav = text(ROOT / "mkdocs.yml").split("\nnav:\n")[1]
    named = re.findall(r"[-:] (\S+\.md)$", nav, re.M)
    written = {path.relative_to(ROOT / "docs").as_posix() for path in WRITTEN}
    assert sorted(named) == sorted({*written, *pages.ALSO})
    sections = re.findall(r"- (\w+):(?: \[\])?$", nav, re.M)
    assert set(pages.navigation(GENERATED)) <= set(sections)


@each_page
def test_every_link_leads_somewhere(path):
    for link in targets(text(path)):
        there = in_repository(link, name(path))
        assert (ROOT / there).exists() or there.removeprefix("docs/") in URIS, link


@pytest.mark.parametrize("path", WRITTEN, ids=name)
def test_every_file_that_the_manual_links_to_stands_on_the_site(path):
    written = {p.relative_to(ROOT / "docs").as_posix() for p in WRITTEN}
    for link in targets(text(path)):
        assert site_uri(in_repository(link, name(path))) in URIS | written, link


@each_page
def test_python_that_is_shown_is_python(path):
    for block in python_blocks(path):
        compile(block, name(path), "exec")


@each_page
def test_python_that_is_shown_uses_names_it_has(path):
    known = set(dir(builtins))
    for block in python_blocks(path):
        nodes = list(ast.walk(ast.parse(block)))
        names = [node for node in nodes if isinstance(node, ast.Name)]
        used = {node.id for node in names if isinstance(node.ctx, ast.Load)}
        known |= {node.id for node in names if isinstance(node.ctx, ast.Store)}
        known |= {node.arg for node in nodes if isinstance(node, ast.arg)}
        known |= {
            (node.asname or node.name).split(".")[0]
            for node in nodes
            if isinstance(node, ast.alias)
        }
        known |= {
            n.name
            for n in nodes
            if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
        }
        assert used <= known, used - known


@each_page
def test_files_that_are_named_are_there(path):
    for quoted in re.findall(r"`([^`\n]+)`", text(path)):
        if re.fullmatch(rf"({'|'.join(FOLDERS)})/[\w./]+", quoted):
            assert (ROOT / quoted).exists(), quoted
    for script in re.findall(r"python\s+-m\s+calibration\.(\w+)", text(path)):
        assert (ROOT / "calibration" / f"{script}.py").exists(), script


@each_page
def test_names_of_ours_that_are_named_are_there(path):
    for dotted in re.findall(r"`(jblast(?:\.\w+)+)`", text(path)):
        room, names = ROOT, dotted.split(".")
        while names and (room / names[0]).is_dir():
            room /= names.pop(0)
        if names and (room / f"{names[0]}.py").exists():
            module = room / f"{names.pop(0)}.py"
        else:
            module = room / "__init__.py"
        found = re.findall(r"\w+", text(module))
        assert set(names[:1]) <= set(found), dotted


def test_every_marker_of_a_page_has_a_block_and_every_block_a_page():
    used = [m for path in WRITTEN for m in blocks.MARKER.findall(text(path))]
    assert sorted(used) == sorted(blocks.BLOCKS)
    assert all(len(block()) > 100 for block in blocks.BLOCKS.values())


def test_generated_tables_tell_all_that_the_readers_know():
    told = scene_tables.quantities()
    assert all(f"`{q}`" in told for q in (*QUANTITIES, *DERIVED_QUANTITIES))
    assert all(f"`{name}`" in scene_tables.numbers() for name in PARAMETERS)
    told = scene_tables.keys_of_tables()
    assert all(f"`{key}`" in told for table in KEYS for key in keys_of(table))


def test_the_command_line_page_has_every_verb_with_its_options():
    told = command_line.verbs()
    assert re.findall(r"^## jblast (\w+)$", told, re.M) == [v.name for v in VERBS]
    assert "<code>--one-event</code>" in told
    assert "<code>--posterior {weighted,laplace,emcee,auto}</code>" in told
    assert "<code>--burst surface&#124;free-air</code>" in told
    assert told.count("<code>--debug</code>") == len(VERBS)


def test_every_notebook_and_every_kept_result_becomes_a_page():
    sources = {page.source for page in GENERATED}
    kept = ROOT / "calibration" / "results"
    files = [*(ROOT / "notebooks").glob("*.ipynb"), *kept.glob("*.txt")]
    assert {name(path) for path in files} <= sources
    assert {name(path) for path in kept.rglob("*.md")} <= sources
    uris = [page.uri for page in GENERATED]
    assert len(set(uris)) == len(uris)


@pytest.mark.parametrize("path", WRITTEN, ids=name)
def test_scenes_that_are_shown_can_be_read(path):
    schema = Draft202012Validator(scene_schema())
    for block in re.findall(r"^```toml\n(.*?)^```", text(path), re.M | re.S):
        document = tomllib.loads(block)
        if "view" not in document:
            schema.validate(document)
            read = world_from_document if "world" in document else scene_from_document
            read(document, name(path))


def test_readme_is_a_page_one_reads_through():
    assert len(text(ROOT / "README.md").splitlines()) <= 120


def test_readme_tells_of_every_verb():
    table = text(ROOT / "README.md").split("## The four main verbs")[1]
    assert [v.name for v in VERBS if f"`{v.name}`" not in table] == []


def test_readme_tells_of_every_name_of_the_front_door():
    offered = " ".join(text(ROOT / "README.md").split()).split("`jblast` offers")[1]
    told = re.findall(r"`(\w+)`", offered.partition(", and loads")[0])
    assert sorted(told) == sorted(jblast.__all__)


@pytest.mark.slow
def test_the_python_in_readme_runs(monkeypatch, capsys):
    """What it prints is what the picture's caption says."""
    monkeypatch.chdir(ROOT)
    block, _ = python_blocks(ROOT / "README.md")
    exec(block, {})
    assert capsys.readouterr().out == "241 kg, 90 % interval 171 to 338 kg\n"
    caption = " ".join(text(ROOT / "README.md").split())
    assert "241 kg, 90 % interval 171 to 338 kg" in caption


def test_ten_thousand_scenes_of_readme_are_those_one_by_one(monkeypatch):
    monkeypatch.chdir(ROOT)
    names: dict[str, Any] = {"jax": jax, "jblast": jblast}
    exec(python_blocks(ROOT / "README.md")[1], names)
    masses, easts = np.asarray(names["masses"]), np.asarray(names["places"])[:, 0]
    assert names["times"].shape == (10_000, 8)
    place = np.array([sensor.position_m for sensor in names["known"].sensors])
    surface = jblast.Scene(jblast.Charge(burst="surface"))
    for n in (0, 4321, 9999):
        away = np.abs(place[:, 0] - easts[n])  # all stand on one line
        told = jblast.calculate(surface, away, masses[n])["air_arrival_s"]
        np.testing.assert_allclose(
            names["times"][n], told["kingery_bulmash"].value, rtol=1e-9
        )


def test_contributing_lists_the_rooms_that_there_are_in_their_order():
    rooms = text(ROOT / "CONTRIBUTING.md").split("## Packages")[1]
    table = next(part for part in rooms.split("\n\n") if part.startswith("| package"))
    told = {
        line.split("|")[1].strip(" `"): re.findall(r"`(\w+)`", line.split("|")[3])
        for line in table.splitlines()[2:]
    }
    there = {
        room.name: sorted(folder.parent.name for folder in room.glob("*/__init__.py"))
        for room in (path.parent for path in (ROOT / "jblast").glob("*/__init__.py"))
    }
    assert {room: sorted(folders) for room, folders in told.items()} == there
    assert list(told) == [name for names in ORDER for name in names if name in told]
    for room, order in WITHIN.items():
        if room in told:
            folders = [name for name in order if name in there[room]]
            assert [name for name in told[room] if name in order] == folders


def test_links_of_the_repository_become_links_of_the_site():
    page = "![a](../../calibration/results/charts/fit.png) [b](../install.md#what)"
    assert to_site(page, "docs/howto/measure.md", "howto/measure.md") == (
        "![a](../results/charts/fit.png) [b](../install.md#what)"
    )
    story = "[one](../../notebooks/01_fit_a_blast.ipynb) [all](https://docs.jax.dev)"
    assert to_site(story, "docs/howto/fit.md", "howto/fit.md") == (
        "[one](../tutorials/01_fit_a_blast.md) [all](https://docs.jax.dev)"
    )


def test_a_tutorial_has_the_outputs_of_its_own_code(tmp_path):
    def write(folder, code, outputs=()):
        heading = {"cell_type": "markdown", "source": ["# A study"]}
        cell = {"cell_type": "code", "source": [code], "outputs": list(outputs)}
        path = tmp_path / folder / "a.ipynb"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({"cells": [heading, cell]}))
        return path

    notebook = write("notebooks", "print(1 < 2)")
    assert "without outputs" in notebooks.page(notebook)
    printed = {"output_type": "stream", "name": "stdout", "text": ["True < 2\n"]}
    drawn = {"output_type": "display_data", "data": {"image/png": "iVBO\nRw0="}}
    write(notebooks.EXECUTED, "print(1 < 2)", [printed, drawn])
    page = notebooks.page(notebook)
    assert "<pre><code>True &lt; 2</code></pre>" in page
    assert 'src="data:image/png;base64,iVBORw0="' in page
    write("notebooks", "print(2)")
    assert "without outputs" in notebooks.page(notebook)
