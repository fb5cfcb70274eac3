"""How sure the answer is: by the normal approximation, or by walkers where it fails."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.fitting.solution import Solution
from jblast.inference.importance.interval_check import ends_judged
from jblast.inference.importance.marginals import marginals_of_draws
from jblast.inference.importance.psis import (
    ENDS,
    GOOD_SHAPE,
    NARROW,
    ends_off,
    importance,
    laplace_holds,
    largest_log_sd,
)
from jblast.inference.mcmc.ensemble import Ensemble, ensemble
from jblast.inference.mcmc.run import WALKERS
from jblast.inference.mode.laplace import marginals
from jblast.inference.posterior.estimate import Estimate

Method = Literal["weighted", "laplace", "emcee", "auto"]
DRAWS = 8000
AS_ASKED = "as asked for"
"""Why a method was used that was named."""
FEW = 100
"""So many effective draws an interval takes at least."""


@dataclass(frozen=True)
class HowSure:
    """What is known of every number, and by which method.

    Attributes:
        method: "laplace" or "emcee".
        weighted: Whether the normal approximation's draws were weighted by the
            posterior.
        reason: Why that one.
        z: Draws of the coordinates.
        marginals: What is known of each number, its value the most probable.
        converged: Whether the method reached what it should.
        why: Sentences about what draws showed: modes, a ridge, intervals that are off.
        ensemble: The walk, where there was one.
    """

    method: str
    reason: str
    z: Float[np.ndarray, "draw free"]
    marginals: dict[str, Estimate]
    converged: bool
    why: tuple[str, ...] = ()
    ensemble: Ensemble | None = None
    weighted: bool = False


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
            its intervals are off; "weighted" moves them to where importance sampling
            finds the posterior's, wherever it can tell. "auto" takes the normal
            approximation where importance sampling finds nothing against it and
            numbers are narrow, and walkers else.
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
    elif method == "weighted":
        return _weighted(solution, seed)
    elif method == "laplace":
        return _by_normal(solution, AS_ASKED, seed, _doubts(solution, seed))
    else:
        reason = AS_ASKED

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
        marginals={n: replace(told[n], value=float(best[n])) for n in told},
        converged=walk.converged,
        why=(reason, *walk.why) if method == "auto" else walk.why,
        ensemble=walk,
    )


def _weighted(solution: Solution, seed: int) -> HowSure:
    """Weight draws of the normal approximation; without them where they cannot tell."""
    normal, parameters = solution.laplace, solution.posterior.parameters
    if not normal.converged:
        return _by_normal(solution, "the search did not arrive at an optimum", seed)
    found = ends_judged(solution.posterior, normal, seed=seed)
    drawn = found.drawn
    effective = 0.0 if drawn is None else found.share * len(drawn.z)
    if drawn is None or not found.believed or effective < FEW:
        reason = f"importance sampling cannot tell (k-hat {found.k_hat:.2f})"
        doubt = found.doubt()
        if drawn is not None and found.believed:
            left = f"{effective:.0f} draws' worth, of {FEW} that intervals take"
            reason = f"importance sampling is left with {left}"
            doubt = doubt or (
                "the 90 % intervals are those of a normal approximation, as "
                f"{reason}: --posterior emcee walks"
            )
        return _by_normal(solution, reason, seed, (doubt,) if doubt else ())
    told = marginals_of_draws(parameters, drawn.z, drawn.weights, drawn.quantiles)
    alone = marginals_of_draws(parameters, drawn.straight, drawn.of_normal)
    exact = marginals(parameters, normal)
    for name, number in told.items():  # what chance did to both, it did to one alike
        one, other = alone[name], exact[name]
        told[name] = replace(
            number,
            sd=_less_chance(number.sd, one.sd, other.sd),
            log_sd=_less_chance(number.log_sd, one.log_sd, other.log_sd),
        )
    best = parameters.values(jnp.asarray(normal.z))
    picked = np.random.default_rng(seed).choice(len(drawn.z), DRAWS, p=drawn.weights)
    return HowSure(
        method="laplace",
        reason="draws of the normal approximation, weighted by the posterior "
        f"(importance sampling, k-hat {found.k_hat:.2f}, {effective:.0f} draws' worth)",
        z=drawn.z[picked],
        marginals={n: replace(told[n], value=float(best[n])) for n in told},
        converged=True,
        weighted=True,
    )


def _less_chance(sd: float, by_draws: float, exact: float) -> float:
    """Return an sd of draws, less what chance did to one that is known exactly."""
    known = by_draws and exact and np.isfinite([by_draws, exact]).all()
    return sd * exact / by_draws if known else sd


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
