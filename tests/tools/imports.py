"""The reader of import statements, those inside functions too."""

import ast
from collections.abc import Iterator
from pathlib import Path

import jblast

PACKAGE = Path(jblast.__file__).parent


def module_of(path: Path, root: Path = PACKAGE.parent) -> str:
    """Return the dotted name of a source file; a face's is that of its folder."""
    name = ".".join(path.relative_to(root).with_suffix("").parts)
    return name.removesuffix(".__init__")


def package_of(path: Path, root: Path = PACKAGE.parent) -> str:
    """Return the dotted name of the folder of a source file."""
    return ".".join(path.parent.relative_to(root).parts)


def imported(source: str, package: str) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield the module of each import by its full name, and what is taken from it.

    Args:
        source: Python.
        package: The folder it stands in, which leading dots are counted from.
    """
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, ()) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parts = package.split(".")
            above = parts[: len(parts) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            yield base, tuple(alias.name for alias in node.names)
