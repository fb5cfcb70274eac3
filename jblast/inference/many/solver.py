r"""Levenberg-Marquardt for many small problems together.

The unknowns $y$ have a first axis of unknowns. Any further axes are lanes, each lane a
problem of its own: its residuals, a first axis of rows and the same lanes, depend on
its own unknowns alone.

$H = J^T W J$ is stored as the rows of its lower triangle, each entry an array over
lanes. The Cholesky factorisation of few unknowns is a few dozen products of such
arrays, and no small matrix is ever assembled: 21 times as many fits per second of
processor time as `optimistix.LevenbergMarquardt` under `vmap` (12 arrivals, 4
unknowns). The step is $-(H + \lambda\,\mathrm{diag}\,H)^{-1} g$ (Marquardt). $\lambda$
follows the ratio of the actual to the predicted fall of the cost (Nielsen 1999, report
IMM-REP-1999-05, Technical University of Denmark, eq. 2.4). It settles where the step is
that of Newton, also where Gauss-Newton omits most of the curvature: across a line of
sensors, where readings depend on the square of an offset.

At the optimum the cost falls by less than its rounding. A search that requires it to
fall rejects step after step there, which delays the slowest lane and so the whole
batch: this one accepts.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

TOLERANCE = 1e-8
"""Largest whitened gradient of an optimum, in standard deviations; or four times the
rounding error, if that is larger."""
COARSEST = 0.1
"""Largest such tolerance of a converged lane [sd]: with more rounding the optimum is
not resolved within its error."""
MAX_UNKNOWNS = 16
"""Largest number of unknowns: the written-out program grows with its cube."""
FIRST_DAMPING = 0.01
r"""First $\lambda$: nearly undamped, since most lanes start in the basin of their
optimum."""
LEAST_FALL = 0.01
"""Smallest ratio of the actual to the predicted fall of an accepted step."""
LESS, MORE = 0.01, 4.0
r"""Factors of $\lambda$ after a step as predicted, and after a rejected one."""
Lanes = Float[Array, "..."]
Triangle = tuple[tuple[Lanes, ...], ...]
Loss = Callable[[Array], tuple[Array, Array, Array | None, Array | None]]
"""Cost, slope, curvature and weight of each residual; None for a curvature of 1, and
for a weight that is the curvature."""


class Expansion(NamedTuple):
    """The cost about a place, to second order.

    Attributes:
        f: Cost.
        grad: Gradient.
        hessian: Lower triangle of the Gauss-Newton curvature.
        floor: Rounding error of the length of the vector of residuals.
        convex: True where the curvature is that of the cost, False where that is not
            positive, and the curvature that of reweighted residuals.
    """

    f: Lanes
    grad: tuple[Lanes, ...]
    hessian: Triangle
    floor: Lanes
    convex: Bool[Array, "..."]

    def slack(self) -> Lanes:
        """Return the rounding error of the cost."""
        # cost = |r|^2 / 2, so an error e of |r| changes it by e (|r| + e)
        cost = jnp.abs(self.f)
        rounded = 8 * jnp.finfo(cost.dtype).eps * cost
        return self.floor * (jnp.sqrt(2 * cost) + self.floor) + rounded

    def change(self, step: Float[Array, "unknown ..."]) -> Lanes:
        """Return the change of the cost by a step in this expansion."""
        total = jnp.zeros_like(self.f)
        for i, row in enumerate(self.hessian):
            total = total + self.grad[i] * step[i]
            for j, h in enumerate(row):
                total = total + (0.5 if i == j else 1.0) * h * step[i] * step[j]
        return total

    def square_tolerance(self) -> Lanes:
        """Return the square of the largest whitened gradient at an optimum."""
        return jnp.maximum(TOLERANCE, 4 * self.floor) ** 2

    def square_gradient(self) -> Lanes:
        """Return the square of the whitened gradient, the length of a Newton step."""
        return squared(forward(cholesky(self.hessian), self.grad))

    def at_optimum(self) -> Bool[Array, "..."]:
        """Return True for lanes at an optimum, within rounding."""
        least = self.square_tolerance()
        near = (self.square_gradient() <= least) & (least <= COARSEST**2)
        sure = self.convex & cholesky(self.hessian).positive
        return jnp.isfinite(self.f) & sure & near


class Search(NamedTuple):
    r"""State of a search.

    Attributes:
        y: Last accepted place.
        here: Expansion about it.
        tried: Next place to try.
        damping: $\lambda$.
        done: True for lanes that have ended.
        steps: Number of places tried by each lane.
    """

    y: Float[Array, "unknown ..."]
    here: Expansion
    tried: Float[Array, "unknown ..."]
    damping: Lanes
    done: Bool[Array, "..."]
    steps: Int[Array, "..."]


def levenberg_marquardt(
    expand: Callable[[Float[Array, "unknown ..."]], Expansion],
    y: Float[Array, "unknown ..."],
    *,
    skip: Bool[Array, "..."] | bool = False,
    stragglers: Float[Array, ""] | float = 0.0,
    max_steps: int,
) -> Search:
    """Minimise the cost of every lane; `Expansion.at_optimum` returns convergence.

    Args:
        expand: Function that returns the expansion about a place.
        y: Starts.
        skip: True for lanes that are not moved.
        stragglers: Share of lanes for which the loop does not wait.
        max_steps: Largest number of places tried.
    """
    lanes = y.shape[1:]
    empty = jax.tree.map(
        lambda s: jnp.zeros(s.shape, s.dtype), jax.eval_shape(expand, y)
    )
    damping = jnp.full(lanes, FIRST_DAMPING, y.dtype)
    steps = jnp.zeros(lanes, jnp.int32)
    first = Search(y, empty, y, damping, jnp.broadcast_to(skip, lanes), steps)

    def goes_on(state: tuple[Int[Array, ""], Search]):
        count, search = state
        left = jnp.mean(~search.done, dtype=y.dtype)
        return (count < max_steps) & (left > stragglers)

    def step(state: tuple[Int[Array, ""], Search]):
        return state[0] + 1, _step(expand, state[1])

    return jax.lax.while_loop(goes_on, step, (jnp.zeros((), jnp.int32), first))[1]


def _step(expand: Callable[..., Expansion], old: Search) -> Search:
    """Try one place in every lane that has not ended."""
    there, is_first = expand(old.tried), old.steps == 0
    promised = old.here.change(old.tried - old.y)
    change, slack = there.f - old.here.f, there.slack() + old.here.slack()
    # NaN compares as False, so a cost that is not finite is rejected
    accept = is_first | (change <= LEAST_FALL * promised + slack)
    accept = accept & ~old.done
    # within rounding the share is 1/2, which leaves lambda as it is
    share = jnp.clip((0.5 * slack - change) / (slack - promised), 0.0, 1.0)
    factor = jnp.where(accept, jnp.maximum(LESS, 1 - (2 * share - 1) ** 3), MORE)
    damping = old.damping * jnp.where(is_first | old.done, 1.0, factor)

    def chosen(new, old):
        return jnp.where(accept, new, old)

    y, here = chosen(old.tried, old.y), jax.tree.map(chosen, there, old.here)
    factored = cholesky(here.hessian, damping)
    move = -jnp.stack(backward(factored, forward(factored, here.grad)))
    # the length of the undamped step: a damped one is short even far from the optimum
    ended = ~(here.square_gradient() > here.square_tolerance())
    lost = is_first & ~jnp.isfinite(there.f)
    return Search(
        y=y,
        here=here,
        tried=jnp.where(jnp.isfinite(move), y + move, y),
        damping=damping,
        done=old.done | ended | lost,
        steps=old.steps + jnp.where(old.done, 0, 1),
    )


def expansion(
    loss: Loss,
    y: Float[Array, "unknown ..."],
    residual: Float[Array, "term ..."],
    columns: Sequence[Float[Array, "..."]],
    floor: Lanes | float = 0.0,
) -> Expansion:
    """Return the expansion of the cost from residuals and their derivatives.

    Args:
        loss: Cost, slope and curvature of each residual.
        y: The place.
        residual: Residuals at the place.
        columns: Derivative of the residuals by each unknown.
        floor: Rounding error of the length of the vector of residuals.
    """
    value, slope, curvature, weight = loss(residual)
    cost = jnp.sum(value, axis=0)
    grad = tuple(jnp.sum(column * slope, axis=0) for column in columns)
    hessian = triangle(columns, curvature)
    convex = jnp.ones_like(cost, dtype=bool)
    if weight is not None:
        convex = cholesky(hessian).positive
        hessian = jax.tree.map(
            lambda true, safe: jnp.where(convex, true, safe),
            hessian,
            triangle(columns, weight),
        )
    eps = jnp.finfo(residual.dtype).eps
    # rounding of the unknowns changes the residuals as well
    moved = [
        jnp.sqrt(jnp.maximum(row[-1], 0.0)) * jnp.abs(x)
        for row, x in zip(hessian, y, strict=True)
    ]
    rounded = floor + eps * sum(moved[1:], start=moved[0])
    return Expansion(cost, grad, hessian, rounded, convex)


def triangle(columns, weight=None) -> Triangle:
    r"""Return the lower triangle of $J^T W J$.

    Args:
        columns: Columns of $J$.
        weight: Diagonal of $W$; default 1.
    """
    rows = []
    for k, column in enumerate(columns):
        weighted = column if weight is None else column * weight
        rows.append(tuple(jnp.sum(c * weighted, axis=0) for c in columns[: k + 1]))
    return tuple(rows)


class Factor(NamedTuple):
    """A Cholesky factor.

    Attributes:
        rows: Its lower triangle, below the diagonal.
        inverse: One over its diagonal; 0 where the matrix is singular, so that the
            unknown does not move.
        positive: True if the matrix is positive definite beyond rounding.
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
        # a pivot within rounding of zero counts as zero
        least = 8 * (k + 1) * jnp.finfo(pivot.dtype).eps * jnp.abs(pivot)
        for entry in out:
            pivot = pivot - entry * entry
        good = pivot > least
        positive = positive & good
        inverse.append(jnp.where(good, 1 / jnp.sqrt(jnp.where(good, pivot, 1.0)), 0.0))
        rows.append(tuple(out))
    return Factor(tuple(rows), tuple(inverse), positive)


def forward(factor: Factor, right: tuple[Lanes, ...]) -> tuple[Lanes, ...]:
    """Solve with the factor: of a gradient it gives the whitened gradient."""
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
