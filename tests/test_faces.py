"""The faces of rooms: what `from jblast.ROOM import NAME` finds, and nothing else.

A face is a docstring and lines like `from jblast.scene.scene import Air as Air`: they
are the list of its names. Two do more, and say so below.
"""

import ast
import importlib
import json
import re
from pathlib import Path
from types import ModuleType

import pytest

import jblast

ROOT = Path(__file__).parents[1]
LAZY = {
    "jblast": "_HOMES",
    "jblast.environments": "_HOMES",
    "jblast.missions": "HOMES",
    "jblast.observations": "HOMES",
    "jblast.report": "HOMES",
    "jblast.sensors": "HOMES",
    "jblast.study": "HOMES",
}
"""Faces that import a name when it is asked for, and the table it is looked up in."""
DOES = {
    "jblast.waves": "registry.mark_packaged()",
    "jblast.vehicle.warp": "wp.config.log_level = wp.LOG_ERROR",
}
"""The one statement of faces that do something."""
SOURCES = {
    ".".join(path.parent.relative_to(ROOT).parts): path.read_text()
    for path in sorted((ROOT / "jblast").rglob("__init__.py"))
}


def exports(source: str) -> list[str]:
    """The names that a face lists, `X as X`, for type checkers too."""
    return [
        alias.asname
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname is not None and alias.asname == alias.name
    ]


LISTED = {face: exports(source) for face, source in SOURCES.items()}
FACES = [face for face, names in LISTED.items() if names]


@pytest.mark.parametrize("face", SOURCES)
def test_a_face_is_a_docstring_and_a_list(face):
    docstring, *body = ast.parse(SOURCES[face]).body
    assert isinstance(docstring, ast.Expr)
    assert isinstance(docstring.value, ast.Constant)
    if face in LAZY:
        return
    more = [
        ast.unparse(node)
        for node in body
        if not (
            isinstance(node, ast.ImportFrom)
            and all(alias.asname == alias.name for alias in node.names)
        )
    ]
    if face in DOES:
        loads, deed, *said = more
        assert loads.split()[-1] in (deed.split(".")[0], "wp")
        assert deed == DOES[face]
        assert all(words[0] in "'\"" for words in said)
    else:
        assert more == []


@pytest.mark.parametrize("face", FACES)
def test_a_face_has_the_names_it_lists_and_no_others(face):
    module = importlib.import_module(face)
    listed = LISTED[face]
    assert len(set(listed)) == len(listed)
    assert [name for name in listed if not hasattr(module, name)] == []
    if face in LAZY:
        late = set(getattr(module, LAZY[face]))
        assert late <= set(listed)
        assert late | set(vars(module)) >= set(listed)
        assert late <= set(dir(module))
        return
    others = {
        name
        for name, value in vars(module).items()
        if name[0] != "_" and not isinstance(value, ModuleType)
    }
    assert others <= set(listed)


def test_a_name_has_one_path_beside_the_front_door():
    paths: dict[int, list[str]] = {}
    for face in FACES:
        for name in () if face == "jblast" else LISTED[face]:
            value = getattr(importlib.import_module(face), name)
            if callable(value):
                paths.setdefault(id(value), []).append(f"{face}.{name}")
    assert [path for path in paths.values() if len(path) > 1] == []


def shown(path: Path) -> list[str]:
    """The Python that a page or a notebook shows."""
    text = path.read_text()
    if path.suffix == ".ipynb":
        cells = json.loads(text)["cells"]
        return ["".join(c["source"]) for c in cells if c["cell_type"] == "code"]
    return re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)


PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES += sorted((ROOT / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_what_pages_and_notebooks_import_is_there(path):
    lines = [line for code in shown(path) for line in code.splitlines()]
    code = "\n".join(line for line in lines if line.lstrip()[:1] not in ("%", "!"))
    for node in ast.walk(ast.parse(code)):
        base = (node.module or "") if isinstance(node, ast.ImportFrom) else ""
        if isinstance(node, ast.ImportFrom) and base.partition(".")[0] == "jblast":
            module = importlib.import_module(base)
            for alias in node.names:
                assert hasattr(module, alias.name), f"{base}.{alias.name}"
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            assert node.value.id != "jblast" or hasattr(jblast, node.attr), node.attr
