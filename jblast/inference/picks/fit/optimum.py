r"""The most probable unknowns of a record, and how they move with it.

The search is the Levenberg-Marquardt of `inference/many`, for one record. It is not
differentiated: an optimum is where the slope $g(y, d)$ of minus ln posterior is
zero, so $\mathrm{d}y = -H^{-1}\,\partial_d g\,\mathrm{d}d$, with the full Hessian $H$.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from jblast.inference.picks.ready.case import Case

MOST_STEPS = 60
TOLERANCE = 1e-3
"""Ends with the step before which the way left to an optimum is this long [standard
deviations, as they are widened by the misfit]: behind it a tenth or less is left."""

KINK = 0.5
"""Where a sharp front meets the edge of a sample the cost has a kink, and may have its
least there, so far from where its slopes would have it [standard deviations]."""

STILL = 1e-4
"""A step that lowers minus ln posterior by less, as errors are widened, is lost."""

MOST_LOST = 6
"""Steps in a row: at a kink the next are no better, whatever their damping, and it is
an optimum, whatever the slopes say."""

PATIENT = 10
"""Steps by which a search is to be as good as what stands already."""

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-1, 1e-10, 1e6
SMALL_DAMPING = 1e-2
"""Of a unit diagonal: no end is seen from a step that is damped more."""

Misfit = Callable[[Float[Array, " unknown"], Case], Float[Array, " term"]]


class Optimum(NamedTuple):
    """The most probable unknowns of a record.

    Attributes:
        y: The unknowns.
        covariance: Of the posterior about them, by Gauss and Newton.
        converged: Whether they are an optimum.
        cost: Minus ln posterior of the last step but the one that ended the search.
        size: ln of the determinant of the covariance.
    """

    y: Float[Array, " unknown"]
    covariance: Float[Array, "unknown unknown"]
    converged: Bool[Array, ""]
    cost: Float[Array, ""]
    size: Float[Array, ""]


def optimum_of(
    misfit: Misfit,
    start: Float[Array, " unknown"],
    case: Case,
    *,
    most_steps: int = MOST_STEPS,
    hopeless: Float[Array, ""] | float = np.inf,
) -> Optimum:
    """Return the optimum of a record.

    Args:
        misfit: Its misfit.
        start: Where to begin.
        case: The record.
        most_steps: After which the search ends, at an optimum or not.
        hopeless: A search that is dearer than this after `PATIENT` steps ends: what it
            would come to is not asked for.
    """
    still = lax.stop_gradient(case)
    begin = lax.stop_gradient(start)
    found = _search(misfit, begin, still, most_steps, hopeless)
    y, cost, size = _settled(misfit, found, case)
    return found._replace(y=y, cost=cost, size=size)


class _State(NamedTuple):
    """What the search carries."""

    y: Float[Array, " unknown"]
    tried: Float[Array, " unknown"]
    damping: Float[Array, ""]
    here: "_Expansion"
    done: Bool[Array, ""]
    steps: Int[Array, ""]
    lost: Int[Array, ""]


class _Expansion(NamedTuple):
    """Minus ln posterior about a place, to second order by Gauss and Newton.

    The unknowns are scaled so that the information has a diagonal of ones.
    """

    cost: Float[Array, ""]
    slope: Float[Array, " unknown"]
    information: Float[Array, "unknown unknown"]
    scale: Float[Array, " unknown"]


def _expansion(misfit: Misfit, y, apart, cost, case: Case) -> _Expansion:
    """Return the cost of a record about a place, its misfit there being known."""
    _, moved = jax.linearize(lambda y: misfit(y, case), y)
    # a row an unknown: what is done to each of them runs along the bins
    slopes = jax.vmap(moved)(jnp.eye(y.size, dtype=y.dtype))
    information = slopes @ slopes.T
    scale = 1.0 / jnp.sqrt(jnp.diagonal(information))
    return _Expansion(
        cost=cost,
        slope=scale * (slopes @ apart),
        information=information * scale[:, None] * scale[None, :],
        scale=scale,
    )


def _search(misfit: Misfit, start, case: Case, most_steps: int, hopeless) -> Optimum:
    """Return the optimum, found by Levenberg-Marquardt."""
    unit = jnp.eye(start.size, dtype=start.dtype)
    eps = jnp.finfo(start.dtype).eps
    # what rounding makes of the cost, and of a slope in standard deviations
    rounding = 4.0 * eps * jnp.sqrt(jnp.sum(jnp.square(case.weight)))
    many = jnp.maximum(jnp.sum((case.weight > 0).astype(start.dtype)), 1.0)

    def step(state: _State) -> _State:
        apart = misfit(state.tried, case)
        cost = 0.5 * jnp.sum(apart * apart)
        slack = rounding * (jnp.sqrt(2.0 * jnp.abs(cost)) + rounding)
        better = cost <= state.here.cost + slack
        widened = jnp.maximum(2.0 * state.here.cost / many, 1.0)
        lost = ~(cost < state.here.cost - STILL * widened)
        # slopes cost as much as several misfits, and not every step is taken
        here = lax.cond(
            better,
            lambda: _expansion(misfit, state.tried, apart, cost, case),
            lambda: state.here,
        )
        y = jnp.where(better, state.tried, state.y)
        damping = jnp.where(better, 0.1 * state.damping, 10.0 * state.damping)
        damping = jnp.clip(damping, LEAST_DAMPING, MOST_DAMPING)
        move = -jnp.linalg.solve(here.information + damping * unit, here.slope)
        left = -jnp.sum(move * (2.0 * here.slope + damping * move))
        # what does not fit has larger errors, and no use for as many digits
        near = left <= widened * jnp.square(jnp.maximum(TOLERANCE, rounding))
        move = jnp.where(jnp.isfinite(move), move, 0.0)
        return _State(
            y=y,
            tried=y + move * here.scale,
            damping=damping,
            here=here,
            done=near & (damping <= SMALL_DAMPING),
            steps=state.steps + 1,
            lost=jnp.where(lost, state.lost + 1, 0),
        )

    nothing = _Expansion(
        cost=jnp.full((), jnp.inf, start.dtype),
        slope=jnp.zeros_like(start),
        information=unit,
        scale=jnp.ones_like(start),
    )
    state = _State(
        y=start,
        tried=start,
        damping=jnp.full((), FIRST_DAMPING, start.dtype),
        here=nothing,
        done=jnp.asarray(False),
        steps=jnp.asarray(0),
        lost=jnp.asarray(0),
    )

    def goes_on(state: _State) -> Bool[Array, ""]:
        hopes = (state.steps < PATIENT) | ~(state.here.cost > hopeless)
        ended = state.done | (state.steps >= most_steps) | (state.lost >= MOST_LOST)
        return hopes & ~ended

    state = lax.while_loop(goes_on, step, state)
    inverse = jnp.linalg.inv(state.here.information)
    scale, slope = state.here.scale, state.here.slope
    covariance = inverse * scale[:, None] * scale[None, :]
    left = slope @ inverse @ slope
    y = jnp.where(state.done, state.tried, state.y)
    ended = state.done | (state.lost >= MOST_LOST)
    size = jnp.linalg.slogdet(covariance)[1]
    return Optimum(y, covariance, ended | (left < KINK**2), state.here.cost, size)


def _slope(misfit: Misfit, y, case: Case):
    """Return the slope of minus ln posterior."""
    apart, back = jax.vjp(lambda y: misfit(y, case), y)
    return back(apart)[0]


def _settled(misfit: Misfit, found: Optimum, case: Case):
    """Return an optimum, its cost and size, with slopes of the implicit function."""

    def size_at(y, case):
        slopes = jax.jacfwd(lambda y: misfit(y, case))(y)
        return -jnp.linalg.slogdet(slopes.T @ slopes)[1]

    @jax.custom_jvp
    def settled(y, cost, size, case):
        del case
        return y, cost, size

    @settled.defjvp
    def _(primals, tangents):
        y, _, _, case = primals
        moves = tangents[3]
        _, moved = jax.jvp(lambda case: _slope(misfit, y, case), (case,), (moves,))
        bend = jax.jacfwd(lambda y: _slope(misfit, y, case))(y)
        there = -jnp.linalg.solve(bend, moved[:, None])[:, 0]
        # at an optimum the cost moves by the record alone, its width by both
        _, dearer = jax.jvp(
            lambda case: 0.5 * jnp.sum(jnp.square(misfit(y, case))), (case,), (moves,)
        )
        _, wider = jax.jvp(size_at, (y, case), (there, moves))
        return primals[:3], (there, dearer, wider)

    return settled(found.y, found.cost, found.size, case)
