"""Numbers of a vehicle's table, each checked and named in what is wrong with it."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jblast.errors import InputError, shown
from jblast.types import as_float_array


def number(
    parameters: Mapping[str, Any],
    key: str,
    *,
    least: float | None = None,
    positive: bool = False,
    default: float | None = None,
) -> Float[Array, ""]:
    """Return one number of a table.

    Args:
        parameters: The table.
        key: The number's name.
        least: What it must reach.
        positive: Whether it must exceed that.
        default: What stands for it where it is left out; None if it must be there.

    Raises:
        InputError: It is missing, no number, not finite or too small.
    """
    if key not in parameters and default is None:
        raise InputError(f"vehicle parameter {key}: missing")
    value = numbers(parameters.get(key, default), key, (), least=least)
    if positive and not isinstance(value, Tracer) and not value > 0:
        raise InputError(
            f"vehicle parameter {key}: expected a positive number, got {float(value):g}"
        )
    return value


def numbers(
    value: Any, key: str, shape: tuple[int, ...], *, least: float | None = None
) -> Float[Array, "..."]:
    """Return numbers of a shape.

    Args:
        value: What came.
        key: Their name.
        shape: What they must have.
        least: What each must reach.

    Raises:
        InputError: They are no numbers, not finite, too small, or of another shape.
    """
    what = " x ".join(map(str, shape)) + " numbers" if shape else "a number"
    if not isinstance(value, jax.Array):
        try:
            value = np.asarray([] if value is None else value, dtype=float)
        except (TypeError, ValueError):
            raise InputError(
                f"vehicle parameter {key}: expected {what}, got {shown(value)}"
            ) from None
    array = as_float_array(value)
    if array.shape != shape:
        raise InputError(
            f"vehicle parameter {key}: expected {what}, got the shape {array.shape}"
        )
    if isinstance(array, Tracer):
        return array
    if not bool(jnp.all(jnp.isfinite(array))):
        raise InputError(f"vehicle parameter {key}: expected {what}, got {array}")
    if least is not None and not bool(jnp.all(array >= least)):
        raise InputError(
            f"vehicle parameter {key}: expected {what} of at least {least:g}, "
            f"got {array}"
        )
    return array


def floats(value: Any) -> Float[Array, "..."]:
    """Convert numbers, lists of them too, to a float array."""
    return as_float_array(value if isinstance(value, Array) else jnp.asarray(value))


def in_precision(tree: Any, dtype: np.dtype) -> Any:
    """Bring every array of floats to one precision, and none of them weakly typed.

    So that numbers of any origin fly by the same compiled program.
    """

    def brought(x: Any) -> Any:
        is_weak = getattr(x, "weak_type", False)  # NumPy's arrays never are
        if not eqx.is_inexact_array(x) or (x.dtype == dtype and not is_weak):
            return x
        return x.astype(dtype)

    return jax.tree.map(brought, tree)
