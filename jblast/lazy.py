"""Lazy imports: names that are imported at their first use.

There are two uses. A package with lazy names (`jblast`, `jblast.sensors`,
`jblast.study`, ...) imports them `if TYPE_CHECKING`, for type checkers and editors, and
sets `__getattr__, __dir__ = lazy_face(__name__)`, which reads that list: a command
imports only the modules that it uses. An entry of a registry (`registry.Registry`) may
name a function or module by its import path, as "jblast.sensors.geophone" or
"jblast.sensors.geophone:recorded", and `resolved` imports it at its use. The reader of
scene files thus has all kinds of sensors without their physics.
"""

import ast
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any


def lazy_face(face: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return the `__getattr__` and `__dir__` of a package with lazy names.

    Args:
        face: Name of the package.
    """
    module = sys.modules[face]

    @cache
    def homes() -> dict[str, str | None]:
        """Return the module of each name, from the list for type checkers."""
        tree = ast.parse(Path(str(module.__file__)).read_text())
        listed = (node.body for node in tree.body if isinstance(node, ast.If))
        lines = (line for body in listed for line in body)
        return {
            alias.name: line.module
            for line in lines
            if isinstance(line, ast.ImportFrom)
            for alias in line.names
        }

    def imported(name: str) -> Any:
        home = homes().get(name)
        if home is None:
            raise AttributeError(f"module {face!r} has no attribute {name!r}")
        value = getattr(import_module(home), name)
        # Stored, so that `__getattr__` is called once per name.
        setattr(module, name, value)
        return value

    return imported, lambda: sorted({*vars(module), *homes()})


def resolved(entry: Any) -> Any:
    """Return an entry, or the object at the import path that a text names.

    Args:
        entry: Any object, or "module" or "module:name".
    """
    if not isinstance(entry, str):
        return entry
    module, _, name = entry.partition(":")
    home = import_module(module)
    return getattr(home, name) if name else home
