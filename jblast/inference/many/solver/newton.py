r"""Newton's method with the whole curvature, for lanes that Gauss-Newton does not end.

Gauss-Newton leaves out $\sum_i r_i \nabla^2 r_i$. Where that is more than twice what it
sees (across a line of sensors, where readings tell of the square of an offset, and only
the prior curves the cost in its eyes), its steps end as far on the other side or
farther. What it leaves out takes a pass per unknown, so few lanes are given it, once
they are known.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

STEPS = 24
SHARES = (1.0, 0.25, 0.0625, 0.015625)
"""Of a step, the lowest of which is taken; of none that is lower, none."""
FLATTEST = 1e-9
"""Of the largest curvature: what is less counts as this much."""

Cost = Callable[
    [Float[Array, "unknown lane"]],
    tuple[Float[Array, " lane"], Float[Array, "unknown lane"]],
]
"""From a place to the cost and its gradient, each lane by itself."""


def newton(
    cost: Cost, y: Float[Array, "unknown lane"], floor: Float[Array, " lane"]
) -> Float[Array, "unknown lane"]:
    """Return where lanes get to; a place is left for a lower one alone.

    Directions that curve downwards count as if they curved upwards (saddles are left).

    Args:
        cost: To be minimised.
        y: Where lanes begin.
        floor: What rounding does to the cost: a step that is up by less may be taken.
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
        # where the cost no longer tells, the whole step is as good as any, and ends
        level = there[0] <= f + floor
        which = jnp.where(level & (lowest > f - floor), 0, which)
        best = jnp.take_along_axis(places, which[None, None], axis=0)[0]
        return jnp.where(level | (lowest < f), best, y), None

    return jax.lax.scan(step, y, None, length=STEPS)[0]


def _direction(
    curvature: Float[Array, "unknown unknown"], gradient: Float[Array, " unknown"]
) -> Float[Array, " unknown"]:
    """Return the step to the optimum of a cost of that curvature, made positive."""
    curvature = 0.5 * (curvature + curvature.T)
    scale = jnp.sqrt(jnp.abs(jnp.diagonal(curvature)))
    scale = jnp.where(scale > 0, scale, 1.0)
    values, vectors = jnp.linalg.eigh(curvature / (scale[:, None] * scale[None, :]))
    values = jnp.abs(values)
    values = jnp.maximum(values, FLATTEST * jnp.max(values))
    step = vectors @ ((vectors.T @ (gradient / scale)) / values) / scale
    return jnp.where(jnp.isfinite(step).all(), -step, 0.0)
