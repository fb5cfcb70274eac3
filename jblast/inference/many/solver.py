r"""Levenberg-Marquardt for many small problems together, as an optimistix solver.

The unknowns $y$ have a first axis of unknowns. Any further axes are lanes, each lane a
problem of its own: its residuals, a first axis of rows and the same lanes, depend on
its own unknowns alone. So `optimistix.least_squares` solves one problem with $y$ of
shape (free,), under `vmap` or not, and a batch in one loop with $y$ of shape
(free, lane). The latter is faster: the lane is the last axis of every array.

$H = J^T W J$ is stored as the rows of its lower triangle, each entry an array over
lanes. The Cholesky factorisation of few unknowns is a few dozen products of such
arrays, and no small matrix is ever assembled. The step is
$-(H + \lambda\,\mathrm{diag}\,H)^{-1} g$ (Marquardt), and $1/\lambda$ is the step size
of optimistix. At the optimum the cost falls by less than its rounding, and a trust
region that requires it to fall rejects step after step, which delayed the slowest lane
and so the whole batch: this one accepts there.

Gauss-Newton omits $\sum_i r_i \nabla^2 r_i$. Where that is more than twice what it
keeps (across a line of sensors, where readings depend on the square of an offset, and
only the prior curves the approximated cost), its steps end as far on the other side or
farther. Such lanes, which are few, are continued by Newton's method with the whole
curvature, which takes one pass per unknown.
"""

from collections.abc import Callable, Sequence
from typing import Any, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int, ScalarLike

TOLERANCE = 1e-8
"""Largest whitened gradient of an optimum, in standard deviations; or four times the
rounding error, if that is larger."""
COARSEST = 0.1
"""Largest such tolerance of a converged lane [sd]: with more rounding the optimum is
not resolved within its error."""
Loss = Callable[[Array], tuple[Array, Array, Array]]
# 1 / lambda: nearly undamped, since most lanes start in the basin of their optimum
FIRST_STEP_SIZE = 100.0
# of Newton's method, a fixed number for all lanes: it doubles the digits in each
STEPS = 24
SHARES = (1.0, 0.25, 0.0625, 0.015625)
"""Trial lengths of a Newton step. The lowest cost is used; if none is lower the step is
rejected."""
FLATTEST = 1e-9
"""Smallest curvature relative to the largest: along a flat direction the step is
finite."""
Cost = Callable[
    [Float[Array, "unknown lane"]],
    tuple[Float[Array, " lane"], Float[Array, "unknown lane"]],
]
"""Function that returns cost and gradient of each lane."""
MAX_UNKNOWNS = 16
"""Largest number of unknowns: the written-out program grows with its cube."""
Lanes = Float[Array, "..."]
Triangle = tuple[tuple[Lanes, ...], ...]


class Expansion(optx.FunctionInfo):
    """The cost about a place, to second order.

    Attributes:
        f: Cost.
        grad: Gradient.
        hessian: Lower triangle of the Gauss-Newton curvature.
        floor: Rounding error of the length of the vector of residuals.
    """

    f: Lanes
    grad: tuple[Lanes, ...]
    hessian: Triangle
    floor: Lanes

    def as_min(self) -> Lanes:
        """Return the cost."""
        return self.f

    def slack(self) -> Lanes:
        """Return the rounding error of the cost."""
        # cost = |r|^2 / 2, so an error e of |r| changes it by e (|r| + e)
        cost = jnp.abs(self.f)
        rounded = 8 * jnp.finfo(cost.dtype).eps * cost
        return self.floor * (jnp.sqrt(2 * cost) + self.floor) + rounded


class SolverState(eqx.Module):
    """State of the solver.

    Attributes:
        first_step: True before the first evaluation.
        y_eval: Next place to try.
        info: Expansion about the last accepted place.
        search: State of the trust region.
        done: True for lanes that have ended.
        steps: Number of places tried by each lane.
    """

    first_step: Bool[Array, ""]
    y_eval: Float[Array, "free ..."]
    info: Expansion
    search: Any
    done: Bool[Array, "..."]
    steps: Int[Array, "..."]


