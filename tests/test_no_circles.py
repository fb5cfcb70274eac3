"""No file imports itself by way of others, and no folder another that imports it."""

import functools
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.tools.imports import imported

ROOT = Path(__file__).parents[1]
FILES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts): path
    for top in ("jblast", "calibration")
    for path in sorted((ROOT / top).rglob("*.py"))
}
FACE = ".__init__"


def file_of(module: str) -> str | None:
    """The file of a module, named with dots; None if it is none of ours."""
    return next((name for name in (module, module + FACE) if name in FILES), None)


def files_imported(source: str, name: str) -> set[str]:
    """The files of ours that a source names in its imports, inside functions too."""
    found: set[str | None] = set()
    for base, names in imported(source, name.rpartition(".")[0]):
        found |= {file_of(f"{base}.{one}") or file_of(base) for one in names or ("",)}
    return {file for file in found if file is not None and file != name}


def circle_in(graph: dict[str, set[str]]) -> list[str]:
    """The nodes of one circle, its first at its end again; empty if there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


@functools.cache
def whole_graph() -> dict[str, set[str]]:
    """What each file imports; read by the tests, not by who only collects them."""
    return {
        name: files_imported(path.read_text(), name) for name, path in FILES.items()
    }


FOLDERS = sorted({name.rpartition(".")[0] for name in FILES})


def test_no_file_imports_itself_by_way_of_others():
    assert circle_in(whole_graph()) == []


def within(folder: str, name: str) -> str | None:
    """The file or folder directly in a folder that a file is or lies in, but its face.

    None if it lies elsewhere.
    """
    inside = name.removeprefix(folder + ".")
    if inside == name or inside == "__init__":
        return None
    return inside.partition(".")[0]


@pytest.mark.parametrize("folder", FOLDERS)
def test_what_lies_in_a_folder_stands_in_one_order(folder):
    graph: dict[str, set[str]] = {}
    for name, files in whole_graph().items():
        own = within(folder, name)
        if own is not None:
            others = {within(folder, file) for file in files} - {own, None}
            graph.setdefault(own, set()).update(filter(None, others))
    assert circle_in(graph) == []


def test_a_circle_is_found():
    assert circle_in({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}})
    assert circle_in({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("from jblast.scene.scene import Air", "jblast.scene.scene"),
        ("from jblast.scene import Scene", "jblast.scene.__init__"),
        ("from jblast import errors", "jblast.errors"),
        ("from .errors import shown", "jblast.errors"),
        ("def late():\n    import jblast.cli.main", "jblast.cli.main"),
    ],
)
def test_an_import_is_found(source, found):
    assert files_imported(source, "jblast.types") == {found}
