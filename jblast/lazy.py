"""Lazy imports: names that are imported at their first use.

There are two uses. A package with lazy names (`jblast`, `jblast.sensors`,
`jblast.study`, ...) lists them with their modules and sets
`__getattr__, __dir__ = lazy_face(__name__, HOMES)`, so that a command imports only the
modules that it uses. An entry of a registry (`registry.Registry`) may name a function
or module by its import path, as "jblast.sensors.geophone" or
"jblast.sensors.geophone:recorded", and `resolved` imports it at its
use. The reader of scene files thus has all kinds of sensors without their physics.
"""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy_face(
    face: str, homes: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return the `__getattr__` and `__dir__` of a package with lazy names.

    Args:
        face: Name of the package.
        homes: Module of each name; a submodule is listed under its own name.
    """

    def imported(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {face!r} has no attribute {name!r}")
        home = import_module(homes[name])
        # A submodule is itself the value, not a name in it.
        value = home if homes[name] == f"{face}.{name}" else getattr(home, name)
        # Stored, so that `__getattr__` is called once per name.
        setattr(sys.modules[face], name, value)
        return value

    return imported, lambda: sorted({*vars(sys.modules[face]), *homes})


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
