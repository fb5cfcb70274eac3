r"""Levenberg-Marquardt for many small problems at once, as an optimistix solver.

The unknowns $y$ have a first axis of unknowns; any further axes are lanes, each lane a
problem of its own: its residuals, a first axis of rows and the same lanes, depend on
its own unknowns alone. So `optimistix.least_squares` solves one problem with $y$ of
shape (free,), under `vmap` or not, and a batch in one loop with $y$ of shape
(free, lane), which is the fast way: the lane is the last axis of every array.
"""

from collections.abc import Callable
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int

from jblast.inference.many.solver.normal_equations import (
    Lanes,
    cholesky,
    forward,
    squared,
)
from jblast.inference.many.solver.quadratic_model import (
    Expansion,
    Loss,
    expansion,
    half_square,
)
from jblast.inference.many.solver.trust_region import FloorTrustRegion, MarquardtDescent

TOLERANCE = 1e-8
"""Converged: the whitened gradient, in standard deviations, is no longer than this, or
than rounding leaves it."""
COARSEST = 0.1
"""Where rounding leaves more than this, nothing counts as converged [sd]."""


class SolverState(eqx.Module):
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
    info: Expansion
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
        # of the undamped step: a damped one is short wherever it leads
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
        """Return the square of how long a whitened gradient may be at an optimum."""
        return jnp.maximum(self.tolerance, 4 * info.floor) ** 2

    def at_optimum(self, info: Expansion) -> Bool[Array, "..."]:
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
