"""Manual and README: what they link to, name and show exists."""

import ast
import builtins
import importlib
import json
import re
import tomllib
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from jsonschema import Draft202012Validator

import jblast
from docs.generate import (
    blocks,
    command_line,
    documents,
    notebooks,
    pages,
    scene_tables,
)
from docs.generate.links import in_repository, site_uri, targets, to_site
from docs.generate.scene_schema import scene_schema
from jblast.cli.verbs import VERBS
from jblast.parameters import PARAMETERS
from jblast.quantities import DERIVED_QUANTITIES, QUANTITIES
from jblast.scene.keys import KEYS, keys_of
from jblast.scene.reader import scene_from_document, world_from_document

ROOT = Path(__file__).parents[1]
WRITTEN = sorted((ROOT / "docs").rglob("*.md"))
FRONT = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
PAGES = [*FRONT, *WRITTEN]
GENERATED = pages.generated()
URIS = {page.uri for page in GENERATED} | set(pages.shown())
FOLDERS = ("jblast", "calibration", "notebooks", "tests", "docs")
TEXTS = {path: path.read_text("utf-8") for path in PAGES}
MODULES = [path for top in FOLDERS[:2] for path in sorted((ROOT / top).rglob("*.py"))]


def name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


each_page = pytest.mark.parametrize("path", PAGES, ids=name)


def python_of(path: Path) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", TEXTS[path], re.M | re.S)


def test_the_navigation_names_every_written_page():
    nav = (ROOT / "mkdocs.yml").read_text().split("\nnav:\n")[1]
    named = re.findall(r"[-:] (\S+\.md)$", nav, re.M)
    written = {path.relative_to(ROOT / "docs").as_posix() for path in WRITTEN}
    assert sorted(named) == sorted({*written, *pages.ALSO})
    sections = re.findall(r"- (\w+):(?: \[\])?$", nav, re.M)
    assert set(pages.navigation(GENERATED)) <= set(sections)


@each_page
def test_links_and_named_files_exist(path):
    written = {p.relative_to(ROOT / "docs").as_posix() for p in WRITTEN}
    for link in targets(TEXTS[path]):
        there = in_repository(link, name(path))
        assert (ROOT / there).exists() or there.removeprefix("docs/") in URIS, link
        assert path in FRONT or site_uri(there) in URIS | written, link
    for quoted in re.findall(r"`([^`\n]+)`", TEXTS[path]):
        if re.fullmatch(rf"({'|'.join(FOLDERS)})/[\w./]+", quoted):
            # the changelog also names what a release removed
            assert path.name == "CHANGELOG.md" or (ROOT / quoted).exists(), quoted
    for script in re.findall(r"python\s+-m\s+calibration\.(\w+)", TEXTS[path]):
        module = ROOT / "calibration" / script
        there = module.with_suffix(".py").exists() or module.is_dir()
        assert path.name == "CHANGELOG.md" or there, script


@each_page
def test_python_of_pages_compiles_and_uses_known_names(path):
    known = set(dir(builtins))
    for block in python_of(path):
        compile(block, name(path), "exec")
        for node in ast.walk(ast.parse(block)):
            match node:
                case ast.Name(id=one, ctx=ast.Store()) | ast.arg(arg=one):
                    known.add(one)
                case ast.alias():
                    known.add((node.asname or node.name).split(".")[0])
                case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                    known.add(node.name)
        used = {
            node.id
            for node in ast.walk(ast.parse(block))
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)
        }
        assert used <= known, used - known


def code_of(path: Path) -> str:
    """Return the Python that a page or a notebook shows."""
    if path.suffix == ".md":
        return "\n".join(python_of(path))
    cells = json.loads(path.read_text())["cells"]
    lines = "\n".join("".join(c["source"]) for c in cells if c["cell_type"] == "code")
    return "\n".join(x for x in lines.splitlines() if x.lstrip()[:1] not in ("%", "!"))


@pytest.mark.parametrize(
    "path", [*PAGES, *sorted((ROOT / "notebooks").glob("*.ipynb"))], ids=name
)
def test_imports_of_pages_and_notebooks_exist(path):
    for node in ast.walk(ast.parse(code_of(path))):
        base = (node.module or "") if isinstance(node, ast.ImportFrom) else ""
        if isinstance(node, ast.ImportFrom) and base.partition(".")[0] == "jblast":
            module = importlib.import_module(base)
            # users import from packages, and from modules at the root
            assert hasattr(module, "__path__") or base.count(".") == 1, base
            for alias in node.names:
                assert hasattr(module, alias.name), f"{base}.{alias.name}"
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            assert node.value.id != "jblast" or hasattr(jblast, node.attr), node.attr


ROOMS = sorted(path.parent.name for path in ROOT.glob("jblast/*/__init__.py"))
DOTTED = re.compile(rf"`((?:jblast|calibration|{'|'.join(ROOMS)})(?:\.\w+)+)(?=[`(\[])")
"""Of a call or an item, the name before the bracket; packages also without `jblast`."""
FILE_SUFFIXES = ("csv", "html", "json", "kml", "md", "png", "py", "toml", "txt", "yml")


def resolves(dotted: str) -> bool:
    """Return whether a name is a module, or is reached from one by attributes."""
    parts = dotted.split(".")
    for count in range(len(parts), 0, -1):
        try:
            found = find_spec(".".join(parts[:count])) is not None
        except ModuleNotFoundError:  # a part before the last is no package
            found = False
        if found:
            owner = importlib.import_module(".".join(parts[:count]))
            for part in parts[count:]:
                # fields without a default are no attributes of their class
                if part in getattr(owner, "__dataclass_fields__", {}):
                    return part == parts[-1]
                if not hasattr(owner, part):
                    return False
                owner = getattr(owner, part)
            return True
    return False


