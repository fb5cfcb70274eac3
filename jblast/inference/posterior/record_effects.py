"""Effects that records share, and of each its own: their mode, and how it curves.

A record's own unknowns meet those of another by way of the shared effects alone: the
curvature is an arrowhead matrix, of which each record's part is eliminated by itself.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

ROUNDS = 50
"""Of the search, at most."""
SETTLED = 1e-6
"""A step that promises to gain less, in ln-density, ends it; the steps that are
differentiated leave the square of what is left."""
CARRIERS = 5
"""Steps that are differentiated: at SNR 20 slopes are off by 2 % with 3, 0.3 % with 5,
0.003 % with 9."""
FIRST_DAMPING, LEAST_DAMPING = 1e-3, 1e-9


class EffectValues(NamedTuple):
    """Effects: those that rows share, and of each record its own and its nuisances."""

    shared: Float[Array, " effect"]
    own: Float[Array, "record own"]


class Expansion(NamedTuple):
    """Minus ln of the joint density about a place, to second order (Gauss, Newton).

    Attributes:
        cost: There.
        slope: To shared effects, and to each record's own.
        curvature: Of shared effects, of each record's own, and between them.
        of_records: Of the cost, what each record has of it.
    """

    cost: Float[Array, ""]
    slope: EffectValues
    curvature: tuple[Array, Array, Array]
    of_records: Float[Array, " record"]


def newton_step(here: Expansion, damping) -> tuple[EffectValues, Array]:
    """Return a step downhill, and ln of the curvature's determinant.

    Each record's own unknowns are eliminated, then those that are shared are solved
    for (an arrowhead matrix).
    """
    shared, inner, between = here.curvature
    size = jnp.diagonal(inner, axis1=1, axis2=2)
    inner = inner + damping * size[:, :, None] * jnp.eye(inner.shape[1])[None]
    shared = shared + damping * jnp.diag(jnp.diagonal(shared))
    right = jnp.concatenate([here.slope.own[:, :, None], between], axis=2)
    solved = jnp.linalg.solve(inner, right)
    own, response = solved[:, :, 0], solved[:, :, 1:]
    left = shared - jnp.einsum("rok,rol->kl", between, response)
    slope = here.slope.shared - jnp.einsum("rok,ro->k", between, own)
    moved = -jnp.linalg.solve(left, slope)
    step = EffectValues(moved, -own - response @ moved)
    spread = jnp.sum(jnp.linalg.slogdet(inner)[1]) + jnp.linalg.slogdet(left)[1]
    return step, spread


def mode_of(
    expand: Callable[[EffectValues], Expansion], start: EffectValues
) -> tuple[EffectValues, Expansion]:
    """Return the mode of all effects, by damped steps downhill, and its expansion."""
    # expanded in one place of the program alone: it takes long to compile
    blank = jax.tree.map(
        lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(expand, start)
    )
    here = blank._replace(cost=jnp.asarray(jnp.inf, blank.cost.dtype))

    def again(state):
        rounds, place, here, tried, damping, _ = state
        there = expand(tried)
        better = there.cost < here.cost  # not so where it is no number
        place, here = jax.tree.map(
            lambda new, old: jnp.where(better, new, old), (tried, there), (place, here)
        )
        damping = jnp.where(better, 0.1 * damping, 10.0 * damping)
        damping = jnp.maximum(damping, LEAST_DAMPING)
        step, _ = newton_step(here, damping)
        promised = jnp.abs(
            jnp.sum(step.shared * here.slope.shared)
            + jnp.sum(step.own * here.slope.own)
        )
        tried = jax.tree.map(jnp.add, place, step)
        return rounds + 1, place, here, tried, damping, promised

    def unsettled(state):
        rounds, *_, promised = state
        return (rounds < ROUNDS) & (promised > SETTLED)

    most = jnp.asarray(jnp.inf, here.cost.dtype)
    first = jnp.asarray(10 * FIRST_DAMPING, here.cost.dtype)
    state = (0, start, here, start, first, most)
    _, place, here, *_ = lax.while_loop(unsettled, again, state)
    return place, here


def weightiest(places: EffectValues, about: Expansion) -> EffectValues:
    """Return of some modes the one of most weight, record by record.

    Records' own unknowns meet by way of the shared effects alone, which are the best
    mode's. By weight, and not by height: where a low and wide mode takes over from a
    high and narrow one, what Laplace's method makes of them goes on without a step.

    Args:
        places: Modes, along a first axis.
        about: And what is about them.
    """
    spread = jnp.linalg.slogdet(about.curvature[1])[1]
    lost = about.of_records + 0.5 * spread
    lost = jnp.where(jnp.isfinite(lost), lost, jnp.inf)
    best = jnp.argmin(jnp.where(jnp.isnan(about.cost), jnp.inf, about.cost))
    chosen = jnp.argmin(lost, axis=0)
    own = jnp.take_along_axis(places.own, chosen[None, :, None], axis=0)[0]
    return EffectValues(places.shared[best], own)


def settled(
    expand: Callable[[EffectValues], Expansion], place: EffectValues
) -> tuple[Array, Array]:
    """Return cost and ln of the curvature's determinant at the mode.

    Steps that are differentiated carry the slopes of the mode, which the search does
    not: by Gauss and Newton, each of them brings these nearer. The last is taken that
    does not go uphill: at the mode all have one cost, and the first of them no slopes.
    """

    def step(place, _):
        here = expand(place)
        fixed = lax.stop_gradient(here.curvature)
        move, _ = newton_step(here._replace(curvature=fixed), 0.0)
        _, spread = newton_step(here, 0.0)
        return jax.tree.map(jnp.add, place, move), (here.cost, spread)

    _, (cost, spread) = lax.scan(step, place, length=CARRIERS)
    downhill = lax.stop_gradient(cost <= cost[0] + SETTLED)  # not so of no number
    best = jnp.max(jnp.where(downhill, jnp.arange(cost.size), 0))
    return cost[best], spread[best]
