"""Values of a scene: frozen dataclasses with array fields, with and without JAX.

A scene, its paths and the laws are needed by commands that answer in less time than
JAX takes to import. A `Module` is therefore a plain frozen dataclass, which becomes a
PyTree as soon as JAX is imported, by whomever. Its numbers are NumPy arrays before, and
JAX arrays from then on. A function of both kinds of arrays takes its operations from
`namespace`.
"""

import functools
import sys
from collections.abc import Callable, Sequence
from dataclasses import MISSING, dataclass, field as dataclass_field, fields
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar, dataclass_transform

import numpy as np

from jblast.errors import nearest, require, shown

# The import of jaxtyping takes a tenth of that of JAX. Annotations are checked only by
# its import hook, for which it has been imported before this module.
if TYPE_CHECKING or "jaxtyping" in sys.modules:
    from jaxtyping import Bool as Bool, Complex as Complex, Float as Float, Int as Int
else:

    class _Unchecked:
        def __getitem__(self, _: Any) -> Any:
            return Any

    Bool = Complex = Float = Int = _Unchecked()

# jaxtyping imports JAX for these names. At run time a shape and a type of numbers are
# checked by `Float[Any, "..."]` for the arrays of both.
if TYPE_CHECKING:
    from jaxtyping import Array as Array, ArrayLike as ArrayLike

    Scalar = Any  # the constructor also accepts plain numbers
else:
    Array = ArrayLike = Any
    Scalar = Float[Any, ""]

P = ParamSpec("P")
R = TypeVar("R")


def jax_is_loaded() -> bool:
    """Return whether JAX is imported, so that numbers become JAX arrays."""
    return not _WAITING.waits


def namespace(*values: Any) -> Any:
    """Return `jax.numpy` if a value is a JAX array, also a traced one; else NumPy."""
    if jax_is_loaded():
        jax = sys.modules["jax"]
        if any(isinstance(value, jax.Array) for value in values):
            return sys.modules["jax.numpy"]
    return np


def in_numpy(value: R) -> R:
    """Return a value with its numbers as NumPy arrays, whose functions need no JAX."""
    if not jax_is_loaded():
        return value
    import jax

    return jax.tree.map(np.asarray, value)


