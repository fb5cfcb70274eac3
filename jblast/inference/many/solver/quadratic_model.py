"""The cost of lanes about a place, to second order."""

from collections.abc import Callable, Sequence

import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Float

from jblast.inference.many.solver.normal_equations import Lanes, Triangle

Loss = Callable[[Array], tuple[Array, Array, Array]]


def half_square(residual: Float[Array, "..."]) -> tuple[Array, Array, Array]:
    """Return the cost of normal errors, its slope and its curvature."""
    return 0.5 * residual * residual, residual, jnp.ones_like(residual)


class Expansion(optx.FunctionInfo):
    """The cost about a place, to second order.

    Attributes:
        f: The cost.
        grad: Its gradient.
        hessian: Lower triangle of its curvature (Gauss-Newton's).
        floor: What rounding adds to the length of the vector of residuals.
    """

    f: Lanes
    grad: tuple[Lanes, ...]
    hessian: Triangle
    floor: Lanes

    def as_min(self) -> Lanes:
        """Return the cost."""
        return self.f

    def slack(self) -> Lanes:
        """Return what rounding does to the cost."""
        cost = jnp.abs(self.f)
        rounded = 8 * jnp.finfo(cost.dtype).eps * cost
        return self.floor * (jnp.sqrt(2 * cost) + self.floor) + rounded


def expansion(
    loss: Loss,
    y: Float[Array, "unknown ..."],
    residual: Float[Array, "term ..."],
    columns: Sequence[Float[Array, "..."]],
    floor: Lanes | float = 0.0,
) -> Expansion:
    """Return the cost about a place, of residuals and their slopes.

    Args:
        loss: Cost, slope and curvature of each residual.
        y: The place.
        residual: The residuals there.
        columns: Their derivative to each unknown.
        floor: What rounding adds to the length of the vector of residuals.
    """
    value, slope, curvature = loss(residual)
    cost = jnp.sum(value, axis=0)
    grad = tuple(jnp.sum(column * slope, axis=0) for column in columns)
    hessian = triangle(columns, None if loss is half_square else curvature)
    eps = jnp.finfo(residual.dtype).eps
    # the last digit of an unknown moves residuals, too
    moved = [
        jnp.sqrt(jnp.maximum(row[-1], 0.0)) * jnp.abs(x)
        for row, x in zip(hessian, y, strict=True)
    ]
    rounded = floor + eps * sum(moved[1:], start=moved[0])
    return Expansion(cost, grad, hessian, rounded)


def triangle(columns, weight=None) -> Triangle:
    r"""Return the lower triangle of $J^T W J$.

    Args:
        columns: Those of $J$.
        weight: Diagonal of $W$; without it 1.
    """
    rows = []
    for k, column in enumerate(columns):
        weighted = column if weight is None else column * weight
        rows.append(tuple(jnp.sum(c * weighted, axis=0) for c in columns[: k + 1]))
    return tuple(rows)
