"""What a kept program depends on, and what it answers, in words another run reads."""

import functools
import importlib
from dataclasses import fields, is_dataclass
from enum import Enum
from types import FunctionType
from typing import Any

import equinox as eqx
import jax
import numpy as np

from jblast.registry import PACKAGED, Law


class Unkept(Exception):
    """A program cannot be kept: it depends on what cannot be written down."""


def is_array(value: Any) -> bool:
    """Return whether a value is given to a program, not part of it."""
    return isinstance(value, jax.Array | np.ndarray | np.generic)


def spelled(value: Any, fixed: bool = False) -> str:
    """Write an argument down: of arrays the shape, of all else the value.

    Args:
        value: The argument, or a part of it.
        fixed: Whether an array in it would be part of the program.

    Raises:
        Unkept: It holds what has no lasting name, or is spread over devices.
    """
    if isinstance(value, jax.Array) and len(value.devices()) > 1:
        raise Unkept
    if is_array(value) and not fixed:
        return f"{value.dtype}{value.shape}{getattr(value, 'weak_type', False)}"
    if value is None or isinstance(value, bool | int | float | complex | str):
        return f"{type(value).__name__}:{value!r}"
    if isinstance(value, Enum):
        return f"{name_of(type(value))}.{value.name}"
    if isinstance(value, Law) and PACKAGED.get((value.quantity, value.name)) is value:
        return f"law {value.quantity} {value.name}"
    if isinstance(value, type):
        return name_of(value)
    if isinstance(value, FunctionType) and value.__closure__ is None:
        return name_of(value)
    if isinstance(value, dict):
        items = [(spelled(k, True), spelled(v, fixed)) for k, v in value.items()]
        return f"dict{sorted(items)}"
    if isinstance(value, tuple | list):
        return f"{name_of(type(value))}{[spelled(entry, fixed) for entry in value]}"
    if is_dataclass(value):
        whole = fixed or not isinstance(value, eqx.Module)
        entries = [
            spelled(getattr(value, f.name), whole or f.metadata.get("static", False))
            for f in fields(value)
        ]
        return f"{name_of(type(value))}{entries}"
    raise Unkept


def name_of(value: type | FunctionType) -> str:
    """Return where a class or function is defined.

    Raises:
        Unkept: Neither in this package nor in Python itself, or in a function.
    """
    package = value.__module__.partition(".")[0]
    if package not in ("jblast", "builtins") or "<" in value.__qualname__:
        raise Unkept
    return f"{value.__module__}:{value.__qualname__}"


def described(value: Any, found: list[Any]) -> Any:
    """Describe an answer in JSON, its arrays by their place in `found`.

    Raises:
        Unkept: It holds what JSON does not.
    """
    if is_array(value):
        found.append(value)
        return ["array", len(found) - 1]
    if value is None or isinstance(value, bool | int | float | str):
        return ["value", value]
    if isinstance(value, dict) and all(isinstance(key, str) for key in value):
        return ["dict", [[k, described(v, found)] for k, v in value.items()]]
    if hasattr(value, "_fields") or type(value) in (tuple, list):
        entries = [described(entry, found) for entry in value]
        return ["sequence", name_of(type(value)), entries]
    if isinstance(value, eqx.Module):
        entries = [
            [f.name, described(getattr(value, f.name), found)] for f in fields(value)
        ]
        return ["module", name_of(type(value)), entries]
    raise Unkept


def rebuilt(description: Any, arrays: list[Any]) -> Any:
    """Return the answer that was described."""
    kind, *rest = description
    if kind == "array":
        return arrays[rest[0]]
    if kind == "value":
        return rest[0]
    if kind == "dict":
        return {key: rebuilt(entry, arrays) for key, entry in rest[0]}
    module, name = rest[0].split(":")
    home = importlib.import_module(module)
    made: Any = functools.reduce(getattr, name.split("."), home)
    if kind == "sequence":
        entries = [rebuilt(entry, arrays) for entry in rest[1]]
        return made(*entries) if hasattr(made, "_fields") else made(entries)
    answer = object.__new__(made)
    for field, entry in rest[1]:
        object.__setattr__(answer, field, rebuilt(entry, arrays))
    return answer
