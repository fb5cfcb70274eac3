r"""How far a step goes, and whether it is taken.

The step is $-(H + \lambda\,\mathrm{diag}\,H)^{-1} g$ (Marquardt), by a Cholesky factor
written out. $1/\lambda$ is optimistix' step size. At the optimum a cost falls by less
than its rounding, and a trust region that wants to see it fall rejects step after step
(which held the slowest lane, and so the whole batch): ours accepts there.
"""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import ScalarLike

from jblast.inference.many.solver.normal_equations import backward, cholesky, forward

FIRST_STEP_SIZE = 100.0


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
