"""Goodness of fit: chi squared, suspected outliers, conflict of prior and data.

Residuals are standardised, and Student-t residuals enter chi squared as the normal
scores of their quantiles. The p-value is the probability of a larger chi squared if
errors are as stated. A poor fit may result from a prior: the same log is then fitted
with all numbers free, and numbers that the log alone identifies far from their prior
are named.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.special import betainc, gammaincc, ndtr, ndtri

from jblast.inference.answer import Answer
from jblast.inference.fitting.solution import Solution, solve
from jblast.inference.fitting.wrong import SuspectedOutlier
from jblast.observations import Observations
from jblast.scene import Free, parameter_named
from jblast.sensors.simulated_readings import STUDENT_FREEDOM, Noise

OUTLIER_SHARE = 0.05
"""Share of logs without wrong readings in which one is suspected by chance."""
POOR = 0.001
"""p-value below which a fit is poor: one in a thousand correct logs has a warning."""
FITS = 0.01
"""p-value above which log and scene agree. Between this and `POOR` explanations are
searched but the fit is not called poor."""
PRIOR_CONFLICT_SD = 3.0
"""Distance from the middle of its prior beyond which an estimate contradicts it [sd]:
chance alone gives 1 in 370."""


def chi_squared(answer: Answer, estimated: int) -> tuple[float, int]:
    """Return chi squared and its degrees of freedom.

    Student-t residuals count as the normal scores of their quantiles, so both kinds of
    errors have the same chi squared. Shared effects and numbers with a prior are data,
    expected at their means, and unknowns as well: they add to chi squared but not to
    the degrees of freedom. A lower bound that the law satisfies adds to neither.

    Args:
        answer: The log at its answer.
        estimated: Number of estimated parameters.
    """
    priors = answer.has_prior
    scores = normal_scores(answer.own, answer.density.noise)
    of_priors = np.sum((priors * answer.z) ** 2)
    chi2 = float(np.sum(scores**2) + answer.shared_chi2 + of_priors)
    kept = answer.rows.is_bound & (answer.own == 0)
    informative = len(answer.own) - int(kept.sum())
    return chi2, informative + int(priors.sum()) - estimated


def goodness(solution: Solution) -> tuple[float, int]:
    """Return chi squared of a solution and its degrees of freedom."""
    names, null = solution.identified.names, solution.identified.null
    return chi_squared(solution.answer, len(names) - len(null))


def tail_probability(residual: Float[np.ndarray, " row"], noise: Noise) -> np.ndarray:
    """Return the two-sided probability of an error at least as large."""
    square = np.square(np.asarray(residual, float))
    if noise == "gaussian":
        return 2 * ndtr(-np.sqrt(square))
    nu = STUDENT_FREEDOM
    # regularised incomplete beta function: exact in the far tail, where 1 - cdf is 0
    return betainc(nu / 2, 0.5, nu / (nu + square))


def normal_scores(residual: Float[np.ndarray, " row"], noise: Noise) -> np.ndarray:
    """Return the normal errors with the same two-sided probability."""
    return -ndtri(tail_probability(residual, noise) / 2)


def p_value(chi2: float, dof: int) -> float | None:
    """Return the probability of a larger chi squared; None without freedom."""
    return float(gammaincc(dof / 2, chi2 / 2)) if dof > 0 else None


def suspected_outliers(
    observations: Observations, residual: Float[np.ndarray, " row"], noise: Noise
) -> tuple[SuspectedOutlier, ...]:
    """Return the readings with residuals too large for stated errors, worst first.

    One in twenty logs without wrong readings has one named. If more than a third of all
    readings are outliers, the law or the scene is wrong and none is named.
    """
    # Bonferroni: the probability that any of the readings is as far off
    wild = tail_probability(residual, noise) * len(residual) < OUTLIER_SHARE
    # many outliers are a wrong law or scene, which no single sensor explains
    if wild.sum() > len(residual) / 3:
        return ()
    return tuple(
        SuspectedOutlier(
            sensor=observations.sensor[row],
            quantity=observations.quantity[row],
            sds=round(float(residual[row]), 2),
        )
        for row in np.argsort(-np.abs(residual))
        if wild[row]
    )


def against_priors(solution: Solution) -> dict[str, float]:
    """Return values at which a log fits well but which their priors exclude.

    The log is fitted with every number free. Only numbers that the log alone identifies
    are named.
    """
    density = solution.density
    beliefs = density.uncertain.beliefs
    believed = {n: b for n, b in beliefs.items() if not isinstance(b, Free)}
    if not believed:
        return {}
    scene = density.scene_at(solution.answer.values)
    free = {name: Free(positive=parameter_named(name).positive) for name in beliefs}
    named = replace(scene, law=tuple(density.laws.items()))
    alone = solve(
        density.observations,
        replace(density.uncertain, scene=named, beliefs=free),
        noise=density.noise,
    )
    p = p_value(*goodness(alone))
    # also poor without priors: they are not the cause
    if p is not None and p < POOR:
        return {}
    against = {}
    for name, value in zip(alone.identified.names, alone.answer.values, strict=True):
        if name in believed and alone.identified.estimates[name].identified:
            away = float(believed[name].unconstrain(value))
            if not abs(away) < PRIOR_CONFLICT_SD:
                against[name] = float(value)
    return against
