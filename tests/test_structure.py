"""Structure of the package: direction of imports, faces of packages, vocabulary."""

import ast
import functools
import importlib
import os
import re
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from types import ModuleType

import pytest

from tests.tools.imports import PACKAGE, imported, module_of, package_of
from tests.tools.vocabulary import DEFAULT, found_in, summaries_in, words_in

ROOT = PACKAGE.parent
SOURCES = sorted(PACKAGE.rglob("*.py"))
BASE = (
    *("errors", "types", "constants", "lazy", "progress", "registry"),
    *("addresses", "files", "results", "quantities", "units", "parameters"),
    "kept_programs",
)
"""Modules at the root: each may import those before it."""
PACKAGES = tuple(
    re.findall(
        r"^\| `(\w+)` \|",
        (ROOT / "CONTRIBUTING.md").read_text("utf-8").split("## Packages")[1],
        re.MULTILINE,
    )
)
"""Packages in the order of the table in CONTRIBUTING.md."""
LEVEL = {name: level for level, name in enumerate((*BASE, *PACKAGES))}
BARE = {"jax", "equinox", "jaxtyping", "numpy", "jblast"}
"""What a bare GPU machine has."""


def wrong_way(source: str, module: str, package: str) -> list[str]:
    """Return the imports of a module that stand below it in the order."""
    parts = module.split(".")
    # the front door imports what it offers when it is first used
    own = LEVEL["study"] if len(parts) == 1 else LEVEL[parts[1]]
    names = (
        name
        for base, taken in imported(source, package)
        for name in ([f"jblast.{one}" for one in taken] if base == "jblast" else [base])
    )
    return [
        name
        for name in names
        if name.startswith("jblast.") and LEVEL.get(name.split(".")[1], -1) > own
    ]


def test_imports_point_up_the_order_only():
    modules = {module_of(p): p for p in SOURCES if p.name != "__main__.py"}
    wrong = {
        name: found
        for name, path in modules.items()
        if (found := wrong_way(path.read_text(), name, package_of(path)))
    }
    assert wrong == {}


def test_the_order_has_every_package_and_module():
    folders = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    modules = {path.stem for path in PACKAGE.glob("*.py")} - {"__init__", "__main__"}
    assert folders == set(PACKAGES)
    assert modules == set(BASE)


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("jblast.waves.laws.wu_hao", "from jblast.inference import fit"),
        (
            "jblast.waves.laws.wu_hao",
            "def late():\n    import jblast.sensors.forward_model",
        ),
        ("jblast.scene.scene", "from ..waves import wu_hao"),
        ("jblast.registry", "from jblast.scene.scene import Air"),
        ("jblast", "from jblast.cli import main"),
    ],
)
def test_an_import_down_the_order_is_found(module, source):
    assert wrong_way(source, module, module.rpartition(".")[0] or module)


@functools.cache
def graph() -> dict[str, set[str]]:
    """Return the files that each file imports; packages are their `__init__`."""
    files = {
        module_of(path): path
        for top in ("jblast", "calibration")
        for path in (ROOT / top).rglob("*.py")
    }
    found: dict[str, set[str]] = {}
    for name, path in files.items():
        ways = imported(path.read_text(), package_of(path))
        names = {f"{base}.{one}" for base, taken in ways for one in taken}
        bases = {base for base, taken in ways if not taken}
        for one in names:
            bases.add(one if one in files else one.rpartition(".")[0])
        found[name] = (bases & set(files)) - {name}
    return found


def circle_in(edges: dict[str, set[str]]) -> list[str]:
    try:
        TopologicalSorter(edges).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_no_file_imports_itself_by_others():
    assert circle_in(graph()) == []
    assert circle_in({"a": {"b"}, "b": {"c"}, "c": {"a"}})


def test_the_entries_of_each_folder_have_an_order():
    circles = {}
    for folder in {name.rpartition(".")[0] for name in graph()}:
        inside: dict[str, set[str]] = {}
        for name, files in graph().items():
            own = name.removeprefix(f"{folder}.").partition(".")[0]
            if name.startswith(f"{folder}."):
                near = [one for one in files if one.startswith(f"{folder}.")]
                names = {one[len(folder) + 1 :].partition(".")[0] for one in near}
                inside.setdefault(own, set()).update(names - {own})
        if circle := circle_in(inside):
            circles[folder] = circle
    assert circles == {}


