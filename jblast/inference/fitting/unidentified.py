"""What data cannot tell, in words: of a log that was fitted, or of one planned."""

import jax.numpy as jnp
import numpy as np

from jblast.inference.fitting.solution import Solution
from jblast.inference.identifiability.combinations import combination, space_of
from jblast.inference.identifiability.findings import (
    EstimableCombination,
    NullDirection,
    OtherMode,
)
from jblast.inference.identifiability.null_space import estimable_forms
from jblast.inference.identifiability.resolving_data import (
    cure_of_ambiguity,
    cure_of_null,
)
from jblast.inference.mode.laplace import laplace
from jblast.inference.mode.search import SEPARATE
from jblast.inference.posterior.fisher_information import information

NEAR = 6.0
"""Another optimum within this of the best, in -2 ln density, is an ambiguity."""


def null_directions(solution: Solution) -> tuple[NullDirection, ...]:
    """Name every direction along which no datum moves, and what would end it."""
    parameters = solution.posterior.parameters
    return tuple(
        NullDirection(
            parameters={
                name: float(weight)
                for name, weight in zip(parameters.names, direction, strict=True)
                if weight != 0
            },
            space=space_of(parameters.space(), direction),
            cure=cure_of_null(solution.posterior, solution.laplace.z, direction),
        )
        for direction in solution.identifiability.null
    )


def estimable_combinations(solution: Solution) -> tuple[EstimableCombination, ...]:
    """List the estimable combinations of parameters that are not identified singly."""
    parameters, normal = solution.posterior.parameters, solution.laplace
    answer = []
    for form in estimable_forms(solution.identifiability):
        text, is_product = combination(parameters.names, parameters.space(), form)
        value = float(form @ normal.z)
        sd = float(np.sqrt(form @ normal.covariance @ form))
        moved = solution.identifiability.followed @ form - value
        is_global = np.all(np.abs(moved) < max(sd, 1e-6 * abs(value)))
        if is_product:
            with np.errstate(over="ignore"):
                value = float(np.exp(value))
            sd = value * sd
        if not np.isfinite([value, sd]).all():
            continue
        answer.append(EstimableCombination(text, value, sd, not is_global))
    return tuple(answer)


def other_modes(solution: Solution, valid: bool) -> tuple[OtherMode, ...]:
    """Name every other optimum that the data cannot rule out.

    One that differs in numbers the data do not determine anyway is none, nor is one
    where a law does not hold, if the best lies where all do.
    """
    found, posterior = solution.optima, solution.posterior
    best = solution.laplace.z
    answers: list[np.ndarray] = [best]
    answer = []
    highest = float(found.log_density[0])
    for z, density in zip(*map(np.asarray, found), strict=True):
        if 2 * (highest - density) > NEAR:
            continue
        if min(_apart(solution, other, z) for other in answers) < SEPARATE:
            continue
        if valid and not np.asarray(posterior.misfit(jnp.asarray(z)).valid).all():
            continue
        if not laplace(
            posterior, z, solution.identifiability.identified_basis
        ).converged:
            continue
        answers.append(z)
        values = posterior.parameters.values(jnp.asarray(z))
        sds = np.sqrt(np.diag(solution.laplace.covariance))
        differ = [
            name
            for name, moved in zip(
                posterior.parameters.names, np.abs(z - best) > sds, strict=True
            )
            if moved
        ]
        answer.append(
            OtherMode(
                parameters={name: float(value) for name, value in values.items()},
                differ=tuple(differ),
                delta_chi2=2 * float(found.log_density[0] - density),
                cure=cure_of_ambiguity(posterior, best, z),
            )
        )
    return tuple(answer)


def _apart(solution: Solution, one, other) -> float:
    """Distance of two places in standard deviations of what is determined."""
    away = (one - other)[list(solution.identifiability.determined)]
    if len(solution.identifiability.null):
        kept = np.flatnonzero(solution.identifiability.determined)
        sds = np.sqrt(np.diag(solution.laplace.covariance))[kept]
        return float(np.max(np.abs(away) / sds, initial=0.0))
    metric = np.asarray(information(solution.posterior, jnp.asarray(one)))
    return float(np.sqrt(away @ metric @ away))
