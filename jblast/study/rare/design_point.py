r"""Design points of structural reliability: where a rare event is least improbable.

In standard normal coordinates $u$ an event is where a margin $g(u)$ is positive. Its
point nearest to the origin, at the distance $\beta$, is its most probable one
(Hasofer and Lind 1974); the first-order answer is $P = \Phi(-\beta)$, exact where $g$
is linear. It is found by the steps of Rackwitz and Fiessler (1978),

$$u_{k+1} = \frac{\nabla g^T u_k - g}{|\nabla g|^2}\,\nabla g,$$

each cut until the merit $\tfrac12|u|^2 + c\,|g|$ falls (Zhang and Der Kiureghian 1995).

An event may have several such points. Searches start at random and at the mirror image
of each point found. After $n$ searches that ended at $w$ different points the expected
number of points is (Boender and Rinnooy Kan 1987, Math. Program. 37:59, eq. 9)

$$\hat w = \frac{w\,(n - 1)}{n - w - 2},$$

and the search is complete when $\hat w < w + \tfrac12$, that is $n > 2w^2 + 3w + 2$.
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
STEPS = 20
"""Most steps of a search. Where the edge curves much they converge slowly, and the
remainder is not worth its calls: a point is the middle of a part of the samples."""
CUTS = 0.5 ** np.array([0, 1, 2, 4, 6])
BATCH = 8
"""Searches that run together."""
STARTS = 32
"""Fewest searches: a region that one start in ten leads to is missed in 3 % of runs."""
MOST_STARTS = 1024
"""Most searches; 22 equal regions need 1,036. More regions than that are a continuum
for practical purposes, and the search is reported as incomplete."""
APART = 0.5
"""Points nearer to each other than this are one."""
LEAST_SHARE = 1e-3
"""A point so much less probable than the best is left out."""
TOLERANCE = 1e-3
"""Residual (`search`) below which an end is a design point. The error of its distance
from the origin is of the order of the square, a millionth."""
ENOUGH = 1e-8
"""Residual below which a search makes no further step."""


class DesignPoints(NamedTuple):
    """Local most probable points of an event, the most probable first.

    Attributes:
        points: In standard normal coordinates.
        distance: Of each from the origin, its reliability index; negative where the
            origin itself lies in the event.
        evaluations: Of the margin, that the search took.
        searches: Searches that ended at one of the points.
        complete: No further point is expected from more searches.
    """

    points: Float[np.ndarray, "point dimension"]
    distance: Float[np.ndarray, " point"]
    evaluations: int
    searches: int = 0
    complete: bool = True


def design_points(
    margin: Margin, dimensions: int, *, starts: int = STARTS, seed: int = 0
) -> DesignPoints:
    """Search from random points about the origin until no new point is expected.

    Args:
        margin: Of one sample; differentiable, and finite near the origin.
        dimensions: Number of random variables.
        starts: Fewest searches.
        seed: Of the starts.

    Raises:
        ValueError: No search found the edge of the event.
    """
    found = explored(margin, dimensions, starts=starts, seed=seed)
    if not len(found.points):
        raise ValueError(
            f"margin: expected an edge that {starts} searches from the origin can "
            "reach, found none: the event may not happen at all, or the margin be flat"
        )
    return found


def explored(
    margin: Margin, dimensions: int, *, starts: int = STARTS, seed: int = 0
) -> DesignPoints:
    """Return design points as `design_points` does, none where no search found any."""
    key = jax.random.fold_in(jax.random.key(seed), dimensions)
    inside = float(margin(jnp.zeros(dimensions))) > 0
    found = DesignPoints(np.zeros((0, dimensions)), np.zeros(0), 1, 0, complete=False)
    mirrored = np.zeros((0, dimensions))
    launched = 0
    while True:
        key, own = jax.random.split(key)
        begin = np.array(jax.random.normal(own, (BATCH, dimensions)))
        if launched == 0:
            begin[0] = 1e-3
        begin[: len(mirrored)] = mirrored[:BATCH]
        before = found.points
        found = extended(margin, found, begin, inside=inside)
        launched += BATCH
        new = np.array([p for p in found.points if not near(p, before)])
        mirrored = -new.reshape(-1, dimensions)
        if launched < starts or (found.complete and len(mirrored)):
            continue
        # searches still to come, at the rate at which they have ended at a point
        total = searches_needed(len(found.points)) * launched / max(found.searches, 1)
        if found.complete or not found.searches or total > MOST_STARTS:
            return found


def extended(
    margin: Margin,
    known: DesignPoints,
    begin: Float[np.ndarray, "start dimension"],
    *,
    inside: bool = False,
) -> DesignPoints:
    """Return design points with those that searches from more starts end at.

    Args:
        margin: Of one sample.
        known: Points found before.
        begin: Starts, at most `BATCH`.
        inside: The origin lies in the event.
    """
    filled = np.resize(begin, (BATCH, begin.shape[1]))
    end, off, steps = search(margin, jnp.asarray(filled))
    ends, left_over = np.asarray(end)[: len(begin)], np.asarray(off)[: len(begin)]
    good = (left_over < TOLERANCE) & np.isfinite(left_over)
    ends = ends[good]
    every = np.concatenate([known.points, ends])
    length = np.linalg.norm(every, axis=1)
    least = length.min(initial=np.inf)
    likely = 0.5 * (length**2 - least**2) <= -np.log(LEAST_SHARE)
    kept: list[int] = []
    for n in range(len(every)):
        if likely[n] and not near(every[n], every[kept]):
            kept.append(n)
    kept.sort(key=lambda n: length[n])
    searches = known.searches + int(np.sum(likely[len(known.points) :]))
    return DesignPoints(
        every[kept],
        length[kept] * (-1 if inside else 1),
        known.evaluations + BATCH * (1 + int(steps) * (1 + len(CUTS))),
        searches,
        bool(kept) and searches > searches_needed(len(kept)),
    )


def near(
    point: Float[np.ndarray, " dimension"], others: Float[np.ndarray, "other dimension"]
) -> bool:
    """Return whether a point is one of others, within `APART`."""
    return bool(np.any(np.linalg.norm(others - point, axis=1) < APART))


def searches_needed(points: int) -> int:
    """Return the number of searches that must be exceeded (module docstring)."""
    return 2 * points**2 + 3 * points + 2


@partial(jax.jit, static_argnums=0)
def search(
    margin: Margin, begin: Float[Array, "start dimension"]
) -> tuple[Float[Array, "start dimension"], Float[Array, " start"], Array]:
    """Return the ends of searches, their residuals and the number of steps.

    A residual is the larger of the distance to the edge, along the slope, and of the
    last step, a share of the distance from the origin. Steps end when every search has
    converged or no cut of its step lowers its merit.
    """
    cuts = jnp.asarray(CUTS, begin.dtype)

    def target(u):
        value, slope = jax.value_and_grad(margin)(u)
        steep = jnp.sum(slope**2)
        safe = jnp.where(steep > 0, steep, 1.0)
        there = jnp.where(steep > 0, (slope @ u - value) / safe * slope, jnp.nan)
        steep = jnp.sqrt(safe)
        away = jnp.linalg.norm(there - u) / (1.0 + jnp.linalg.norm(u))
        return value, steep, there, jnp.maximum(jnp.abs(value) / steep, away)

    def step(u, value, steep, there, off):
        # above |u| / |slope| the step is one downwards
        size = 2 * jnp.maximum(jnp.linalg.norm(there), jnp.linalg.norm(u)) / steep
        penalty = size + 10.0 / steep

        def merit(v, g):
            return 0.5 * jnp.sum(v**2) + penalty * jnp.abs(g)

        tried = u[None] + cuts[:, None] * (there - u)[None]
        merits = jax.vmap(lambda v: merit(v, margin(v)))(tried)
        merits = jnp.where(jnp.isfinite(merits), merits, jnp.inf)
        at = jnp.argmin(merits)
        better = (merits[at] < merit(u, value)) & ~(off < ENOUGH)
        return jnp.where(better, tried[at], u), better

    def going(state):
        _, _, moved, steps = state
        return jnp.any(moved) & (steps < STEPS)

    def advance(state):
        u, known, _, steps = state
        nearer, moved = jax.vmap(step)(u, *known)
        return nearer, jax.vmap(target)(nearer), moved, steps + 1

    known = jax.vmap(target)(begin)
    state = begin, known, jnp.ones(len(begin), bool), jnp.asarray(0)
    end, known, _, steps = jax.lax.while_loop(going, advance, state)
    return end, known[3], steps
