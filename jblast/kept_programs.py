"""Traced programs kept between runs.

JAX's compilation cache saves the compilation in a second run. But to look a program up
there, it must be traced and lowered again, which is half of the work of a warm `jblast
fit`. `kept` stores the lowered program (`jax.export`) under a key of all that it
depends on: the package's files, versions, shapes of arrays and values of all other
arguments, spelled out as text. The structure of a result is stored next to the program
in JSON, with arrays by index, so that another run can rebuild it. A function or class
from outside the package, such as a user's law, enters the key with its code and the
values that it refers to. A program that depends on something without a lasting
description (an open file, an array spread over devices) is not stored. Nothing is
stored before `keep_in` sets a folder, as commands do, or outside `kept_between_runs`,
in which the long functions of the library run.
"""

import contextlib
import dataclasses
import functools
import hashlib
import importlib
import json
import os
import sys
import sysconfig
import threading
import weakref
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from importlib.metadata import version
from pathlib import Path
from types import CodeType, EllipsisType, FunctionType, MethodType, ModuleType
from typing import Any, ParamSpec, TypeVar

import equinox as eqx
import jax
import numpy as np
from jax import export
from jax.core import Tracer
from jax.experimental.compilation_cache import compilation_cache

from jblast.files import write_bytes
from jblast.registry import PACKAGED, Law, others

P = ParamSpec("P")
R = TypeVar("R")
LIBRARIES = ("jax", "jaxlib", "equinox", "optimistix", "lineax", "numpy")
LAPACK = ("geqrf", "orgqr", "ormqr", "potrf", "getrf", "syevd", "gesdd", "trsm")
UNSTABLE = tuple(
    export.DisabledSafetyCheck.custom_call(f"lapack_{kind}{name}_ffi")
    for kind in "sd"
    for name in LAPACK
)
"""Calls that JAX may change between versions; allowed, as the version is in the key."""
CHECKERS = ("jaxtyping", "beartype")
"""Packages whose wrappers only check arguments: the wrapped function is keyed."""
SETTINGS = (
    "jax_enable_x64",
    "jax_default_matmul_precision",
    "jax_default_prng_impl",
    "jax_threefry_partitionable",
)
CACHE_SETTINGS: dict[str, Any] = {
    "jax_persistent_cache_min_compile_time_secs": 0.0,
    "jax_persistent_cache_min_entry_size_bytes": 0,
}
"""Programs of a fit are small and many: JAX by default stores none below a second."""
WIDE: dict[str, Any] = {"compiler_options": {"xla_cpu_prefer_vector_width": 512}}
"""Options of `jax.jit` for flights: vectors of 512 bits instead of XLA's default of
256. A flight is a quarter faster on CPUs with such vectors."""


class _Store:
    """Folder of stored programs, and programs already used in this process."""

    folder: Path | None = None
    used: dict[str, Callable[..., Any] | None]

    def __init__(self) -> None:
        self.used, self.lock = {}, threading.Lock()


STORE = _Store()


def keep_in(folder: str | Path | None) -> None:
    """Store traced programs in a folder from now on; None: stop storing."""
    STORE.folder = None if folder is None else Path(folder)
    STORE.used = {}