def test_scene_and_waves_need_jax_equinox_and_jaxtyping_alone():
    needed = {
        (module_of(path), base.partition(".")[0])
        for path in SOURCES
        if path.relative_to(PACKAGE).parts[0] in ("scene", "waves")
        for base, _ in imported(path.read_text(), package_of(path))
    }
    allowed = BARE | set(sys.stdlib_module_names)
    assert {(module, top) for module, top in needed if top not in allowed} == set()


CALCULATION = (
    "from jblast.report.calc import Calc; from jblast.cli.main import parsed; "
    "from jblast.cli.verbs.calc import question_of, selection; "
    "options = parsed(['calc', '--mass', '1', '--range', '9']); "
    "Calc(question_of(options), *selection(options)).document()"
)
CHOICE = (
    "from jblast import Charge, Scene, choose; from jblast.scene import Sensor; "
    "scene = Scene(Charge(mass_kg=1.0), sensors=(Sensor('a', [9.0, 0.0, 0.0]),)); "
    "choose(scene, 'air_arrival_s')"
)


@pytest.mark.parametrize(
    ("statement", "needs", "does_without"),
    [
        ("import jblast", "jblast", "jax numpy equinox warp pysindy matplotlib"),
        ("import jblast.waves", "numpy", "jax equinox warp pysindy matplotlib"),
        (
            CALCULATION,
            "jblast.waves",
            "jax equinox jblast.inference optimistix scipy.interpolate scipy.special "
            "jblast.sensors.recorder jblast.sensors.waves_met jblast.sensors.camera "
            "jblast.observations.log_io",
        ),
        (CHOICE, "jblast.waves.choice", "jax equinox scipy jblast.inference"),
        ("import jblast.quantities, jblast.parameters", "jblast", "jax"),
    ],
    ids=["package", "laws", "calculator", "choice", "tables"],
)
def test_what_an_import_loads(tmp_path, statement, needs, does_without):
    run = subprocess.run(
        [sys.executable, "-B", "-c", f"{statement}; import sys; print(*sys.modules)"],
        check=True,
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "HOME": str(tmp_path), "PYTHONPATH": str(ROOT)},
    )
    loaded = set(run.stdout.split())
    assert needs in loaded
    assert loaded.isdisjoint(does_without.split())
    assert list(tmp_path.iterdir()) == []


FACES = {
    face: names
    for path in SOURCES
    if path.name == "__init__.py"
    for face in [module_of(path)]
    if (
        names := [
            alias.name
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
            if alias.asname == alias.name
        ]
    )
}
"""Packages, and the names that they list as `from MODULE import NAME as NAME`."""


@pytest.mark.parametrize("face", FACES)
def test_a_package_has_the_names_it_lists_and_no_others(face):
    module = importlib.import_module(face)
    listed = FACES[face]
    assert len(set(listed)) == len(listed)
    assert [name for name in listed if not hasattr(module, name)] == []
    late = hasattr(module, "__getattr__")
    assert set(listed) <= set(dir(module))
    more = {
        name
        for name, value in vars(module).items()
        if name[0] != "_" and not isinstance(value, ModuleType)
    }
    assert late or more <= set(listed)


def test_a_name_has_one_path_beside_the_front_door():
    paths: dict[int, list[str]] = {}
    for face in set(FACES) - {"jblast"}:
        for name in FACES[face]:
            value = getattr(importlib.import_module(face), name)
            if callable(value):
                paths.setdefault(id(value), []).append(f"{face}.{name}")
    assert [path for path in paths.values() if len(path) > 1] == []


def test_the_package_and_its_pages_have_no_avoided_word():
    assert [str(place) for place in found_in(list(DEFAULT))] == []
    assert len(list(words_in("the data told nothing, seldomer", "a.py"))) == 2
    module = '"""What was requested."""\n'
    assert [place.line for place in summaries_in(module, "a.py")] == [1]


OPTION = re.compile(r"--[a-z]")


def messages(path: Path) -> list[str]:
    """Return the texts of a module that are no docstrings."""
    tree = ast.parse(path.read_text("utf-8"))
    silent = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    return [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and id(node) not in silent
    ]


def test_no_message_of_the_library_names_an_option():
    named = {
        f"{path.relative_to(PACKAGE)}: {text}"
        for path in SOURCES
        if path.relative_to(PACKAGE).parts[0] not in ("cli", "report")
        for text in messages(path)
        if OPTION.search(text)
    }
    assert named == set()
