"""Names that are imported at their first use: the one form of laziness of the package.

It has two uses. A face (`jblast`, `jblast.sensors`, `jblast.study`, ...) lists its
names with their modules and sets `__getattr__ = lazy_face(__name__, HOMES)`, so that a
command imports the modules it uses and no others. An entry of a registry
(`registry.Registry`) may name a function or module by its place, as
"jblast.sensors.geophone" or "jblast.vehicle.warp.position_hold:hold_functions", and
`resolved` imports it when it is used. So the reader of scene files knows all kinds of
sensors without importing their physics.
"""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy_face(face: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the `__getattr__` of a face.

    Args:
        face: Name of the package.
        homes: Module of each name; a module of the face itself is listed under its own
            name.
    """

    def imported(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {face!r} has no attribute {name!r}")
        home = import_module(homes[name])
        value = home if homes[name] == f"{face}.{name}" else getattr(home, name)
        setattr(sys.modules[face], name, value)
        return value

    return imported


def resolved(entry: Any) -> Any:
    """Return an entry itself, or the object at the place that a text names.

    Args:
        entry: Any object, or "module" or "module:name".
    """
    if not isinstance(entry, str):
        return entry
    module, _, name = entry.partition(":")
    home = import_module(module)
    return getattr(home, name) if name else home
