"""Traced programs kept between runs.

The compilation cache of JAX saves the compilation in a second run. To look a program up
there, it must be traced and lowered again, which is half of the work of a warm `jblast
fit`. `kept` stores the lowered program (`jax.export`) under a key made of all it
depends on: the package's own files, versions, the shapes of arrays and the values of
all other arguments. Arguments are spelled out as text for the key. The structure of a
result is described in JSON beside the program, with its arrays by their index, so that
another run can rebuild it. A program that depends on something without a lasting name
(a closure, a law from outside the package, an array spread over devices) is not kept.
Nothing is kept before `keep_in` sets a folder, as commands do and the library does not.
"""

import contextlib
import dataclasses
import functools
import hashlib
import importlib
import json
import os
import weakref
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from enum import Enum
from importlib.metadata import version
from pathlib import Path
from types import FunctionType
from typing import Any, ParamSpec, TypeVar

import equinox as eqx
import jax
import numpy as np
from jax import export
from jax.core import Tracer

from jblast.files import write_bytes
from jblast.registry import PACKAGED, Law, are_packaged

P = ParamSpec("P")
R = TypeVar("R")
LIBRARIES = ("jax", "jaxlib", "equinox", "optimistix", "lineax", "numpy")
LAPACK = ("geqrf", "orgqr", "ormqr", "potrf", "getrf", "syevd", "gesdd", "trsm")
UNSTABLE = tuple(
    export.DisabledSafetyCheck.custom_call(f"lapack_{kind}{name}_ffi")
    for kind in "sd"
    for name in LAPACK
)
"""Calls that another version of JAX may change: the version is part of the key."""
SETTINGS = (
    "jax_enable_x64",
    "jax_default_matmul_precision",
    "jax_default_prng_impl",
    "jax_threefry_partitionable",
)
WIDE: dict[str, Any] = {"compiler_options": {"xla_cpu_prefer_vector_width": 512}}
"""Options of `jax.jit`: XLA uses vectors of 256 bits by default. With 512, where the
CPU has them, a flight is a quarter faster."""


class _Store:
    """Folder of kept programs, and the programs that were used already."""

    folder: Path | None = None
    used: dict[str, Callable[..., Any] | None]

    def __init__(self) -> None:
        self.used = {}


STORE = _Store()


def keep_in(folder: str | Path | None) -> None:
    """Keep traced programs in a folder from now on; None: no longer."""
    STORE.folder = None if folder is None else Path(folder)
    STORE.used = {}


def kept(function: Callable[P, R], **options: Any) -> Callable[P, R]:
    """Compile as `equinox.filter_jit` does, and keep the traced program between runs.

    Where a program cannot be kept (inside another program, an argument that cannot be
    spelled out) this is `filter_jit` alone. The key takes a few milliseconds for a
    module that is new and 0.1 ms for one that was used before.

    Args:
        function: What to compile.
        options: Of `jax.jit`.
    """
    compiled = eqx.filter_jit(function, **options)

    @functools.wraps(function)
    def keeping(*args: P.args, **kwargs: P.kwargs) -> R:
        if STORE.folder is None:
            return compiled(*args, **kwargs)
        arguments = args, kwargs
        leaves = jax.tree.leaves(arguments)
        if any(isinstance(leaf, Tracer) for leaf in leaves):
            return compiled(*args, **kwargs)
        try:
            key = _key(function, arguments)
        except Unkept:
            return compiled(*args, **kwargs)
        if key not in STORE.used:
            path = STORE.folder / f"traced-{key}"
            STORE.used[key] = _read(path, options) or _made(
                function, arguments, path, options
            )
        program = STORE.used[key]
        if program is None:
            return compiled(*args, **kwargs)
        return program(*(leaf for leaf in leaves if is_array(leaf)))

    return keeping


def _made(
    function: Callable, arguments: Any, path: Path, options: Any
) -> Callable | None:
    """Trace a program, write it down, and return it; None where it cannot be kept."""
    leaves, tree = jax.tree.flatten(arguments)
    structure = []

    def flat(*arrays):
        left = iter(arrays)
        filled = [next(left) if is_array(leaf) else leaf for leaf in leaves]
        args, kwargs = jax.tree.unflatten(tree, filled)
        answer = function(*args, **kwargs)
        found: list[Any] = []
        structure.append(described(answer, found))
        return found

    arrays = [leaf for leaf in leaves if is_array(leaf)]
    try:
        made = export.export(jax.jit(flat), disabled_checks=UNSTABLE)(*arrays)
        data = bytes(made.serialize())
    except (Unkept, ValueError, NotImplementedError, ImportError):
        return None
    head = json.dumps(structure[-1]).encode()
    with contextlib.suppress(OSError):  # a full disk: not kept
        path.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(path, head + b"\n" + data, durable=False)
    # from the bytes, as in later runs: XLA's cache distinguishes it from `made`
    return _program(data, structure[-1], options)


