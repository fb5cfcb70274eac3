"""Compiled programs kept between runs.

`kept` compiles like `equinox.filter_jit` and stores the machine code. Another run loads
it without tracing or compiling. Its key holds all that the code depends on: the files
of the package, versions, processor, settings, shapes of arrays, and values of all other
arguments, spelled out as text. What has no lasting description is not stored: a
function from outside the package, such as a user's law, an array of constants, arrays
on several devices. JAX's own compilation cache then saves the compilation alone.
Nothing is stored before `keep_in` sets a folder, as commands do, or outside
`kept_between_runs`, in which the long functions of the library run.

Stored files hold machine code and pickled structures of results. They are therefore
read only from a folder that belongs to the user, closed to all others.
"""

import contextlib
import functools
import hashlib
import os
import pickle
import platform
import sys
import threading
import warnings
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from importlib.metadata import version
from pathlib import Path
from types import EllipsisType, FunctionType
from typing import Any, ParamSpec, TypeVar

import equinox as eqx
import jax
import numpy as np
from jax.core import Tracer
from jax.experimental import serialize_executable
from jax.experimental.compilation_cache import compilation_cache
from jaxlib import lapack

from jblast.files import write_bytes
from jblast.registry import PACKAGED, Law, others
from jblast.types import Module

P = ParamSpec("P")
R = TypeVar("R")
Program = Callable[..., Any]
LIBRARIES = ("jax", "jaxlib", "equinox", "optimistix", "lineax", "numpy")
SETTINGS = (
    "jax_enable_x64",
    "jax_default_matmul_precision",
    "jax_default_prng_impl",
    "jax_threefry_partitionable",
    "jax_numpy_dtype_promotion",
    "jax_default_device",
    "jax_disable_jit",
    "jax_debug_nans",
)
"""Settings of JAX that change a program without changing its arguments."""
CACHE_SETTINGS: dict[str, Any] = {
    "jax_persistent_cache_min_compile_time_secs": 0.0,
    "jax_persistent_cache_min_entry_size_bytes": 0,
}
"""Programs of a fit are small and many: JAX by default stores none below a second."""
WIDE: dict[str, Any] = {"compiler_options": {"xla_cpu_prefer_vector_width": 512}}
"""Options of `jax.jit` for flights: vectors of 512 bits instead of XLA's default of
256. A flight is a quarter faster on CPUs with such vectors."""


class _Store:
    """Folder of stored programs, and the program of each call in this process."""

    folder: Path | None = None
    used: dict[Hashable, Program]

    def __init__(self) -> None:
        self.used, self.lock = {}, threading.Lock()


STORE = _Store()


def keep_in(folder: str | Path | None) -> None:
    """Store compiled programs in a folder from now on; None: stop storing.

    The folder is closed to other users. One that belongs to another user is not used.
    """
    STORE.folder = None if folder is None else _closed(Path(folder))
    STORE.used = {}


def _closed(folder: Path) -> Path | None:
    """Make a folder that nobody else can write to; None if that cannot be done."""
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        if not hasattr(os, "getuid") or folder.stat().st_uid == os.getuid():
            folder.chmod(0o700)
            return folder
        fault = "it belongs to another user"
    except OSError as error:
        fault = str(error.strerror)
    warnings.warn(
        f"programs are not kept between runs in {folder}: {fault}", stacklevel=3
    )
    return None


