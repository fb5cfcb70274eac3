"""Shared converters to float arrays, and a base of modules that check keywords."""

from dataclasses import fields
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jblast.errors import nearest, shown


def as_float_array(value: ArrayLike) -> Float[Array, "..."]:
    """Convert a number to a float array of JAX's default precision.

    A bare Python float in a PyTree recompiles at each new value under `eqx.filter_jit`
    and is skipped by `eqx.filter_grad`, so every field with a unit goes through here.
    """
    if isinstance(value, jax.Array) and jnp.issubdtype(value.dtype, jnp.floating):
        # A vehicle has thirty such fields per flight, and `asarray` takes 0.1 ms each.
        return value
    # For NumPy arrays `jnp.asarray` compiles a program per shape; a copy does not.
    put = jax.device_put if isinstance(value, np.ndarray) else jnp.asarray
    array = put(value)
    return array if jnp.issubdtype(array.dtype, jnp.floating) else array.astype(float)


def as_optional_float_array(value: ArrayLike | None) -> Float[Array, "..."] | None:
    """Convert an optional number; None remains None."""
    return None if value is None else as_float_array(value)


def as_float_arrays(*values: ArrayLike) -> tuple[Float[Array, "..."], ...]:
    """Convert several numbers; used by laws that also accept plain numbers."""
    return tuple(as_float_array(value) for value in values)


class Described(eqx.Module):
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