def is_traced(value: Any) -> bool:
    """Return whether a value stands for one that JAX traces, and cannot be checked."""
    return jax_is_loaded() and isinstance(value, sys.modules["jax"].core.Tracer)


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function of arrays run as one program for JAX arrays, plainly for NumPy's.

    Its operations are those of `namespace`.
    """

    @functools.cache
    def program() -> Callable[P, R]:
        import jax

        return jax.jit(function)

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        in_numpy = namespace(*args, *kwargs.values()) is np
        return (function if in_numpy else program())(*args, **kwargs)

    return call


def as_numbers(value: ArrayLike | Sequence[ArrayLike]) -> Float[Array, "..."]:
    """Convert numbers to a float array: of JAX, in its default precision, if loaded.

    A bare Python float in a PyTree recompiles at each new value under `eqx.filter_jit`
    and is skipped by `eqx.filter_grad`, and a NumPy array cannot be indexed by a traced
    number, so every field with a unit goes through here.
    """
    if not jax_is_loaded():
        plain: Any = np.asarray(value)
        return plain if np.issubdtype(plain.dtype, np.floating) else plain.astype(float)
    import jax
    import jax.numpy as jnp

    if isinstance(value, jax.Array) and jnp.issubdtype(value.dtype, jnp.floating):
        # A vehicle has thirty such fields per flight, and `asarray` takes 0.1 ms each.
        return value
    # For NumPy arrays `jnp.asarray` compiles a program per shape; a copy does not.
    array = (jax.device_put if isinstance(value, np.ndarray) else jnp.asarray)(value)
    return array if jnp.issubdtype(array.dtype, jnp.floating) else array.astype(float)


def as_optional_number(value: ArrayLike | None) -> Float[Array, "..."] | None:
    """Convert an optional number; None remains None."""
    return None if value is None else as_numbers(value)


def unconverted(value: R, **changes: Any) -> R:
    """Return a `Module` with other values of some fields, as they are.

    Its numbers remain NumPy arrays also where JAX is loaded.
    """
    copy: R = object.__new__(type(value))
    for name, number in (vars(value) | changes).items():
        object.__setattr__(copy, name, number)
    return copy


def numpy_or_jax(*values: ArrayLike) -> tuple[Float[Array, "..."], ...]:
    """Convert numbers for a function of both kinds: to NumPy, unless one is of JAX."""
    if namespace(*values) is np:
        return tuple(np.asarray(value, float) for value in values)  # type: ignore[return-value]
    return tuple(as_numbers(value) for value in values)


def as_float_arrays(*values: ArrayLike) -> tuple[Float[Array, "..."], ...]:
    """Convert several numbers; used by laws that also accept plain numbers."""
    return tuple(as_numbers(value) for value in values)


def field(
    *,
    converter: Callable[[Any], Any] | None = None,
    static: bool = False,
    bounds: Any = None,
    default: Any = MISSING,
    default_factory: Any = MISSING,
) -> Any:
    """Return a field of a `Module`.

    Args:
        converter: Function that is applied to the value of the constructor.
        static: Whether it is part of the structure of the PyTree, not a leaf.
        bounds: `jblast.parameters.Bounds` of its numbers, which are also finite; None:
            not checked.
        default: Value if none is given.
        default_factory: Function that returns that value.
    """
    return dataclass_field(
        default=default,
        default_factory=default_factory,
        metadata={"static": static, "converter": converter, "bounds": bounds},
    )


def number(*, bounds: Any = None, default: Any = MISSING) -> Any:
    """Return a field of one number: a float array, or None if that is the default."""
    convert = as_optional_number if default is None else as_numbers
    return field(converter=convert, bounds=bounds, default=default)


@dataclass_transform(frozen_default=True, field_specifiers=(field, number))
class Module:
    """Base of values: a subclass is a frozen dataclass, and a PyTree in JAX.

    Fields are leaves or PyTrees, unless they are `field(static=True)`. Numbers that are
    not traced are finite and within the bounds of a field that has any. A method
    `__check_init__` checks more.
    """

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, eq=False)(cls)
        for one in fields(cls):  # type: ignore[arg-type]
            if one.metadata.get("converter"):  # the constructor takes more than arrays
                cls.__init__.__annotations__[one.name] = Any
        _WAITING.add(cls)

    def __post_init__(self) -> None:
        """Convert and check the values."""
        for one in fields(self):  # type: ignore[arg-type]
            if (converter := one.metadata.get("converter")) is not None:
                converted = converter(getattr(self, one.name))
                object.__setattr__(self, one.name, converted)
            value, bounds = getattr(self, one.name), one.metadata.get("bounds")
            if bounds is None or value is None or is_traced(value):
                continue
            values = np.asarray(value)  # operations of JAX inside jit would be traced
            where = f"{type(self).__name__.lower()} {one.name}"
            expected = f"a finite number{bounds.that_is()}"
            fits = np.isfinite(values) & bounds.allows(values)
            require(np.all(fits), where, expected, values.tolist())
        self.__check_init__()

    def __check_init__(self) -> None:
        """Check the values; nothing here."""

    def __eq__(self, other: object) -> bool:
        """Return whether all values are equal, numbers by their arrays."""
        return type(self) is type(other) and all(
            _equal(getattr(self, one.name), getattr(other, one.name))
            for one in fields(self)  # type: ignore[arg-type]
        )

    __hash__ = None  # type: ignore[assignment]  # like an array


def _equal(a: Any, b: Any) -> bool:
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_equal(a[key], b[key]) for key in a)
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(_equal, a, b))
    if hasattr(a, "dtype") and hasattr(b, "dtype"):
        return np.array_equal(np.asarray(a), np.asarray(b), equal_nan=True)
    return a is b or a == b  # NaN, which means "not given", is itself


def _register(cls: type) -> None:
    """Register a dataclass as a PyTree."""
    from jax.tree_util import GetAttrKey, register_pytree_with_keys

    names: dict[bool, list[str]] = {False: [], True: []}
    for one in fields(cls):
        names[one.metadata.get("static", False)].append(one.name)
    leaves, words = names[False], names[True]
    keys = [GetAttrKey(name) for name in leaves]

    def flatten(value: Any) -> tuple[list[Any], tuple[Any, ...]]:
        return (
            [getattr(value, name) for name in leaves],
            tuple(getattr(value, name) for name in words),
        )

    def flatten_with_keys(value: Any) -> tuple[list[Any], tuple[Any, ...]]:
        children, static = flatten(value)
        return list(zip(keys, children, strict=True)), static

    def unflatten(static: tuple[Any, ...], children: Any) -> Any:
        # without conversion and checks: children may be anything that JAX puts there
        value = object.__new__(cls)
        for name, child in zip(leaves + words, (*children, *static), strict=True):
            object.__setattr__(value, name, child)
        return value

    register_pytree_with_keys(cls, flatten_with_keys, unflatten, flatten)


class _Waiting(MetaPathFinder):
    """Registration of classes, at once or when JAX is imported.

    It is the first finder of modules until then.
    """

    def __init__(self) -> None:
        self.waits = "jax" not in sys.modules
        self.classes: list[type] = []
        if self.waits:
            sys.meta_path.insert(0, self)

    def add(self, cls: type) -> None:
        if self.waits:
            self.classes.append(cls)
        else:
            _register(cls)

    def find_spec(self, name: str, path: Any, target: Any = None) -> ModuleSpec | None:
        if name != "jax":
            return None
        sys.meta_path.remove(self)
        spec = find_spec(name)
        if spec is not None and spec.loader is not None:
            execute = spec.loader.exec_module

            def exec_module(module: ModuleType) -> None:
                execute(module)
                self.waits = False
                for cls in self.classes:
                    _register(cls)

            spec.loader.exec_module = exec_module  # a loader belongs to one module
        return spec


_WAITING = _Waiting()


class Described(Module):
    """Base of parts of a scene; keywords are the keys of its table in a scene file."""

    def __new__(cls, *values: Any, **named: Any):
        """Reject unknown keywords, and text in place of a number.

        Raises:
            TypeError: With the class, the attribute and the accepted keywords.
        """
        known = [field.name for field in fields(cls)]
        for keyword in named:
            if keyword not in known:
                raise TypeError(
                    f"{cls.__name__}: no keyword {keyword!r}{nearest(keyword, known)}; "
                    f"expected one of {', '.join(known)}"
                )
        words = {one.name for one in fields(cls) if one.metadata.get("static")}
        for keyword, value in (*zip(known, values, strict=False), *named.items()):
            if isinstance(value, str) and keyword not in words:
                raise TypeError(
                    f"{cls.__name__} {keyword}: expected a number or numbers, got "
                    f"{shown(value)}"
                )
        return super().__new__(cls)