def cache_folder() -> Path:
    """Return the folder for programs of commands and of the library."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "jblast"


@contextlib.contextmanager
def kept_between_runs() -> Iterator[None]:
    """Keep compiled programs of the enclosed code, as commands do.

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
            STORE.folder = _closed(cache_folder())
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
    if STORE.folder is None or getattr(jax.config, "jax_compilation_cache_dir"):  # noqa: B009 (type checkers)
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
    """Compile like `equinox.filter_jit`, and store the program between runs.

    A call within another program, or one without a key, uses `filter_jit` alone. The
    key takes milliseconds, and is made once for each structure of arguments; a later
    call costs what one of `filter_jit` does.

    Args:
        function: Function to compile.
        options: Options of `jax.jit`.
    """

    @functools.cache
    def compiled_with(laws: tuple[Law, ...]) -> Callable[P, R]:
        @functools.wraps(function)
        def with_laws(*args: P.args, **kwargs: P.kwargs) -> R:
            return function(*args, **kwargs)

        return eqx.filter_jit(with_laws, **options)

    @functools.wraps(function)
    def keeping(*args: P.args, **kwargs: P.kwargs) -> R:
        # programs look laws up by name, and a user may replace one
        laws = others()
        compiled = compiled_with(laws)
        leaves, tree = jax.tree.flatten((args, kwargs))
        arrays = [leaf for leaf in leaves if is_array(leaf)]
        # within another traced program there are no arrays to call with
        if any(isinstance(array, Tracer) for array in arrays):
            return compiled(*args, **kwargs)
        call = function, tree, tuple(map(_kind, leaves)), _settings(), laws
        program = STORE.used.get(call)
        if program is None and STORE.folder is not None:
            program = _program(function, (args, kwargs), options)
            STORE.used[call] = program or compiled
        if program is None or program is compiled:
            return compiled(*args, **kwargs)
        return program(arrays)

    return keeping


def is_array(value: Any) -> bool:
    """Return whether a value is an argument of a program, not a constant in it."""
    return isinstance(value, jax.Array | np.ndarray | np.generic)


def _kind(leaf: Any) -> Hashable:
    """Return what the program depends on of an argument."""
    if isinstance(leaf, jax.Array):
        weak = getattr(leaf, "weak_type", False)  # keys of random numbers have none
        return leaf.shape, leaf.dtype, weak, leaf.sharding
    if is_array(leaf):
        return leaf.shape, leaf.dtype
    return type(leaf), leaf


def _settings() -> tuple[Any, ...]:
    return tuple(getattr(jax.config, name) for name in SETTINGS)


def _program(function: Callable, arguments: Any, options: Any) -> Program | None:
    """Return the stored or newly compiled program for arguments; None without a key."""
    assert STORE.folder is not None
    try:
        path = STORE.folder / f"program-{_key(function, arguments, options)}"
    except Unkept:
        return None
    return _loaded(path) or _compiled(function, arguments, options, path)


def _compiled(
    function: Callable, arguments: Any, options: Any, path: Path
) -> Program | None:
    """Compile, store and return a program; None if JAX cannot store it."""
    leaves, tree = jax.tree.flatten(arguments)
    answers: list[Any] = []

    def flat(*arrays):
        left = iter(arrays)
        filled = [next(left) if is_array(leaf) else leaf for leaf in leaves]
        args, kwargs = jax.tree.unflatten(tree, filled)
        found, of = jax.tree.flatten(function(*args, **kwargs))
        slots = [_Slot() if is_array(leaf) else leaf for leaf in found]
        answers.append(jax.tree.unflatten(of, slots))
        return [leaf for leaf in found if is_array(leaf)]

    arrays = [leaf for leaf in leaves if is_array(leaf)]
    lowered = jax.jit(flat, **options).lower(*arrays)
    # code that was read from JAX's own cache cannot be stored again
    with STORE.lock:
        name = "jax_compilation_cache_dir"
        cache = {name: jax.config.values[name]}
        _set_cache(dict.fromkeys(cache))
        try:
            made = lowered.compile()
        finally:
            _set_cache(cache)
    try:
        data = pickle.dumps((*serialize_executable.serialize(made), answers[-1]))
    except (ValueError, NotImplementedError, TypeError, pickle.PicklingError):
        return None
    with contextlib.suppress(OSError):  # a full disk: not stored
        write_bytes(path, hashlib.sha256(data).digest() + data, durable=False)
    return _with_answer(made, answers[-1])


