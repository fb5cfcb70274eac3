"""Where a search for what a camera saw begins.

A fireball's rim that stands elsewhere than expected has no slope that leads there, and
white that is cut off has none at all: a search from afar can end where nothing fits. So
it is looked at here and there, up to a few large changes away, and a search begins
where least is left; from the next such place where that leads to nothing.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.tuning.search.solve import Problem, Solution, solve

PLACES, TRIED = 96, 3
"""Looked at, and begun from."""
SPREAD = 0.7
"""Of the places looked at: their standard deviation in large changes."""


def best_of_several(problem: Problem, allowed: float) -> tuple[Solution, float]:
    """Return where searches from several places ended best, and the error there.

    Args:
        problem: What is to be solved.
        allowed: What may be left (`misfit`) for a search to be the last.
    """
    ended = []
    for place in places(problem)[:TRIED]:
        found = solve(problem, place)
        (error,) = np.asarray(_misfits(problem, jnp.asarray(found.z)[None]))
        ended.append((error if np.isfinite(error) else np.inf, found))
        if error <= allowed:
            break
    error, found = min(ended, key=lambda one: one[0])
    return found, float(error)


def places(problem: Problem) -> list[Float[np.ndarray, " unknown"]]:
    """Return places to begin at, the one that explains most first.

    The same for the same problem; the problem's own start is among those looked at.
    """
    start, steps = np.asarray(problem.start), np.asarray(problem.steps())
    drawn = np.random.default_rng(0).normal(size=(PLACES, start.size))
    drawn[0] = 0.0
    looked_at = start + SPREAD * drawn * steps
    left = np.asarray(_misfits(problem, jnp.asarray(looked_at)))
    order = np.argsort(np.where(np.isfinite(left), left, np.inf), kind="stable")
    return list(looked_at[order])


@eqx.filter_jit
def _misfits(
    problem: Problem, looked_at: Float[Array, "place unknown"]
) -> Float[Array, " place"]:
    return jax.lax.map(
        lambda z: problem.evidence.misfit(problem.scene_at(z)), looked_at
    )
