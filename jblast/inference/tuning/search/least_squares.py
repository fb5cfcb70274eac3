r"""Least squares by Levenberg and Marquardt, of very many residuals and few numbers.

A step solves $(J^T J + \lambda\,\mathrm{diag}\,J^T J)\,p = -J^T r$. Only $J^T J$ and
$J^T r$ are kept, one column of $J$ made after another, so a record's residuals are
held twice and no more. The damping follows the ratio of what a step gained to what
it was to gain (Nielsen 1999, IMM-REP-1999-05, from memory). The search ends where a
full step would go less than `NEAR` standard deviations, $\sqrt{g^T A^{-1} g}$.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

NEAR = 1e-3
"""Standard deviations from the end at which a search stops."""
AT_REST = 0.02
"""Standard deviations: nearer than this, rounding may forbid the rest of the way."""
FIRST, LEAST, MOST = 1e-3, 1e-12, 1e12
"""Damping at first, at least, and where no step is left to try."""


class Slopes(NamedTuple):
    """What residuals say about a place: cost, its gradient, and $J^T J$."""

    cost: Float[Array, ""]
    gradient: Float[Array, " unknown"]
    squares: Float[Array, "unknown unknown"]


class _Search(NamedTuple):
    y: Float[Array, " unknown"]
    here: Slopes
    damping: Float[Array, ""]
    growth: Float[Array, ""]
    steps: Int[Array, ""]
    away: Float[Array, ""]


def least_squares(
    residuals: Callable[[Float[Array, " unknown"]], Any],
    start: Float[Array, " unknown"],
    *,
    most_steps: int,
) -> tuple[Float[Array, " unknown"], Bool[Array, ""]]:
    """Return where the sum of squares is least, and whether the search ended of itself.

    Args:
        residuals: Arrays of any shapes, of the numbers.
        start: Where it begins.
        most_steps: Tried, taken or not.
    """

    def goes_on(search: _Search) -> Bool[Array, ""]:
        able = (search.damping < MOST) & (search.steps < most_steps)
        return able & (search.away > NEAR) & jnp.isfinite(search.here.cost)

    def step(search: _Search) -> _Search:
        y, here, damping, growth, steps, _ = search
        own = jnp.diag(here.squares)
        way = _solved(here.squares + jnp.diag(damping * own), -here.gradient)
        there = 0.5 * _square(residuals(y + way))
        wanted = 0.5 * way @ (damping * own * way - here.gradient)
        ratio = (here.cost - there) / wanted
        taken = jnp.isfinite(there) & (there < here.cost)
        gained = jnp.maximum(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0) ** 3)
        new = jnp.where(taken, y + way, y)
        here = jax.lax.cond(taken, lambda: slopes_at(residuals, new), lambda: here)
        return _Search(
            y=new,
            here=here,
            damping=jnp.maximum(damping * jnp.where(taken, gained, growth), LEAST),
            growth=jnp.where(taken, 2.0, 2.0 * growth),
            steps=steps + 1,
            away=_away(here),
        )

    here = slopes_at(residuals, start)
    one = jnp.ones((), start.dtype)
    begun = _Search(
        start, here, FIRST * one, 2.0 * one, jnp.zeros((), int), _away(here)
    )
    found = jax.lax.while_loop(goes_on, step, begun)
    stuck = (found.damping >= MOST) & (found.away <= AT_REST)
    return found.y, (found.away <= NEAR) | stuck


def slopes_at(
    residuals: Callable[[Float[Array, " unknown"]], Any], y: Float[Array, " unknown"]
) -> Slopes:
    """Return cost, gradient and $J^T J$ of residuals about a place."""
    left = jax.tree.leaves(residuals(y))
    rows = jax.tree.leaves(columns(lambda y: jax.tree.leaves(residuals(y)), y))
    rows = [row.reshape(y.size, -1) for row in rows]
    return Slopes(
        0.5 * _square(left),
        sum((row @ one.ravel() for row, one in zip(rows, left, strict=True)), 0.0 * y),
        sum((row @ row.T for row in rows), jnp.zeros((y.size, y.size), y.dtype)),
    )


def columns(function: Callable[..., Any], y: Float[Array, " unknown"]) -> Any:
    """Return the slopes of a function, one coordinate after another, stacked in front.

    Not by `vmap`: it would hold a record for each at once, and batches of Fourier
    transforms may wait for ever for XLA's pool of threads on the CPU (PyAutoFit issue
    1530: each asks for the whole pool from within it).
    """
    return jax.lax.map(
        lambda way: jax.jvp(function, (y,), (way,))[1], jnp.eye(y.size, dtype=y.dtype)
    )


def _square(residuals: Any) -> Float[Array, ""]:
    return sum(
        (jnp.square(one).sum() for one in jax.tree.leaves(residuals)), jnp.zeros(())
    )


def _away(here: Slopes) -> Float[Array, ""]:
    """Return how far the end is by the slopes here, in standard deviations."""
    way = _solved(here.squares, here.gradient)
    return jnp.sqrt(jnp.maximum(here.gradient @ way, 0.0))


def _solved(
    squares: Float[Array, "unknown unknown"], right: Float[Array, " unknown"]
) -> Float[Array, " unknown"]:
    """Solve, each unknown in the unit of its own information."""
    own = jnp.diag(squares)
    unit = jnp.sqrt(jnp.where(own > 0, own, 1.0))
    scaled = squares / unit[:, None] / unit[None, :]
    floor = 1e-14 * jnp.eye(right.size, dtype=right.dtype)
    return jnp.linalg.solve(scaled + floor, right / unit) / unit