def cache_folder() -> Path:
    """Return the folder for programs of commands and of the library."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "jblast"


@contextlib.contextmanager
def kept_between_runs() -> Iterator[None]:
    """Keep traced and compiled programs of the enclosed code, as commands do.

    Without it every process traces and compiles again: `jblast.fit` of `hta_1.csv`
    then takes 92 s of processor time in a script instead of 8. A compilation cache that
    the user has set stays in use. Otherwise JAX uses that of the commands until the
    enclosed code ends, and its settings are then what they were before.
    `JBLAST_KEEP_PROGRAMS=0` turns this off.
    """
    with STORE.lock:
        # set already by a command, or by a call around this one or in another thread
        outermost = (
            STORE.folder is None and os.environ.get("JBLAST_KEEP_PROGRAMS") != "0"
        )
        before: dict[str, Any] = {}
        if outermost:
            STORE.folder = cache_folder()
            before = _cache_used()
    try:
        yield
    finally:
        if outermost:
            with STORE.lock:
                STORE.folder = None  # programs that were used stay in memory
                _set_cache(before)


def _cache_used() -> dict[str, Any]:
    """Turn on the compilation cache unless the user did; return the former settings."""
    if getattr(jax.config, "jax_compilation_cache_dir"):  # noqa: B009 (type checkers)
        return {}
    wanted = CACHE_SETTINGS | {"jax_compilation_cache_dir": str(STORE.folder)}
    before = {name: getattr(jax.config, name) for name in wanted}
    write_cache_atomically()
    _set_cache(wanted)
    return before


def _set_cache(settings: Mapping[str, Any]) -> None:
    for name, value in settings.items():
        jax.config.update(name, value)
    if settings:
        # JAX reads the settings at its first compilation only
        compilation_cache.reset_cache()


def write_cache_atomically() -> None:
    """Make JAX rename a file of its cache into place once it is complete.

    JAX itself writes in place, so that another process may read half of a program. A
    file cut short by a kill is read again at every later start, with a warning each.
    """
    try:
        from jax._src import lru_cache
    except ImportError:  # another version of JAX: its cache is left as it is
        return

    def put(cache, key: str, value: bytes) -> None:
        path = cache.path / f"{key}-cache"
        if not path.exists():
            write_bytes(path, value, durable=False)

    setattr(lru_cache.LRUCache, "put", put)  # noqa: B010 (type checkers)


def kept(function: Callable[P, R], **options: Any) -> Callable[P, R]:
    """Compile like `equinox.filter_jit`, and store the traced program between runs.

    A program that cannot be stored (inside another program, or with an argument that
    cannot be spelled out) uses `filter_jit` alone. The key takes a few milliseconds for
    a new module and 0.1 ms for a known one.

    Args:
        function: Function to compile.
        options: Options of `jax.jit`.
    """
    compiled = eqx.filter_jit(function, **options)

    @functools.wraps(function)
    def keeping(*args: P.args, **kwargs: P.kwargs) -> R:
        if STORE.folder is None:
            return compiled(*args, **kwargs)
        leaves = jax.tree.leaves((args, kwargs))
        # Within another traced program there are no values to key or arrays to call
        # with.
        if any(isinstance(leaf, Tracer) for leaf in leaves):
            return compiled(*args, **kwargs)
        program = _program_for(function, (args, kwargs), options)
        if program is None:
            return compiled(*args, **kwargs)
        return program(*(leaf for leaf in leaves if is_array(leaf)))

    return keeping


def kept_once(function: Callable[P, R]) -> Callable[P, R]:
    """Compile like `kept`, and look the stored program up only when JAX traces.

    Later calls with arguments of the same layout do without the key, which takes longer
    than a step of an environment. A layout whose first call is outside
    `kept_between_runs` is compiled and not stored.
    """

    @functools.wraps(function)
    def looked_up(*args: P.args, **kwargs: P.kwargs) -> R:
        program = None
        if STORE.folder is not None:
            program = _program_for(function, (args, kwargs), {})
        if program is None:
            return function(*args, **kwargs)
        return program(*filter(is_array, jax.tree.leaves((args, kwargs))))

    return eqx.filter_jit(looked_up)


def _program_for(function: Callable, arguments: Any, options: Any) -> Callable | None:
    """Return the stored or traced program for arguments; None if it has no key."""
    assert STORE.folder is not None
    try:
        key = _key(function, arguments)
    except Unkept:
        return None
    if key not in STORE.used:
        path = STORE.folder / f"traced-{key}"
        # A None is stored, too, so that a program that cannot be exported is tried only
        # once.
        STORE.used[key] = _read(path, options) or _traced(
            function, arguments, path, options
        )
    return STORE.used[key]


def _traced(
    function: Callable, arguments: Any, path: Path, options: Any
) -> Callable | None:
    """Trace, store and return a program; None if it cannot be stored."""
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
    with contextlib.suppress(OSError):  # a full disk: not stored
        path.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(path, head + b"\n" + data, durable=False)
    # From the bytes, as in later runs: XLA's cache distinguishes it from `made`, so
    # that the next run would compile again.
    return _program(data, structure[-1], options)


def _read(path: Path, options: Any) -> Callable | None:
    """Return a stored program; None if there is none or it cannot be read."""
    try:
        head, data = path.read_bytes().split(b"\n", 1)
        return _program(data, json.loads(head), options)
    except Exception:  # missing or truncated: it is traced again
        return None


def _program(data: bytes, structure: Any, options: Any) -> Callable:
    program = export.deserialize(bytearray(data))
    if b"lapack" not in program.mlir_module_serialized:
        # For every CPU program JAX imports SciPy's LAPACK, a third of the import time
        # of JAX. Without the platform check it does not; the backend is in the key.
        # The platforms are emptied together with the check.
        free = export.DisabledSafetyCheck.platform(), *program.disabled_safety_checks
        program = dataclasses.replace(
            program, platforms=(), disabled_safety_checks=free
        )
    run = jax.jit(program.call, **options)
    return lambda *arrays: rebuilt(structure, run(*arrays))


def _key(function: Callable, arguments: Any) -> str:
    """Return a key of everything that a program depends on.

    Raises:
        Unkept: A law from outside the package, or a part of an argument, has no lasting
            description.
    """
    # Settings of JAX that change a traced program without changing its arguments.
    settings = [getattr(jax.config, name) for name in SETTINGS]
    foreign = sorted(f"{law.quantity} {law.name} {source_of(law)}" for law in others())
    around = f"{_source()} {jax.default_backend()} {settings} {foreign}"
    whole = f"{around} {spelled(function)} {spelled(arguments)}"
    return hashlib.sha256(whole.encode()).hexdigest()


@functools.cache
def _source() -> str:
    """Return a digest of the package's files and the libraries' versions."""
    digest = hashlib.sha256(_contents(Path(__file__).parent).encode())
    digest.update(" ".join(version(name) for name in LIBRARIES).encode())
    return digest.hexdigest()


def _contents(root: Path) -> str:
    """Return the digest of a folder's files, which are read only if one has changed."""
    if STORE.folder is None:
        return fingerprint(root)
    state = hashlib.sha256(str(root).encode())
    for path in _files(root):
        at = os.stat(path)
        # Sizes, times and inodes: reading all files of the package takes longer than a
        # warm start.
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
    """Return the digest of all files below a folder, without compiled Python."""
    digest = hashlib.sha256()
    for path in _files(root):
        digest.update(f" {os.path.relpath(path, root)} ".encode())
        digest.update(Path(path).read_bytes())
    return digest.hexdigest()


