"""The sum of a Chebyshev series: how an integral, tabulated once, is read."""

from collections.abc import Sequence

import jax.numpy as jnp
from jaxtyping import Array, Float


def chebyshev_sum(
    coefficients: Sequence[float], x: Float[Array, "..."], start: float, end: float
) -> Float[Array, "..."]:
    """Sum a Chebyshev series on [start, end] by Clenshaw's recurrence."""
    t = (2.0 * x - (start + end)) / (end - start)
    last, previous = jnp.zeros_like(t), jnp.zeros_like(t)
    for coefficient in reversed(coefficients[1:]):
        last, previous = 2.0 * t * last - previous + coefficient, last
    return t * last - previous + coefficients[0]
