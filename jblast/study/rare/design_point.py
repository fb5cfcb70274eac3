r"""Where a rare event is least improbable: the design points of structural reliability.

In standard normal coordinates $u$ an event is where a margin $g(u)$ is positive. The
point of it nearest to the origin, at the distance $\beta$, is its most probable one
(Hasofer and Lind 1974); the first-order answer is $P = \Phi(-\beta)$, exact where $g$
is linear. It is found by the steps of Rackwitz and Fiessler (1978),

$$u_{k+1} = \frac{\nabla g^T u_k - g}{|\nabla g|^2}\,\nabla g,$$

each cut until the merit $\tfrac12|u|^2 + c\,|g|$ falls (Zhang and Der Kiureghian 1995).
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

Margin = Callable[[Float[Array, " dimension"]], Float[Array, ""]]
"""From standard normal coordinates to a number that is positive where the event is."""
STEPS = 60
CUTS = 0.5 ** np.arange(8)
APART = 0.5
"""Points nearer to each other than this are one."""
LEAST_SHARE = 1e-3
"""A point so much less probable than the best is left out."""
TOLERANCE = 1e-6


class DesignPoints(NamedTuple):
    """The local most probable points of an event, the most probable first.

    Attributes:
        points: In standard normal coordinates.
        distance: Of each from the origin, its reliability index; negative where the
            origin itself lies in the event.
        evaluations: Of the margin, that the search took.
    """

    points: Float[np.ndarray, "point dimension"]
    distance: Float[np.ndarray, " point"]
    evaluations: int


def design_points(
    margin: Margin, dimensions: int, *, starts: int = 8, seed: int = 0
) -> DesignPoints:
    """Search from the origin and from random points about it.

    Args:
        margin: Of one sample; differentiable, and finite near the origin.
        dimensions: How many numbers are drawn.
        starts: How many searches there are.
        seed: Of where all but the first begin.

    Raises:
        ValueError: No search found the edge of the event.
    """
    key = jax.random.fold_in(jax.random.key(seed), dimensions)
    begin = jax.random.normal(key, (starts, dimensions)).at[0].set(1e-3)
    ends, off = search(margin, begin)
    found, left_over = np.asarray(ends), np.asarray(off)
    length = np.linalg.norm(found, axis=1)
    good = np.flatnonzero((left_over < TOLERANCE) & np.isfinite(length))
    if not good.size:
        raise ValueError(
            f"margin: expected an edge that {starts} searches from the origin can "
            "reach, found none: the event may not happen at all, or the margin be flat"
        )
    order = good[np.argsort(length[good], kind="stable")]
    least = length[order[0]]
    kept: list[int] = []
    for n in order:
        rare = 0.5 * (length[n] ** 2 - least**2) > -np.log(LEAST_SHARE)
        near = any(np.linalg.norm(found[n] - found[one]) < APART for one in kept)
        if not (rare or near):
            kept.append(int(n))
    inside = float(margin(jnp.zeros(dimensions))) > 0
    return DesignPoints(
        found[kept],
        length[kept] * (-1 if inside else 1),
        starts * STEPS * (1 + len(CUTS)),
    )


@partial(jax.jit, static_argnums=0)
def search(
    margin: Margin, begin: Float[Array, "start dimension"]
) -> tuple[Float[Array, "start dimension"], Float[Array, " start"]]:
    """Return where searches end, and how far they are from what they look for.

    That is the larger of the distance to the edge, along the slope, and of the last
    step, a share of the distance from the origin.
    """
    cuts = jnp.asarray(CUTS, begin.dtype)

    def target(u):
        value, slope = jax.value_and_grad(margin)(u)
        steep = jnp.sum(slope**2)
        safe = jnp.where(steep > 0, steep, 1.0)
        there = (slope @ u - value) / safe * slope
        return value, jnp.sqrt(safe), jnp.where(steep > 0, there, jnp.nan)

    def step(u, _):
        value, steep, there = target(u)
        # above |u| / |slope| the step is one downwards
        size = 2 * jnp.maximum(jnp.linalg.norm(there), jnp.linalg.norm(u)) / steep
        penalty = size + 10.0 / steep

        def merit(v, g):
            return 0.5 * jnp.sum(v**2) + penalty * jnp.abs(g)

        tried = u[None] + cuts[:, None] * (there - u)[None]
        merits = jax.vmap(lambda v: merit(v, margin(v)))(tried)
        merits = jnp.where(jnp.isfinite(merits), merits, jnp.inf)
        at = jnp.argmin(merits)
        better = merits[at] < merit(u, value)
        return jnp.where(better, tried[at], u), None

    def one(start):
        end, _ = jax.lax.scan(step, start, length=STEPS)
        value, steep, there = target(end)
        scale = 1.0 + jnp.linalg.norm(end)
        away = jnp.linalg.norm(there - end) / scale
        return end, jnp.maximum(jnp.abs(value) / steep, away)

    return jax.vmap(one)(begin)