def _files(root: Path) -> Iterator[str]:
    """Yield the files below a folder in sorted order."""
    for folder, folders, names in os.walk(root):
        folders[:] = sorted(set(folders) - {"__pycache__"})
        for name in sorted(names):
            if not name.endswith(".pyc"):
                yield os.path.join(folder, name)


class Unkept(Exception):
    """A program depends on something without a lasting description."""


def is_array(value: Any) -> bool:
    """Return whether a value is an argument of a program, not a constant in it."""
    return isinstance(value, jax.Array | np.ndarray | np.generic)


class _SpellingCache:
    """Spellings of modules in use, by identity.

    Modules are immutable, so each is spelled out once. A search calls programs with one
    posterior thousands of times; spelling it out took half of that time.
    """

    def __init__(self) -> None:
        self.known: dict[int, tuple[weakref.ref, str]] = {}

    def of(self, module: eqx.Module) -> str:
        """Return the spelling of a module that is an argument of a program."""
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
        # The identity may have been reused by another module.
        if there is not None and there[0] is gone:
            del self.known[name]


_SPELLING_CACHE = _SpellingCache()


def spelled(value: Any, fixed: bool = False) -> str:
    """Return the text of an argument: shapes of arrays, values of anything else.

    Functions and classes from outside the package are represented by their source
    (`source_of`).

    Args:
        value: The argument, or a part of it.
        fixed: True if arrays in it would be constants of the program.

    Raises:
        Unkept: A part has no lasting description, or is spread over devices.
    """
    known = isinstance(value, jax.Array) and not isinstance(value, Tracer)
    if known and len(value.devices()) > 1:
        raise Unkept
    if is_array(value) and not fixed:
        return f"{value.dtype}{value.shape}{getattr(value, 'weak_type', False)}"
    if is_plain(value):
        return f"{type(value).__name__}:{value!r}"
    if isinstance(value, Enum):
        return f"{spelled(type(value))}.{value.name}"
    if isinstance(value, Law) and PACKAGED.get((value.quantity, value.name)) is value:
        return f"law {value.quantity} {value.name}"
    if isinstance(value, type | FunctionType):
        return name_of(value) if is_packaged(value) else source_of(value)
    if isinstance(value, dict):
        items = [(spelled(k, True), spelled(v, fixed)) for k, v in value.items()]
        return f"dict{sorted(items)}"
    if isinstance(value, tuple | list):
        return f"{spelled(type(value))}{[spelled(entry, fixed) for entry in value]}"
    if isinstance(value, eqx.Module) and not fixed:
        return _SPELLING_CACHE.of(value)
    if is_dataclass(value):
        return _of_fields(value, fixed=True)
    raise Unkept


