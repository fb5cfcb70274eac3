r"""Normal equations of few unknowns, written out: every number is an array over lanes.

A lane is one problem among many. $H = J^T W J$ is kept as the rows of its lower
triangle, each entry an array over lanes, so that elimination is a few dozen products
of such arrays, and no small matrix is ever put together.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

MOST_UNKNOWNS = 16
"""More are not written out: the program grows with their cube."""

Lanes = Float[Array, "..."]
Triangle = tuple[tuple[Lanes, ...], ...]


class Factor(NamedTuple):
    """A Cholesky factor.

    Attributes:
        rows: Its lower triangle, below the diagonal.
        inverse: One over its diagonal; 0 where the matrix is singular, which leaves
            that unknown where it is.
        positive: Whether the matrix is positive definite beyond rounding.
    """

    rows: Triangle
    inverse: tuple[Lanes, ...]
    positive: Bool[Array, "..."]


def cholesky(matrix: Triangle, damping: Lanes | float = 0.0) -> Factor:
    r"""Factor $H + \lambda\,\mathrm{diag}(H)$.

    Args:
        matrix: Lower triangle of $H$.
        damping: $\lambda$.
    """
    rows: list[tuple[Lanes, ...]] = []
    inverse: list[Lanes] = []
    positive = jnp.ones_like(matrix[0][0], dtype=bool)
    for k, row in enumerate(matrix):
        out: list[Lanes] = []
        for j in range(k):
            rest = row[j]
            for i in range(j):
                rest = rest - out[i] * rows[j][i]
            out.append(rest * inverse[j])
        pivot = row[k] + damping * row[k]
        # what is left of a pivot by rounding alone is zero
        least = 8 * (k + 1) * jnp.finfo(pivot.dtype).eps * pivot
        for entry in out:
            pivot = pivot - entry * entry
        good = pivot > least
        positive = positive & good
        inverse.append(jnp.where(good, 1 / jnp.sqrt(jnp.where(good, pivot, 1.0)), 0.0))
        rows.append(tuple(out))
    return Factor(tuple(rows), tuple(inverse), positive)


def forward(factor: Factor, right: tuple[Lanes, ...]) -> tuple[Lanes, ...]:
    """Solve with the factor itself: of a gradient, its whitened form."""
    out: list[Lanes] = []
    for row, inverse, rest in zip(factor.rows, factor.inverse, right, strict=True):
        for entry, known in zip(row, out, strict=True):
            rest = rest - entry * known
        out.append(rest * inverse)
    return tuple(out)


def backward(factor: Factor, right: tuple[Lanes, ...]) -> tuple[Lanes, ...]:
    """Solve with the transposed factor."""
    out = list(right)
    for k in reversed(range(len(right))):
        out[k] = out[k] * factor.inverse[k]
        for j in range(k):
            out[j] = out[j] - factor.rows[k][j] * out[k]
    return tuple(out)


def squared(vector: tuple[Lanes, ...]) -> Lanes:
    """Return the sum of squares."""
    total = vector[0] * vector[0]
    for entry in vector[1:]:
        total = total + entry * entry
    return total


def inverse_of(factor: Factor) -> tuple[tuple[Lanes, ...], ...]:
    """Return the columns of the inverse matrix."""
    n, one = len(factor.inverse), jnp.ones_like(factor.inverse[0])
    units = [tuple(one if i == k else 0 * one for i in range(n)) for k in range(n)]
    return tuple(backward(factor, forward(factor, unit)) for unit in units)
