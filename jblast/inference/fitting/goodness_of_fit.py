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

WILD = 0.05
"""Readings are suspected that so small a share of honest logs would hold."""
POOR = 0.001
"""A fit with a smaller chance than this is called poor."""
FITS = 0.01
"""With no smaller chance than this a log and a scene agree."""
PRIOR_CONFLICT_SD = 3.0
"""Distance from the prior's middle beyond which an estimate contradicts its prior
[sd].
"""


class ResidualSummary(NamedTuple):
    """Residuals and shared effects at the optimum.

    Attributes:
        effects: The most probable shared effects.
        of_laws: The first of them, which are laws'; the others are errors of records.
        own: What all of them leave of each row, in standard deviations of its own
            error; of a lower bound the least error that keeps it: 0 where the law says
            more.
        shared: What the effects of laws add to each row.
        sd: Standard deviation of each row without them: sigma and the law's record
            scatter in quadrature.
        residual: What they leave of each row, in these; of a bound as in `own`.
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
    """Return what the scene at a place leaves of its log."""
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
    sd = np.hypot(misfit.sd, np.linalg.norm(posterior.shared_error, axis=1))
    residual = least_error((missed - shared) / sd, posterior)
    return ResidualSummary(effects, of_laws, own, shared, sd, residual)


def least_error(
    residual: Float[np.ndarray, " row"], posterior: Posterior
) -> Float[np.ndarray, " row"]:
    """Return residuals, those of lower bounds 0 where the prediction keeps them."""
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

    Student-t residuals count as the normal scores of their quantiles, so that honest
    errors of either kind give the same chi squared. Shared effects and numbers with a
    prior count as data that were expected at their means, and as unknowns; so they add
    to chi squared and leave the freedom alone. A lower bound that the law keeps adds to
    neither.
    """
    priors = np.asarray(posterior.parameters.has_prior())
    scores = normal_scores(left.own, posterior.noise)
    shared = np.sum(left.effects**2)
    chi2 = float(np.sum(scores**2) + shared + np.sum((priors * z) ** 2))
    heard = len(left.own) - int(np.sum(bounds_kept(left.own, posterior)))
    return chi2, heard + int(priors.sum()) - estimated


def bounds_kept(
    residual: Float[np.ndarray, " row"], posterior: Posterior
) -> Bool[np.ndarray, " row"]:
    """Return the rows that are lower bounds which the law keeps."""
    if posterior.lower_bound is None:
        return np.zeros(len(residual), bool)
    return np.asarray(posterior.lower_bound) & (residual == 0)


def tail_probability(residual: Float[np.ndarray, " row"], noise: Noise) -> np.ndarray:
    """Return the chance of an error at least so far from zero, on either side."""
    square = np.square(np.asarray(residual, float))
    if noise == "gaussian":
        return 2 * ndtr(-np.sqrt(square))
    nu = STUDENT_FREEDOM
    return betainc(nu / 2, 0.5, nu / (nu + square))


def normal_scores(residual: Float[np.ndarray, " row"], noise: Noise) -> np.ndarray:
    """Return the sizes of normal errors as rare as these."""
    return -ndtri(tail_probability(residual, noise) / 2)


def p_value(chi2: float, dof: int) -> float | None:
    """Return the chance of a larger chi squared; None without degrees of freedom."""
    return float(gammaincc(dof / 2, chi2 / 2)) if dof > 0 else None


def suspected_outliers(
    observations: Observations, residual: Float[np.ndarray, " row"], noise: Noise
) -> tuple[SuspectedOutlier, ...]:
    """Name the readings too far off for errors as stated, worst first.

    One log in twenty without a wild reading has one named. Where more than a third of
    all readings are so far off, it is the law or the scene that is wrong, and none is.
    """
    wild = tail_probability(residual, noise) * len(residual) < WILD
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
    """Return numbers by which a log fits well, but which their priors rule out.

    The search is made once more with every number free. Those are named that the log
    alone identifies.
    """
    parameters = solution.posterior.parameters
    believed = [not isinstance(belief, Free) for belief in parameters.beliefs]
    if not any(believed):
        return {}
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
    if p is not None and p < POOR:
        return {}
    values = free.values(jnp.asarray(z))
    against = {}
    for name, belief, is_told in zip(
        parameters.names, parameters.beliefs, identified.determined, strict=True
    ):
        away = float(belief.unconstrain(values[name]))
        if (
            is_told
            and not isinstance(belief, Free)
            and not abs(away) < PRIOR_CONFLICT_SD
        ):
            against[name] = float(values[name])
    return against