class FloorTrustRegion(optx.ClassicalTrustRegion):
    """A classical trust region that ignores increases within rounding."""

    high_constant: ScalarLike = 100.0
    low_constant: ScalarLike = 0.1
    high_cutoff: ScalarLike = 0.5

    def init(self, y, f_info_struct):
        """Start nearly undamped in every lane."""
        state = super().init(y, f_info_struct)
        size = jnp.full(y.shape[1:], FIRST_STEP_SIZE, y.dtype)
        return eqx.tree_at(lambda s: s.step_size, state, size)

    def predict_reduction(self, y_diff, f_info: Any):
        """Return the change of the cost in the quadratic model."""
        slope = [g * d for g, d in zip(f_info.grad, y_diff, strict=True)]
        bend = [
            (0.5 if i == j else 1.0) * h * y_diff[i] * y_diff[j]
            for i, row in enumerate(f_info.hessian)
            for j, h in enumerate(row)
        ]
        return sum(slope[1:] + bend, start=slope[0])

    def step(self, first_step, y, y_eval, f_info: Any, f_eval_info: Any, state):
        """Compare predicted and actual change as optimistix does, less rounding."""
        promised = self.predict_reduction(y_eval - y, f_info)
        change = f_eval_info.as_min() - f_info.as_min()
        slack = f_info.slack() + f_eval_info.slack()
        # NaN compares as False, so a cost that is not finite is rejected
        accept = (change <= self.low_cutoff * promised + slack) | first_step
        good = change <= self.high_cutoff * promised + slack
        grow = jnp.where(good & ~first_step, self.high_constant, 1.0)
        size = state.step_size * jnp.where(accept, grow, self.low_constant)
        state = eqx.tree_at(lambda s: s.step_size, state, size)
        return size, accept, optx.RESULTS.successful, state


class MarquardtDescent(optx.AbstractDescent):
    """The damped Gauss-Newton step; its state is the last accepted expansion."""

    def init(self, y, f_info_struct):
        """Return a state of the right shape."""
        del y
        return f_info_struct

    def query(self, y, f_info, state):
        """Return the expansion as the state."""
        del y, state
        return f_info

    def step(self, step_size, state):
        """Return the step."""
        factor = cholesky(state.hessian, 1 / step_size)
        step = backward(factor, forward(factor, state.grad))
        return -jnp.stack(step), optx.RESULTS.successful


def half_square(residual: Float[Array, "..."]) -> tuple[Array, Array, Array]:
    """Return the cost of normal errors, its slope and its curvature."""
    return 0.5 * residual * residual, residual, jnp.ones_like(residual)