def _of_fields(value: Any, *, fixed: bool) -> str:
    """Return the text of a data class by its fields; see `spelled`."""
    entries = [
        spelled(getattr(value, f.name), fixed or f.metadata.get("static", False))
        for f in fields(value)
    ]
    return f"{spelled(type(value))}{entries}"


def is_plain(value: Any) -> bool:
    """Return whether a value is a number, a text or None."""
    plain = bool | int | float | complex | str | bytes | EllipsisType | None
    return isinstance(value, plain)


def is_packaged(value: type | FunctionType) -> bool:
    """Return whether the name of a class or function identifies it in a key."""
    if isinstance(value, FunctionType) and value.__closure__ is not None:
        return False
    package = value.__module__.partition(".")[0]
    return package in ("jblast", "builtins") and "<" not in value.__qualname__


def name_of(value: type | FunctionType) -> str:
    """Return module and name of a class or function.

    Raises:
        Unkept: It is not in this package or in Python, or it is nested in a function.
    """
    if not is_packaged(value):
        raise Unkept
    return f"{value.__module__}:{value.__qualname__}"


# Called for each law at each call of a kept function: 0.5 ms without the cache.
@functools.lru_cache(maxsize=512)
def source_of(value: Hashable) -> str:
    """Return a digest of a function or class from outside the package.

    It covers the bytecode with its constants, defaults, values of a closure, and
    recursively every function, class and number that the code refers to by a global
    name. An edited law, or one created with another constant, is therefore another
    program, and the same law in another process is the same program. Installed packages
    enter with their version. Like a compiled program, a function is described once per
    process; a later change of a global is not detected.

    Raises:
        Unkept: It refers to an object without a lasting description, such as a file.
    """
    digest = hashlib.sha256()
    for part in _Description().parts(value):
        digest.update(part.encode() + b"\0")
    return f"source {digest.hexdigest()}"