def test_dotted_names_of_docstrings_and_pages_exist():
    texts = {name(path): text for path, text in TEXTS.items() if path.suffix == ".md"}
    texts.pop("CHANGELOG.md")  # also names what a release removed
    for path in MODULES:
        texts[name(path)] = "\n".join(
            node.value.value
            for node in ast.walk(ast.parse(path.read_text("utf-8")))
            if isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        )
    named = {
        f"jblast.{one}" if one.partition(".")[0] in ROOMS else one: where
        for where, text in texts.items()
        for one in DOTTED.findall(text)
        if not one.endswith(FILE_SUFFIXES)
    }
    assert len(named) > 50
    assert [f"{w}: {one}" for one, w in named.items() if not resolves(one)] == []
    assert not resolves("jblast.scene.Charge.no_such_field")


def test_every_marker_of_a_page_has_a_block():
    used = [m for path in WRITTEN for m in blocks.MARKER.findall(TEXTS[path])]
    whole = [name for name in used if "." not in name]
    answers = [blocks.ANSWER + name for name in documents.DOCUMENTS]
    assert sorted(whole) == sorted([*blocks.BLOCKS, *answers])
    assert all(len(blocks.block(name)) > 100 for name in used)


def test_generated_tables_have_all_that_the_readers_accept():
    quantities, keys = scene_tables.quantities(), scene_tables.keys()
    assert all(f"`{q}`" in quantities for q in (*QUANTITIES, *DERIVED_QUANTITIES))
    assert all(f"`{name}`" in scene_tables.numbers() for name in PARAMETERS)
    assert all(f"`{key}`" in keys for table in KEYS for key in keys_of(table))


def test_the_command_line_page_has_every_verb_with_its_options():
    page = command_line.verbs()
    assert re.findall(r"^## jblast (\w+)$", page, re.M) == list(VERBS)
    assert "<code>--posterior weighted&#124;emcee</code>" in page
    assert page.count("<code>--debug</code>") == len(VERBS)


def test_every_notebook_and_every_kept_result_becomes_a_page():
    sources = {page.source for page in GENERATED}
    kept = ROOT / "calibration" / "results"
    files = [*(ROOT / "notebooks").glob("*.ipynb"), *kept.glob("*.txt")]
    assert {name(path) for path in (*files, *kept.rglob("*.md"))} <= sources
    assert len({page.uri for page in GENERATED}) == len(GENERATED)


@pytest.mark.parametrize("path", WRITTEN, ids=name)
def test_scenes_of_pages_can_be_read(path):
    schema = Draft202012Validator(scene_schema())
    for block in re.findall(r"^```toml\n(.*?)^```", TEXTS[path], re.M | re.S):
        document = tomllib.loads(block)
        if not {"view", "outcomes"} & set(document):  # a set of views, a study
            schema.validate(document)
            read = world_from_document if "world" in document else scene_from_document
            read(document, name(path))


def test_readme_names_every_verb_and_function_on_one_page():
    readme = TEXTS[ROOT / "README.md"]
    assert len(readme.splitlines()) <= 125
    table = readme.split("## The four main verbs")[1]
    assert [v for v in VERBS if f"`{v}`" not in table] == []
    offered = " ".join(readme.split()).split("`jblast` offers")[1]
    named = re.findall(r"`(\w+)`", offered.partition(", and loads")[0])
    assert sorted(named) == sorted(jblast.__all__)


@pytest.mark.slow
def test_the_fit_of_readme_prints_the_numbers_of_its_caption(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    block, _ = python_of(ROOT / "README.md")
    exec(block, {})
    assert capsys.readouterr().out == "240 kg, 90 % interval 173 to 342 kg\n"
    caption = " ".join(TEXTS[ROOT / "README.md"].split())
    assert "240 kg, 90 % interval 173 to 342 kg" in caption


def test_ten_thousand_scenes_of_readme_are_those_one_by_one(monkeypatch):
    monkeypatch.chdir(ROOT)
    names: dict[str, Any] = {"jax": jax, "jblast": jblast}
    exec(python_of(ROOT / "README.md")[1], names)
    masses, easts = np.asarray(names["masses"]), np.asarray(names["places"])[:, 0]
    assert names["times"].shape == (10_000, 8)
    place = np.array([sensor.position_m for sensor in names["known"].sensors])
    surface = jblast.Scene(jblast.Charge(burst="surface"))
    for n in (0, 4321, 9999):
        away = np.abs(place[:, 0] - easts[n])  # all stand on one line
        laws = jblast.calculate(surface, away, masses[n])["air_arrival_s"]
        np.testing.assert_allclose(
            names["times"][n], laws["kingery_bulmash"].value, rtol=1e-9
        )


def test_links_of_the_repository_become_links_of_the_site():
    page = "![a](../../calibration/results/charts/fit.png) [b](../install.md#what)"
    assert to_site(page, "docs/howto/measure.md", "howto/measure.md") == (
        "![a](../results/charts/fit.png) [b](../install.md#what)"
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
    write(notebooks.EXECUTED, "print(1 < 2)", [printed])
    assert "<pre><code>True &lt; 2</code></pre>" in notebooks.page(notebook)
    write("notebooks", "print(2)")
    assert "without outputs" in notebooks.page(notebook)
