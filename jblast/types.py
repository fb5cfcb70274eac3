"""Array types shared by the whole package."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float


def as_float_array(value: ArrayLike) -> Float[Array, "..."]:
    """Convert a number to a float array of JAX's default precision.

    A bare Python float in a PyTree recompiles at each new value under `eqx.filter_jit`
    and is skipped by `eqx.filter_grad`, so every field with a unit goes through here.
    """
    if isinstance(value, jax.Array) and jnp.issubdtype(value.dtype, jnp.floating):
        return value  # thirty of a vehicle, each flight: `asarray` of one takes 0.1 ms
    # of NumPy's `asarray` compiles a program for each shape, where a copy will do
    put = jax.device_put if isinstance(value, np.ndarray) else jnp.asarray
    array = put(value)
    return array if jnp.issubdtype(array.dtype, jnp.floating) else array.astype(float)


def as_optional_float_array(value: ArrayLike | None) -> Float[Array, "..."] | None:
    """Convert a number that may be left out: None stays None."""
    return None if value is None else as_float_array(value)


def as_float_arrays(*values: ArrayLike) -> tuple[Float[Array, "..."], ...]:
    """Convert several numbers: the first line of a law that takes plain numbers too."""
    return tuple(as_float_array(value) for value in values)