def _loaded(path: Path) -> Program | None:
    """Load a stored program; None if there is none, or it cannot be loaded."""
    try:
        with path.open("rb") as file:
            digest, data = file.read(32), file.read()
    except OSError:
        return None
    if hashlib.sha256(data).digest() != digest:
        return None
    try:
        code, of_arguments, of_arrays, answer = pickle.loads(data)
        if (
            b"lapack" in code
        ):  # its addresses are SciPy's, which JAX asks for in tracing
            lapack.prepare_lapack_call("potrf_ffi", np.dtype(float))
        program = serialize_executable.deserialize_and_load(
            code, of_arguments, of_arrays, execution_devices=jax.local_devices()[:1]
        )
    except Exception:  # what XLA refuses, for whatever reason, is compiled again
        return None
    return _with_answer(program, answer)


class _Slot:
    """Stands for an array in an answer."""


def _with_answer(program: Program, answer: Any) -> Program:
    """Return a program that fills the arrays of its answer."""
    leaves, tree = jax.tree.flatten(answer)

    def called(arrays: list[Any]) -> Any:
        found = iter(program(*arrays))
        filled = [next(found) if isinstance(x, _Slot) else x for x in leaves]
        return jax.tree.unflatten(tree, filled)

    return called


def _key(function: Callable, arguments: Any, options: Any) -> str:
    """Return a key of everything that a program depends on.

    Raises:
        Unkept: A part has no lasting description, or laws from outside the package are
            registered, whose code may depend on anything.
    """
    if others():
        raise Unkept
    around = _source(), _machine(), os.environ.get("XLA_FLAGS"), _settings(), options
    whole = f"{around} {spelled(function)} {spelled(arguments)}"
    return hashlib.sha256(whole.encode()).hexdigest()


@functools.cache
def _machine() -> str:
    """Return what machine code depends on: devices, their software, the processor."""
    device = jax.local_devices()[0]
    parts = [device.device_kind, device.client.platform_version, platform.machine()]
    with contextlib.suppress(OSError):  # the kinds of instructions; Linux alone
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        known = ("model name", "flags", "Features")
        parts += sorted({line for line in lines if line.startswith(known)})
    return " ".join(parts)


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


def spelled(value: Any, fixed: bool = False) -> str:
    """Return the text of an argument: shapes of arrays, values of anything else.

    Args:
        value: The argument, or a part of it.
        fixed: True if arrays in it would be constants of the program.

    Raises:
        Unkept: A part has no lasting description, or is on another device.
    """
    if isinstance(value, jax.Array) and value.devices() != {jax.local_devices()[0]}:
        raise Unkept
    if is_array(value) and not fixed:
        return f"{value.dtype}{value.shape}{getattr(value, 'weak_type', False)}"
    if isinstance(value, bool | int | float | complex | str | bytes | EllipsisType):
        return f"{type(value).__name__}:{value!r}"
    if value is None:
        return "None"
    if isinstance(value, Enum):
        return f"{spelled(type(value))}.{value.name}"
    if isinstance(value, Law) and PACKAGED.get((value.quantity, value.name)) is value:
        return f"law {value.quantity} {value.name}"
    if isinstance(value, type | FunctionType):
        return _name(value)
    if isinstance(value, dict):
        items = [(spelled(k, True), spelled(v, fixed)) for k, v in value.items()]
        return f"dict{sorted(items)}"
    if isinstance(value, tuple | list):
        return f"{_name(type(value))}{[spelled(entry, fixed) for entry in value]}"
    if is_dataclass(value):
        whole = fixed or not isinstance(value, eqx.Module | Module)
        entries = [
            spelled(getattr(value, f.name), whole or f.metadata.get("static", False))
            for f in fields(value)
        ]
        return f"{_name(type(value))}{entries}"
    raise Unkept


def _name(value: type | FunctionType) -> str:
    """Return module and name of a class or function.

    Raises:
        Unkept: They do not identify it: it is from outside of the package and of
            Python, or made by a function.
    """
    found: Any = sys.modules.get(value.__module__)
    for part in value.__qualname__.split("."):
        found = getattr(found, part, None)
    while found is not value and hasattr(found, "__wrapped__"):  # it is decorated
        found = found.__wrapped__
    if found is value and value.__module__.partition(".")[0] in ("jblast", "builtins"):
        return f"{value.__module__}:{value.__qualname__}"
    raise Unkept
