r"""Levenberg-Marquardt for many small problems at once, as an optimistix solver.

The unknowns $y$ have a first axis of unknowns; any further axes are lanes, each lane a
problem of its own: its residuals, a first axis of rows and the same lanes, depend on
its own unknowns alone. So `optimistix.least_squares` solves one problem with $y$ of
shape (free,), under `vmap` or not, and a batch in one loop with $y$ of shape
(free, lane), which is the fast way: the lane is the last axis of every array.

The step is $-(H + \lambda\,\mathrm{diag}\,H)^{-1} g$ (Marquardt), by a Cholesky factor
written out. $1/\lambda$ is optimistix' step size. At the optimum a cost falls by less
than its rounding, and a trust region that wants to see it fall rejects step after step
(which held the slowest lane, and so the whole batch): ours accepts there.
"""

from collections.abc import Callable
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int, ScalarLike

from jblast.inference.many.normal_equations import (
    Lanes,
    Triangle,
    backward,
    cholesky,
    forward,
    squared,
)

TOLERANCE = 1e-8
"""Converged: the whitened gradient, in standard deviations, is no longer than this, or
than rounding leaves it."""
COARSEST = 0.1
"""Where rounding leaves more than this, nothing counts as converged [sd]."""
FIRST_STEP_SIZE = 100.0

Loss = Callable[[Array], tuple[Array, Array, Array]]


def half_square(residual: Float[Array, "..."]) -> tuple[Array, Array, Array]:
    """Return the cost of normal errors, its slope and its curvature."""
    return 0.5 * residual * residual, residual, jnp.ones_like(residual)


class Normal(optx.FunctionInfo):
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


class MarquardtDescent(optx.AbstractDescent):
    """The damped Newton step; its state is the cost about the last place accepted."""

    def init(self, y, f_info_struct):
        """Return a state of the right shape."""
        del y
        return f_info_struct

    def query(self, y, f_info, state):
        """Remember where we are."""
        del y, state
        return f_info

    def step(self, step_size, state):
        """Return the step."""
        factor = cholesky(state.hessian, 1 / step_size)
        step = backward(factor, forward(factor, state.grad))
        return -jnp.stack(step), optx.RESULTS.successful


class FloorTrustRegion(optx.ClassicalTrustRegion):
    """A classical trust region that accepts what rounding alone seems to reject."""

    high_constant: ScalarLike = 100.0
    low_constant: ScalarLike = 0.1
    high_cutoff: ScalarLike = 0.5

    def init(self, y, f_info_struct):
        """Start nearly undamped in every lane."""
        state = super().init(y, f_info_struct)
        size = jnp.full(y.shape[1:], FIRST_STEP_SIZE, y.dtype)
        return eqx.tree_at(lambda s: s.step_size, state, size)

    def predict_reduction(self, y_diff, f_info: Any):
        """Return by how much the cost would change if it were quadratic."""
        slope = [g * d for g, d in zip(f_info.grad, y_diff, strict=True)]
        bend = [
            (0.5 if i == j else 1.0) * h * y_diff[i] * y_diff[j]
            for i, row in enumerate(f_info.hessian)
            for j, h in enumerate(row)
        ]
        return sum(slope[1:] + bend, start=slope[0])

    def step(self, first_step, y, y_eval, f_info: Any, f_eval_info: Any, state):
        """Compare promise with outcome; as optimistix does, but for the floor."""
        promised = self.predict_reduction(y_eval - y, f_info)
        change = f_eval_info.as_min() - f_info.as_min()
        slack = f_info.slack() + f_eval_info.slack()
        # a cost that is not finite compares as False, and so is rejected
        accept = (change <= self.low_cutoff * promised + slack) | first_step
        good = change <= self.high_cutoff * promised + slack
        grow = jnp.where(good & ~first_step, self.high_constant, 1.0)
        size = state.step_size * jnp.where(accept, grow, self.low_constant)
        state = eqx.tree_at(lambda s: s.step_size, state, size)
        return size, accept, optx.RESULTS.successful, state


class State(eqx.Module):
    """What the solver carries.

    Attributes:
        first_step: Whether nothing has been computed yet.
        y_eval: The place to try next.
        info: The cost about the place accepted last.
        search: State of the trust region.
        done: Whether a lane has ended.
        steps: How many places a lane has tried.
    """

    first_step: Bool[Array, ""]
    y_eval: Float[Array, "free ..."]
    info: Normal
    search: Any
    done: Bool[Array, "..."]
    steps: Int[Array, "..."]


