"""How sure the answer is: by the normal approximation, or by walkers where it fails."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.ends import ends_judged
from jblast.inference.ensemble import Ensemble, ensemble
from jblast.inference.importance import (
    ENDS,
    GOOD_SHAPE,
    NARROW,
    ends_off,
    importance,
    laplace_holds,
    largest_log_sd,
)
from jblast.inference.laplace import marginals
from jblast.inference.sampling import WALKERS
from jblast.inference.solution import Solution
from jblast.inference.weighted import marginals_of_draws

Method = Literal["laplace", "emcee", "auto"]
DRAWS = 8000


@dataclass(frozen=True)
class HowSure:
    """What is known of every number, and by which method.

    Attributes:
        method: "laplace" or "emcee".
        reason: Why that one.
        z: Draws of the coordinates.
        marginals: By number: value (the most probable), sd, log_sd, q05, q50, q95.
        converged: Whether the method reached what it should.
        why: Sentences about what draws showed: modes, a ridge, intervals that are off.
        ensemble: The walk, where there was one.
    """

    method: str
    reason: str
    z: Float[np.ndarray, "draw free"]
    marginals: dict[str, dict[str, float | None]]
    converged: bool
    why: tuple[str, ...] = ()
    ensemble: Ensemble | None = None


def how_sure(
    solution: Solution,
    method: Method,
    *,
    seed: int = 0,
    rows: Sequence[str] = (),
    store: str | os.PathLike[str] | None = None,
) -> HowSure:
    """Draw from the posterior by the method wanted.

    Args:
        solution: What inference found.
        method: "laplace" takes the normal approximation, and says so where the ends of
            its intervals are off. "auto" takes it where importance sampling finds
            nothing against it and numbers are narrow, and walkers else.
        seed: Of the draws.
        rows: What to call each row of the log in messages.
        store: Folder in which a walk is kept, to be gone on with if it is cut short.
    """
    normal = solution.laplace
    if len(solution.identifiability.null):
        reason = "nothing else can be said of a log that leaves a direction untold"
        return _by_normal(solution, reason, seed)
    if method == "auto":
        weighted = importance(solution.posterior, normal, seed=seed)
        k_hat, off = weighted.k_hat, ends_off(weighted, normal)
        log_sd = largest_log_sd(solution.posterior, normal)
        said = (
            f"importance sampling k-hat {k_hat:.2f}, largest sd in ln {log_sd:.2g}, "
            f"ends of intervals off by {off:.2f} sd"
        )
        limits = f"the limits are {GOOD_SHAPE:g}, {NARROW:g} and {ENDS:g}"
        if laplace_holds(k_hat, log_sd, off):
            return _by_normal(solution, f"{said}: {limits}", seed)
        reason = f"the normal approximation does not do ({said}; {limits})"
    elif method == "laplace":
        return _by_normal(solution, "as asked for", seed, _doubts(solution, seed))
    else:
        reason = "as asked for"

    walk = ensemble(
        solution.posterior,
        normal,
        solution.identifiability,
        solution.optima,
        seed=seed,
        walkers=max(WALKERS, 4 * normal.z.size),
        rows=rows,
        store=store,
    )
    parameters = solution.posterior.parameters
    told = marginals_of_draws(parameters, walk.draws())
    best = parameters.values(jnp.asarray(normal.z))
    return HowSure(
        method="emcee",
        reason=reason,
        z=walk.draws(DRAWS),
        marginals={n: told[n] | {"value": float(best[n])} for n in parameters.names},
        converged=walk.converged,
        why=(reason, *walk.why) if method == "auto" else walk.why,
        ensemble=walk,
    )


def _doubts(solution: Solution, seed: int) -> tuple[str, ...]:
    """Say where the normal approximation's intervals are off, of an optimum."""
    if not solution.laplace.converged:
        return ()
    doubt = ends_judged(solution.posterior, solution.laplace, seed=seed).doubt()
    return (doubt,) if doubt else ()


def _by_normal(
    solution: Solution, reason: str, seed: int, why: tuple[str, ...] = ()
) -> HowSure:
    normal = solution.laplace
    return HowSure(
        method="laplace",
        reason=reason,
        z=normal.draws(DRAWS, np.random.default_rng(seed)),
        marginals=marginals(solution.posterior.parameters, normal),
        converged=normal.converged,
        why=why,
    )
