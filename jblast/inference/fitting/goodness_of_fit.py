"""Goodness of fit: chi squared, suspected outliers, conflict of prior and data.

Residuals are standardised, and Student-t residuals enter chi squared as the normal
scores of their quantiles. The p-value is the probability of a larger chi squared if
errors are as stated. A poor fit may result from a prior: the same log is then fitted
with all numbers free, and numbers that the log alone identifies far from their prior
are named.
"""

from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float
from scipy.special import betainc, gammaincc, ndtr, ndtri

from jblast.inference.fitting.findings import SuspectedOutlier
from jblast.inference.fitting.solution import Solution
from jblast.inference.identifiability import identifiability
from jblast.inference.mode.search import optima
from jblast.inference.posterior.parameters import Parameters
from jblast.inference.posterior.posterior import Posterior
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


class ResidualSummary(NamedTuple):
    """Residuals and shared effects at the optimum.

    Attributes:
        effects: The expected shared effects.
        of_laws: The first of them, the scatter of laws; the others are errors of
            records.
        own: Residual of each row after all effects, in standard deviations of its own
            error. For a lower bound it is the smallest error that satisfies it: 0 where
            the law predicts more.
        shared: Sum of the effects of laws in each row.
        sd: Standard deviation of each row without these effects: sigma and the law's
            record scatter in quadrature.
        residual: Residual after the effects of laws, in `sd`; for a bound as in `own`.
    """

    effects: Float[np.ndarray, " effect"]
    of_laws: Float[np.ndarray, " law_effect"]
    own: Float[np.ndarray, " row"]
    shared: Float[np.ndarray, " row"]
    sd: Float[np.ndarray, " row"]
    residual: Float[np.ndarray, " row"]


def standardised_residuals(
    posterior: Posterior, z: Float[np.ndarray, " free"]
) -> ResidualSummary:
    """Return the standardised residuals of the log at a place."""
    misfit = posterior.misfit(jnp.asarray(z))
    effects = np.asarray(posterior.effects(jnp.asarray(z)))
    loading, missed = np.asarray(misfit.loading), np.asarray(misfit.residual)
    own = least_error((missed - loading @ effects) / np.asarray(misfit.sd), posterior)
    if posterior.shared_error is None:
        return ResidualSummary(
            effects, effects, own, loading @ effects, np.asarray(misfit.sd), own
        )
    of_laws = effects[: loading.shape[1] - posterior.shared_error.shape[1]]
    shared = loading[:, : of_laws.size] @ of_laws
    # for reports the errors that readings of one record share count as their own
    sd = np.hypot(misfit.sd, np.linalg.norm(posterior.shared_error, axis=1))
    residual = least_error((missed - shared) / sd, posterior)
    return ResidualSummary(effects, of_laws, own, shared, sd, residual)


def least_error(
    residual: Float[np.ndarray, " row"], posterior: Posterior
) -> Float[np.ndarray, " row"]:
    """Return residuals, with 0 for lower bounds that the prediction satisfies."""
    if posterior.lower_bound is None:
        return residual
    kept = np.asarray(posterior.lower_bound) & (residual < 0)
    return np.where(kept, 0.0, residual)


def chi_squared(
    posterior: Posterior,
    z: Float[np.ndarray, " free"],
    left: ResidualSummary,
    estimated: int,
) -> tuple[float, int]:
    """Return chi squared and its degrees of freedom.

    Student-t residuals count as the normal scores of their quantiles, so both kinds of
    errors have the same chi squared. Shared effects and numbers with a prior are data,
    expected at their means, and unknowns as well: they add to chi squared but not to
    the degrees of freedom. A lower bound that the law satisfies adds to neither.
    """
    priors = np.asarray(posterior.parameters.has_prior())
    scores = normal_scores(left.own, posterior.noise)
    # effects are standard normal: their squares are chi squared with as many degrees of
    # freedom as unknowns, which cancel
    shared = np.sum(left.effects**2)
    chi2 = float(np.sum(scores**2) + shared + np.sum((priors * z) ** 2))
    informative = len(left.own) - int(np.sum(bounds_kept(left.own, posterior)))
    return chi2, informative + int(priors.sum()) - estimated


def bounds_kept(
    residual: Float[np.ndarray, " row"], posterior: Posterior
) -> Bool[np.ndarray, " row"]:
    """Return True for lower bounds that the law satisfies."""
    if posterior.lower_bound is None:
        return np.zeros(len(residual), bool)
    return np.asarray(posterior.lower_bound) & (residual == 0)


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

    The search is repeated with every number free. Only numbers that the log alone
    identifies are named.
    """
    parameters = solution.posterior.parameters
    believed = [not isinstance(belief, Free) for belief in parameters.beliefs]
    if not any(believed):
        return {}
    # starting from the answer, so that the search begins with plausible values
    free = Parameters(
        parameters.names,
        tuple(
            Free(positive=parameter_named(name).positive) for name in parameters.names
        ),
        parameters.scene_at(jnp.asarray(solution.laplace.z)),
    )
    posterior = replace(solution.posterior, parameters=free)
    z = np.asarray(optima(jax.random.key(0), posterior).z[0])
    identified = identifiability(posterior, z)
    left = standardised_residuals(posterior, z)
    p = p_value(
        *chi_squared(
            posterior,
            z,
            left,
            identified.identified_basis.shape[1],
        )
    )
    # also poor without priors: they are not the cause
    if p is not None and p < POOR:
        return {}
    values = free.values(jnp.asarray(z))
    against = {}
    for name, belief, is_identified in zip(
        parameters.names, parameters.beliefs, identified.determined, strict=True
    ):
        away = float(belief.unconstrain(values[name]))
        if (
            is_identified
            and not isinstance(belief, Free)
            and not abs(away) < PRIOR_CONFLICT_SD
        ):
            against[name] = float(values[name])
    return against
