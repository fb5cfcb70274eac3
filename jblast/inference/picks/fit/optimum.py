r"""The most probable unknowns of many records at once, and how they move with those.

The search is the lanes' Levenberg-Marquardt of `inference/many`, a record a lane. It is
not differentiated: an optimum is where the slope $g(y, d)$ of minus ln posterior is
zero, so $\mathrm{d}y = -H^{-1}\,\partial_d g\,\mathrm{d}d$, with the full Hessian $H$.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from jblast.inference.picks.ready.case import Case

MOST_STEPS = 60
TOLERANCE = 1e-3
"""Ends where the way left to an optimum is this long [standard deviations]."""

KINK = 0.5
"""Where a sharp front meets the edge of a sample the cost has a kink, and may have its
least there, so far from where its slopes would have it [standard deviations]."""

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-1, 1e-10, 1e6
SMALL_DAMPING = 1e-3
"""Of a unit diagonal: no end is seen from a step that is damped more."""

Misfit = Callable[[Float[Array, " unknown"], Case], Float[Array, " term"]]


class Optimum(NamedTuple):
    """The most probable unknowns of records.

    Attributes:
        y: The unknowns.
        covariance: Of the posterior about them, by Gauss and Newton.
        converged: Whether they are an optimum.
    """

    y: Float[Array, "lane unknown"]
    covariance: Float[Array, "lane unknown unknown"]
    converged: Bool[Array, " lane"]


def optimum_of(
    misfit: Misfit, start: Float[Array, "lane unknown"], case: Case
) -> Optimum:
    """Return the optima of records.

    Args:
        misfit: Of one record.
        start: Where to begin.
        case: The records; each array has a first axis of lanes.
    """
    still = lax.stop_gradient(case)
    y, covariance, converged = _search(misfit, lax.stop_gradient(start), still)

    def settled(y, one):
        return _settled(misfit, y, one)

    return Optimum(jax.vmap(settled)(y, case), covariance, converged)


class _State(NamedTuple):
    """What the search carries; each array has a first axis of lanes, but the count."""

    y: Float[Array, "lane unknown"]
    tried: Float[Array, "lane unknown"]
    damping: Float[Array, " lane"]
    here: "_Expansion"
    done: Bool[Array, " lane"]
    steps: Int[Array, ""]


class _Expansion(NamedTuple):
    """Minus ln posterior about a place, to second order by Gauss and Newton.

    The unknowns are scaled so that the information has a diagonal of ones.
    """

    cost: Float[Array, "..."]
    slope: Float[Array, "... unknown"]
    information: Float[Array, "... unknown unknown"]
    scale: Float[Array, "... unknown"]


def _expansion(misfit: Misfit, y, case: Case) -> _Expansion:
    """Return the cost of one record about a place."""

    def twice(y):
        apart = misfit(y, case)
        return apart, apart

    jacobian, apart = jax.jacfwd(twice, has_aux=True)(y)
    information = jacobian.T @ jacobian
    scale = 1.0 / jnp.sqrt(jnp.diagonal(information))
    return _Expansion(
        cost=0.5 * jnp.sum(apart * apart),
        slope=scale * (jacobian.T @ apart),
        information=information * scale[:, None] * scale[None, :],
        scale=scale,
    )


def _search(misfit: Misfit, start, case: Case):
    """Return the optima, found by Levenberg-Marquardt over lanes."""
    expand = jax.vmap(lambda y, one: _expansion(misfit, y, one))
    lanes, unknowns = start.shape
    unit = jnp.eye(unknowns, dtype=start.dtype)
    eps = jnp.finfo(start.dtype).eps
    # what rounding makes of the cost, and of a slope in standard deviations
    rounding = 4.0 * eps * jnp.sqrt(jnp.sum(jnp.square(case.weight), axis=1))

    def step(state: _State) -> _State:
        there = expand(state.tried, case)
        slack = rounding * (jnp.sqrt(2.0 * jnp.abs(there.cost)) + rounding)
        better = there.cost <= state.here.cost + slack
        taken = better & ~state.done
        here = jax.tree.map(
            lambda new, old: jnp.where(_along(taken, new), new, old), there, state.here
        )
        y = jnp.where(taken[:, None], state.tried, state.y)
        damping = jnp.where(better, 0.1 * state.damping, 10.0 * state.damping)
        damping = jnp.clip(damping, LEAST_DAMPING, MOST_DAMPING)
        matrix = here.information + damping[:, None, None] * unit[None]
        move = -jnp.linalg.solve(matrix, here.slope[..., None])[..., 0]
        left = -jnp.sum(move * (2.0 * here.slope + damping[:, None] * move), axis=1)
        near = left <= jnp.square(jnp.maximum(TOLERANCE, rounding))
        move = jnp.where(jnp.isfinite(move), move, 0.0)
        return _State(
            y=y,
            tried=y + move * here.scale,
            damping=jnp.where(state.done, state.damping, damping),
            here=here,
            done=state.done | (near & (damping <= SMALL_DAMPING)),
            steps=state.steps + 1,
        )

    def going(state: _State):
        return jnp.any(~state.done) & (state.steps < MOST_STEPS)

    nothing = _Expansion(
        cost=jnp.full(lanes, jnp.inf, start.dtype),
        slope=jnp.zeros_like(start),
        information=jnp.broadcast_to(unit, (lanes, *unit.shape)),
        scale=jnp.ones_like(start),
    )
    state = _State(
        y=start,
        tried=start,
        damping=jnp.full(lanes, FIRST_DAMPING, start.dtype),
        here=nothing,
        done=jnp.zeros(lanes, bool),
        steps=jnp.asarray(0),
    )
    state = lax.while_loop(going, step, state)
    inverse = jnp.linalg.inv(state.here.information)
    scale = state.here.scale
    covariance = inverse * scale[:, :, None] * scale[:, None, :]
    slope = state.here.slope
    left = jnp.einsum("li,lij,lj->l", slope, inverse, slope)
    return state.y, covariance, state.done | (left < KINK**2)


def _along(lanes, other):
    """Return numbers of lanes in the shape of another array of lanes."""
    return lanes.reshape(-1, *[1] * (other.ndim - 1))


def _slope(misfit: Misfit, y, case: Case):
    """Return the slope of minus ln posterior."""
    apart, back = jax.vjp(lambda y: misfit(y, case), y)
    return back(apart)[0]


def _settled(misfit: Misfit, y, case: Case):
    """Return an optimum, with the slopes of the implicit function."""

    @jax.custom_jvp
    def settled(y, case):
        del case
        return y

    @settled.defjvp
    def _(primals, tangents):
        y, case = primals
        _, moved = jax.jvp(
            lambda case: _slope(misfit, y, case), (case,), (tangents[1],)
        )
        bend = jax.jacfwd(lambda y: _slope(misfit, y, case))(y)
        return y, -jnp.linalg.solve(bend, moved[:, None])[:, 0]

    return settled(y, case)