def _read(path: Path, options: Any) -> Callable | None:
    """Return a kept program, or None if there is none that can be read."""
    try:
        head, data = path.read_bytes().split(b"\n", 1)
        return _program(data, json.loads(head), options)
    except Exception:  # none, or not whole: it is made again
        return None


def _program(data: bytes, structure: Any, options: Any) -> Callable:
    program = export.deserialize(bytearray(data))
    if b"lapack" not in program.mlir_module_serialized:
        # JAX looks LAPACK up in SciPy for any program for a CPU, a third of an import
        # of JAX; the backend is part of the key already
        free = export.DisabledSafetyCheck.platform(), *program.disabled_safety_checks
        program = dataclasses.replace(
            program, platforms=(), disabled_safety_checks=free
        )
    run = jax.jit(program.call, **options)
    return lambda *arrays: rebuilt(structure, run(*arrays))


def _key(function: Callable, arguments: Any) -> str:
    """Return a key of everything that a program depends on."""
    whole = f"{_surroundings()} {spelled(function)} {spelled(arguments)}"
    return hashlib.sha256(whole.encode()).hexdigest()


@functools.cache
def _source() -> str:
    """Return a fingerprint of the package's files and the libraries' versions."""
    digest = hashlib.sha256(_contents(Path(__file__).parent).encode())
    digest.update(" ".join(version(name) for name in LIBRARIES).encode())
    return digest.hexdigest()


def _contents(root: Path) -> str:
    """Return the fingerprint of a folder's files, which are read if one was touched."""
    if STORE.folder is None:
        return fingerprint(root)
    state = hashlib.sha256(str(root).encode())
    for path in _files(root):
        at = os.stat(path)
        touched = f" {path} {at.st_size} {at.st_mtime_ns} {at.st_ctime_ns} {at.st_ino}"
        state.update(touched.encode())
    known = STORE.folder / f"source-{state.hexdigest()}"
    with contextlib.suppress(OSError, UnicodeDecodeError):
        if len(digest := known.read_text()) == 2 * state.digest_size:
            return digest
    digest = fingerprint(root)
    with contextlib.suppress(OSError):  # a full disk: read again the next time
        known.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(known, digest.encode(), durable=False)
    return digest


def fingerprint(root: Path) -> str:
    """Return the fingerprint of all files below a folder, without compiled Python."""
    digest = hashlib.sha256()
    for path in _files(root):
        digest.update(f" {os.path.relpath(path, root)} ".encode())
        digest.update(Path(path).read_bytes())
    return digest.hexdigest()


def _files(root: Path) -> Iterator[str]:
    """Go through the files below a folder in their order."""
    for folder, folders, names in os.walk(root):
        folders[:] = sorted(set(folders) - {"__pycache__"})
        for name in sorted(names):
            if not name.endswith(".pyc"):
                yield os.path.join(folder, name)


def _surroundings() -> str:
    """Return the settings and versions that tracing depends on.

    Raises:
        Unkept: A law from outside the package is registered.
    """
    if not are_packaged():
        raise Unkept
    settings = [getattr(jax.config, name) for name in SETTINGS]
    return f"{_source()} {jax.default_backend()} {settings}"


class Unkept(Exception):
    """A program cannot be kept: it depends on something without a lasting name."""


def is_array(value: Any) -> bool:
    """Return whether a value is given to a program, not part of it."""
    return isinstance(value, jax.Array | np.ndarray | np.generic)


class _Spellings:
    """Spellings of modules in use.

    A module is immutable, so that it is spelled out once. A search calls programs with
    one posterior thousands of times; spelling it out took half of that time.
    """

    def __init__(self) -> None:
        self.known: dict[int, tuple[weakref.ref, str]] = {}

    def of(self, module: eqx.Module) -> str:
        """Return the spelling of a module that is not part of the program."""
        name = id(module)
        there = self.known.get(name)
        if there is not None and there[0]() is module:
            return there[1]
        found = _of_fields(module, fixed=False)
        forget = functools.partial(self._forget, name)
        self.known[name] = weakref.ref(module, forget), found
        return found

    def _forget(self, name: int, gone: weakref.ref) -> None:
        there = self.known.get(name)
        if there is not None and there[0] is gone:  # the number may be in use again
            del self.known[name]


_SPELLINGS = _Spellings()


def spelled(value: Any, fixed: bool = False) -> str:
    """Spell an argument out: the shape of an array, the value of anything else.

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
    if isinstance(value, eqx.Module) and not fixed:
        return _SPELLINGS.of(value)
    if is_dataclass(value):
        return _of_fields(value, fixed=True)
    raise Unkept


def _of_fields(value: Any, *, fixed: bool) -> str:
    """Spell a data class out by its fields; see `spelled`."""
    entries = [
        spelled(getattr(value, f.name), fixed or f.metadata.get("static", False))
        for f in fields(value)
    ]
    return f"{name_of(type(value))}{entries}"


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