class LaneLevenbergMarquardt(optx.AbstractLeastSquaresSolver):
    """Levenberg-Marquardt over lanes; see the top of this file.

    `options` may have, for each lane, `floor` (rounding error of the length of the
    vector of residuals, default 0) and `skip` (do not move the lane), and `stragglers`:
    the share of lanes for which the loop does not wait. The state contains the lanes
    that have ended; `at_optimum` returns those at an optimum.

    Attributes:
        tolerance: Largest whitened gradient of an optimum, unless rounding is larger.
        loss: Cost, slope and (positive) curvature of each residual; default half of the
            square.
        jacobian: "fwd", or "aux" if the function returns the Jacobian as auxiliary
            output: one array per unknown that broadcasts to the residuals.
    """

    tolerance: float = TOLERANCE
    loss: Loss = eqx.field(static=True, default=half_square)
    jacobian: Literal["fwd", "aux"] = eqx.field(static=True, default="fwd")
    descent: MarquardtDescent = eqx.field(default_factory=MarquardtDescent)
    search: FloorTrustRegion = eqx.field(default_factory=FloorTrustRegion)
    rtol: float = TOLERANCE
    atol: float = TOLERANCE
    norm: Callable = eqx.field(static=True, default=optx.max_norm)

    def evaluate(self, fn, y, args, options) -> tuple[Expansion, Any]:
        """Return the cost about a place, and the function's aux."""
        if self.jacobian == "aux":
            residual, aux = fn(y, args)
            columns = aux
        else:
            residual, push, aux = jax.linearize(lambda y: fn(y, args), y, has_aux=True)
            units = [jnp.zeros_like(y).at[k].set(1.0) for k in range(y.shape[0])]
            columns = [push(unit) for unit in units]
        floor = options.get("floor", 0.0)
        return expansion(self.loss, y, residual, columns, floor), aux

    def init(self, fn, y, args, options, f_struct, aux_struct, tags):
        """Return the state before the first step."""
        del f_struct, aux_struct, tags
        shape = jax.eval_shape(lambda y: self.evaluate(fn, y, args, options)[0], y)
        info = jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), shape)
        lanes = y.shape[1:]
        return SolverState(
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
        # whitened gradient, the length of the undamped step: a damped step is short
        # even far from the optimum
        length = squared(forward(cholesky(info.hessian), info.grad))
        ended = lost | ~(length > self.square_tolerance(info))
        state = SolverState(
            first_step=jnp.array(False),
            y_eval=jnp.where(jnp.isfinite(diff), y + diff, y),
            info=info,
            search=eqx.tree_at(lambda s: s.step_size, search, size),
            done=state.done | ended,
            steps=state.steps + jnp.where(state.done, 0, 1),
        )
        return y, state, aux

    def square_tolerance(self, info: Expansion) -> Lanes:
        """Return the square of the largest whitened gradient at an optimum."""
        return jnp.maximum(self.tolerance, 4 * info.floor) ** 2

    def at_optimum(self, info: Expansion) -> Bool[Array, "..."]:
        """Return True for lanes at an optimum, within rounding."""
        factor = cholesky(info.hessian)
        least = self.square_tolerance(info)
        length = squared(forward(factor, info.grad))
        near = (length <= least) & (least <= COARSEST**2)
        return jnp.isfinite(info.f) & factor.positive & near

    def terminate(self, fn, y, args, options, state, tags):
        """Return True if all lanes but the stragglers have ended."""
        del fn, args, tags
        left = jnp.mean(~state.done, dtype=y.dtype)
        return left <= options.get("stragglers", 0.0), optx.RESULTS.successful

    def postprocess(self, fn, y, aux, args, options, state, tags, result):
        """Return the inputs: convergence of lanes is in the state."""
        del fn, args, options, state, tags, result
        return y, aux, {}


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
    value, slope, curvature = loss(residual)
    cost = jnp.sum(value, axis=0)
    grad = tuple(jnp.sum(column * slope, axis=0) for column in columns)
    hessian = triangle(columns, None if loss is half_square else curvature)
    eps = jnp.finfo(residual.dtype).eps
    # rounding of the unknowns changes the residuals as well
    moved = [
        jnp.sqrt(jnp.maximum(row[-1], 0.0)) * jnp.abs(x)
        for row, x in zip(hessian, y, strict=True)
    ]
    rounded = floor + eps * sum(moved[1:], start=moved[0])
    return Expansion(cost, grad, hessian, rounded)


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


def newton(
    cost: Cost, y: Float[Array, "unknown lane"], floor: Float[Array, " lane"]
) -> Float[Array, "unknown lane"]:
    """Minimise a cost by Newton's method; a step is accepted only if it descends.

    Negative curvatures are replaced by their magnitude, so saddles are left.

    Args:
        cost: Cost and gradient of each lane.
        y: Starts of the lanes.
        floor: Rounding error of the cost: a larger increase is rejected.
    """
    units = jnp.eye(y.shape[0], dtype=y.dtype)

    def step(y: Float[Array, "unknown lane"], _: None):
        def along(unit: Float[Array, " unknown"]):
            moved = jnp.broadcast_to(unit[:, None], y.shape)
            return jax.jvp(lambda y: cost(y)[1], (y,), (moved,))[1]

        f, gradient = cost(y)
        whole = jnp.moveaxis(jax.vmap(along)(units), 2, 0)
        ahead = jax.vmap(_direction)(whole, gradient.T).T
        shares = jnp.array(SHARES, y.dtype)[:, None, None]
        places = y[None] + shares * ahead[None]
        there = jax.vmap(lambda y: cost(y)[0])(places)
        there = jnp.where(jnp.isfinite(there), there, jnp.inf)
        which = jnp.argmin(there, axis=0)
        lowest = jnp.take_along_axis(there, which[None], axis=0)[0]
        # Within rounding of the cost all shares are equal: the whole step is used,
        # which converges in the gradient.
        level = there[0] <= f + floor
        which = jnp.where(level & (lowest > f - floor), 0, which)
        best = jnp.take_along_axis(places, which[None, None], axis=0)[0]
        return jnp.where(level | (lowest < f), best, y), None

    return jax.lax.scan(step, y, None, length=STEPS)[0]


def _direction(
    curvature: Float[Array, "unknown unknown"], gradient: Float[Array, " unknown"]
) -> Float[Array, " unknown"]:
    """Return the Newton step with eigenvalues replaced by their magnitudes."""
    curvature = 0.5 * (curvature + curvature.T)
    # scaled to a unit diagonal: the signs of eigenvalues do not depend on units
    scale = jnp.sqrt(jnp.abs(jnp.diagonal(curvature)))
    scale = jnp.where(scale > 0, scale, 1.0)
    values, vectors = jnp.linalg.eigh(curvature / (scale[:, None] * scale[None, :]))
    values = jnp.abs(values)
    values = jnp.maximum(values, FLATTEST * jnp.max(values))
    step = vectors @ ((vectors.T @ (gradient / scale)) / values) / scale
    return jnp.where(jnp.isfinite(step).all(), -step, 0.0)


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
        least = 8 * (k + 1) * jnp.finfo(pivot.dtype).eps * pivot
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
