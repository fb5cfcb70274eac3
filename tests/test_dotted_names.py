"""Back-quoted dotted names of modules and their members resolve."""

import ast
import importlib
import re
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = sorted(path.parent.name for path in ROOT.glob("jblast/*/__init__.py"))
NAME = re.compile(
    rf"`((?:jblast|calibration|tests|{'|'.join(ROOMS)})(?:\.\w+)+)(?=[`(\[])"
)
"""Of a call or an item, the name before the bracket; packages also without `jblast`."""
PLACE = re.compile(r"`((?:[\w.]+/)*\w+\.py)`")
"""A module by its path, or by the end of it."""
ELSEWHERE = {
    "emulator.py": "of v2e",
    "eventslicer.py": "of DSEC",
}
FILES = ("csv", "html", "json", "kml", "md", "png", "py", "toml", "txt", "yml")
"""Ends of names that are files, such as `calibration.toml`."""


def docstrings(path: Path) -> str:
    """Return all texts of a module that stand as statements of their own."""
    return "\n".join(
        node.value.value
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def texts() -> dict[Path, str]:
    """Return the docstrings of modules and the pages that are read."""
    modules = [
        path
        for folder in ("jblast", "calibration", "tests", "docs")
        for path in sorted((ROOT / folder).rglob("*.py"))
    ]
    pages = [*ROOT.glob("docs/**/*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    pages.append(ROOT / "calibration" / "INDEX.md")
    return {path: docstrings(path) for path in modules} | {
        path: path.read_text("utf-8") for path in pages
    }


def named() -> dict[str, str]:
    """Return each dotted name, from its root on, and one file that has it."""
    found: dict[str, str] = {}
    for path, text in TEXTS.items():
        for name in NAME.findall(text):
            whole = f"jblast.{name}" if name.partition(".")[0] in ROOMS else name
            found.setdefault(whole, path.relative_to(ROOT).as_posix())
    return {name: where for name, where in found.items() if not name.endswith(FILES)}


def resolves(name: str) -> bool:
    """Return whether a name is a module, or is reached from one by attributes."""
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        module = ".".join(parts[:count])
        if not _exists(module):
            continue
        return count == len(parts) or _has(
            importlib.import_module(module), parts[count:]
        )
    return False


def _exists(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:  # a part before the last is no package
        return False


def _has(owner: object, parts: list[str]) -> bool:
    for part in parts:
        # fields without a default are no attributes of their class
        if part in getattr(owner, "__dataclass_fields__", {}):
            return part == parts[-1]
        if not hasattr(owner, part):
            return False
        owner = getattr(owner, part)
    return True


TEXTS = texts()
NAMES = named()


def test_dotted_names_are_found():
    # none found would pass all else
    assert len(NAMES) > 50


@pytest.mark.parametrize("name", sorted(NAMES))
def test_a_dotted_name_resolves(name):
    assert resolves(name), f"{NAMES[name]} names {name}, which does not exist"


@pytest.mark.parametrize(
    "name",
    [
        "jblast.no_such_module",
        "jblast.scene.Charge.no_such_field",
        "calibration.nought",
    ],
)
def test_a_name_that_does_not_exist_is_found_out(name):
    assert not resolves(name)


def test_modules_quoted_by_their_path_exist():
    """A path may begin at any folder above the module."""
    known = [f"/{path.relative_to(ROOT).as_posix()}" for path in TEXTS]
    missing = [
        f"{path.relative_to(ROOT)} names {name}"
        for path, text in TEXTS.items()
        for name in PLACE.findall(text)
        if name not in ELSEWHERE and not any(one.endswith(f"/{name}") for one in known)
    ]
    assert not missing