class LaneLevenbergMarquardt(optx.AbstractLeastSquaresSolver):
    """Levenberg-Marquardt over lanes; see the top of this file.

    `options` may hold, for each lane, `floor`: what rounding adds to the length of the
    vector of residuals, without it 0; and `skip`: whether to leave it where it is. And
    `stragglers`: the share of lanes not to wait for. Which lanes have ended is in the
    state; whether at an optimum, says `at_optimum`.

    Attributes:
        tolerance: Ends where the whitened gradient is this short, or at the floor.
        loss: Cost, slope and curvature (positive) of each residual; half of the square.
        jacobian: "fwd", or "aux" where the function returns it as its aux: one array
            of the shape of the residuals (or one that broadcasts to it) per unknown.
    """

    tolerance: float = TOLERANCE
    loss: Loss = eqx.field(static=True, default=half_square)
    jacobian: Literal["fwd", "aux"] = eqx.field(static=True, default="fwd")
    descent: MarquardtDescent = eqx.field(default_factory=MarquardtDescent)
    search: FloorTrustRegion = eqx.field(default_factory=FloorTrustRegion)
    rtol: float = TOLERANCE
    atol: float = TOLERANCE
    norm: Callable = eqx.field(static=True, default=optx.max_norm)

    def evaluate(self, fn, y, args, options) -> tuple[Normal, Any]:
        """Return the cost about a place, and the function's aux."""
        if self.jacobian == "aux":
            residual, aux = fn(y, args)
            columns = aux
        else:
            residual, push, aux = jax.linearize(lambda y: fn(y, args), y, has_aux=True)
            units = [jnp.zeros_like(y).at[k].set(1.0) for k in range(y.shape[0])]
            columns = [push(unit) for unit in units]
        return self.normal(y, residual, columns, options), aux

    def normal(self, y, residual, columns, options) -> Normal:
        """Return the cost about a place, of residuals and their slopes."""
        value, slope, curvature = self.loss(residual)
        cost = jnp.sum(value, axis=0)
        grad = tuple(jnp.sum(column * slope, axis=0) for column in columns)
        hessian = triangle(columns, None if self.loss is half_square else curvature)
        eps = jnp.finfo(residual.dtype).eps
        # the last digit of an unknown moves residuals, too
        moved = [
            jnp.sqrt(jnp.maximum(row[-1], 0.0)) * jnp.abs(x)
            for row, x in zip(hessian, y, strict=True)
        ]
        floor = options.get("floor", 0.0) + eps * sum(moved[1:], start=moved[0])
        return Normal(cost, grad, hessian, floor)

    def init(self, fn, y, args, options, f_struct, aux_struct, tags):
        """Return the state before the first step."""
        del f_struct, aux_struct, tags
        shape = jax.eval_shape(lambda y: self.evaluate(fn, y, args, options)[0], y)
        info = jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), shape)
        lanes = y.shape[1:]
        return State(
            first_step=jnp.array(True),
            y_eval=y,
            info=info,
            search=self.search.init(y, info),
            done=jnp.broadcast_to(options.get("skip", jnp.array(False)), lanes),
            steps=jnp.zeros(lanes, jnp.int32),
        )

    def step(self, fn, y, args, options, state, tags):
        """Try one place in every lane that has not ended."""
        del tags
        tried, aux = self.evaluate(fn, state.y_eval, args, options)
        size, accept, _, search = self.search.step(
            state.first_step, y, state.y_eval, state.info, tried, state.search
        )
        lost = state.first_step & ~jnp.isfinite(tried.f)
        accept = accept & ~state.done
        y = jnp.where(accept, state.y_eval, y)
        info = jax.tree.map(
            lambda new, old: jnp.where(accept, new, old), tried, state.info
        )
        size = jnp.where(state.done, state.search.step_size, size)
        diff, _ = self.descent.step(size, self.descent.query(y, info, None))
        # of the undamped step: a damped one is short wherever it leads
        length = squared(forward(cholesky(info.hessian), info.grad))
        ended = lost | ~(length > self.square_tolerance(info))
        state = State(
            first_step=jnp.array(False),
            y_eval=jnp.where(jnp.isfinite(diff), y + diff, y),
            info=info,
            search=eqx.tree_at(lambda s: s.step_size, search, size),
            done=state.done | ended,
            steps=state.steps + jnp.where(state.done, 0, 1),
        )
        return y, state, aux

    def square_tolerance(self, info: Normal) -> Lanes:
        """Return the square of how long a whitened gradient may be at an optimum."""
        return jnp.maximum(self.tolerance, 4 * info.floor) ** 2

    def at_optimum(self, info: Normal) -> Bool[Array, "..."]:
        """Return which lanes are at an optimum, as far as rounding lets one see."""
        factor = cholesky(info.hessian)
        least = self.square_tolerance(info)
        length = squared(forward(factor, info.grad))
        near = (length <= least) & (least <= COARSEST**2)
        return jnp.isfinite(info.f) & factor.positive & near

    def terminate(self, fn, y, args, options, state, tags):
        """Return whether enough lanes have ended."""
        del fn, args, tags
        left = jnp.mean(~state.done, dtype=y.dtype)
        return left <= options.get("stragglers", 0.0), optx.RESULTS.successful

    def postprocess(self, fn, y, aux, args, options, state, tags, result):
        """Change nothing: which lanes converged is in the state."""
        del fn, args, options, state, tags, result
        return y, aux, {}


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