class _Description:
    """Traversal of everything that a function refers to; each object once."""

    def __init__(self) -> None:
        self.seen: dict[int, int] = {}
        self.alive: list[Any] = []  # keeps objects alive, so that ids are not reused

    def parts(self, value: Any) -> Iterator[str]:
        """Yield descriptions of a value and of everything that it refers to.

        Raises:
            Unkept: A value has no lasting description.
        """
        if is_plain(value):
            yield f"{type(value).__name__}:{value!r}"
            return
        if id(value) in self.seen:
            yield f"again {self.seen[id(value)]}"
            return
        self.seen[id(value)] = len(self.seen)
        self.alive.append(value)
        if isinstance(value, jax.Array | np.ndarray | np.generic):
            array = np.asarray(value)
            yield f"{array.dtype}{array.shape}"
            yield hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()
        elif isinstance(value, tuple | list):
            yield f"{type(value).__name__} {len(value)}"
            for entry in value:
                yield from self.parts(entry)
        elif isinstance(value, set | frozenset):
            yield f"set {sorted(map(repr, value))}"
        elif isinstance(value, Mapping):
            yield f"{type(value).__name__} {len(value)}"
            for key, entry in value.items():
                yield from self.parts(key)
                yield from self.parts(entry)
        elif isinstance(value, CodeType):
            yield from self._code(value)
        elif isinstance(value, ModuleType):
            yield _versioned(value.__name__)
        elif isinstance(value, FunctionType):
            yield from self._function(value)
        elif isinstance(value, type):
            yield from self._class(value)
        elif isinstance(value, MethodType):
            yield from self.parts(value.__func__)
            yield from self.parts(value.__self__)
        elif isinstance(value, functools.partial):
            yield from self.parts((value.func, value.args, value.keywords))
        elif isinstance(value, property):
            yield from self.parts(value.fget)
        elif isinstance(value, staticmethod | classmethod):
            yield from self.parts(value.__func__)
        elif isinstance(value, Enum):
            yield f"{type(value).__qualname__}.{value.name}"
        elif hasattr(value, "__wrapped__"):  # as jax.jit and jax.custom_jvp return
            yield type(value).__qualname__
            yield from self.parts(value.__wrapped__)
            for rule in ("jvp", "fwd", "bwd"):
                yield from self.parts(getattr(value, rule, None))
        elif is_dataclass(value):
            yield from self.parts(type(value))
            for one in fields(value):
                yield from self.parts(getattr(value, one.name, None))
        elif isinstance(home := getattr(value, "__module__", None), str) and hasattr(
            value, "__name__"
        ):  # a ufunc, or a function written in C
            yield f"{_versioned(home)}:{value.__name__}"
        else:
            raise Unkept

    def _code(self, code: CodeType) -> Iterator[str]:
        yield f"{code.co_code.hex()} {code.co_names} {code.co_varnames}"
        for constant in code.co_consts:
            yield from self.parts(constant)

    def _function(self, function: FunctionType) -> Iterator[str]:
        home = function.__globals__.get("__name__", "")
        if home.partition(".")[0] in CHECKERS:
            yield from self.parts(getattr(function, "__wrapped__", None))
            return
        code = function.__code__
        if _is_installed(home):
            yield f"{_versioned(home)}:{code.co_qualname}:{code.co_firstlineno}"
        else:
            yield from self.parts(code)
            yield from self._names_in(function.__globals__, _names(code))
        yield from self.parts((function.__defaults__, function.__kwdefaults__))
        for cell in function.__closure__ or ():
            try:
                yield from self.parts(cell.cell_contents)
            except ValueError:  # an empty cell, as in a recursive definition
                yield "empty"

    def _names_in(self, known: Mapping[str, Any], names: set[str]) -> Iterator[str]:
        """Yield the values that code refers to by names of its module.

        For another module of the user, all attributes of these names are included:
        superfluous ones only make the key stricter.
        """
        for name in sorted(names & set(known)):
            value = known[name]
            again = id(value) in self.seen
            yield name
            yield from self.parts(value)
            if again or not isinstance(value, ModuleType):
                continue
            if not _is_installed(value.__name__):
                yield from self._names_in(vars(value), names)

    def _class(self, cls: type) -> Iterator[str]:
        yield f"{cls.__module__}:{cls.__qualname__}"
        if _is_installed(cls.__module__):
            yield _versioned(cls.__module__)
            return
        yield from self.parts(cls.__bases__)
        for name, value in sorted(vars(cls).items()):
            value = getattr(value, "method", value)  # equinox wraps those of modules
            if isinstance(value, FunctionType):
                # dataclasses write theirs from the fields, whose values are keyed
                written = value.__code__.co_filename != "<string>"
            else:
                written = name[:2] != "__" and not name.startswith("_abc_")
            if written:
                yield name
                yield from self.parts(value)


def _names(code: CodeType) -> set[str]:
    inner = (one for one in code.co_consts if isinstance(one, CodeType))
    return set(code.co_names).union(*map(_names, inner))


@functools.cache
def _is_installed(module: str) -> bool:
    """Return whether a version or the key identifies the contents of a module."""
    top = module.partition(".")[0]
    if top in ("jblast", "builtins") or top in sys.stdlib_module_names:
        return True
    file = getattr(sys.modules.get(top), "__file__", None)
    folders = (sysconfig.get_path(kind) for kind in ("purelib", "platlib"))
    return file is not None and any(Path(file).is_relative_to(one) for one in folders)


@functools.cache
def _versioned(module: str) -> str:
    """Return the name of a module, with the version of its package if installed."""
    top = module.partition(".")[0]
    return f"{module} {getattr(sys.modules.get(top), '__version__', '')}"


def described(value: Any, found: list[Any]) -> Any:
    """Describe a result in JSON, with its arrays as indices into `found`.

    Raises:
        Unkept: A part has no representation in JSON.
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
    """Return the result of a description."""
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
    # Without `__init__`, whose converters and checks would run on every result.
    answer = object.__new__(made)
    for field, entry in rest[1]:
        object.__setattr__(answer, field, rebuilt(entry, arrays))
    return answer
