r"""Covariances from Fisher information: the Cramer-Rao bound and its parts.

The bound is $B (B^T F B)^{-1} B^T$, with $F$ the information of layout and priors (see
`fisher_information`) and $B$ a basis of the identified directions. It is local: where
$F$ vanishes by symmetry along an identified direction, the width is that of draws. The
same inverse with a number fixed, or without a prior, gives the sensitivity of a width.
"""

import math
from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.identify import Identified
from jblast.inference.posterior.fisher_information import (
    NULL,
    information,
    known_covariance,
    unit_diagonal,
)
from jblast.inference.posterior.parameters import Parameters, Spread
from jblast.inference.posterior.posterior import Posterior
from jblast.inference.posterior.starts import typical_step
from jblast.kept_programs import kept
from jblast.scene import parameter_named
from jblast.sensors import Layout
from jblast.sensors.simulated_readings import Noise


@kept
def information_of_layout(
    parameters: Parameters,
    layout: Layout,
    sigma: Float[Array, " row"],
    laws: Mapping[str, str],
    z: Float[Array, " free"],
    noise: Noise = "student",
) -> Float[Array, "free free"]:
    """Return the Fisher information of a layout and the priors; no data are needed.

    Args:
        parameters: The uncertain parameters.
        layout: Quantities and sensor positions, which may be batched.
        sigma: Instrument error of each row: seconds for times, relative otherwise.
        laws: Name of the law for each of `layout.quantities()`.
        z: Fitted coordinates.
        noise: Distribution of the independent errors.
    """
    names = tuple(sorted(laws.items()))
    # readings of zero: the information does not depend on them
    silent = Posterior(parameters, layout, jnp.zeros_like(sigma), sigma, names, noise)
    return information(silent, z)


def cramer_rao(
    known: Float[np.ndarray, "free free"],
    found: Identified,
) -> Float[np.ndarray, "free free"]:
    """Invert the information along the identified directions.

    Along a direction whose slopes vanish by symmetry alone (the height of a charge
    among sensors at its own height) the information is zero. There the width is that of
    the draws.

    Args:
        known: Information.
        found: What the planned log identifies.
    """
    size, values, vectors = unit_diagonal(known, found.answer.steps)
    covariance = np.zeros_like(known)
    for value, vector in zip(values, vectors.T, strict=True):
        axis = vector / size
        if value >= NULL:
            covariance += np.outer(axis, axis) / value
        elif not found.is_left_open(vector):
            along = vector * size
            covariance += np.outer(axis, axis) * (along @ found.covariance @ along)
    return covariance


def spreads(
    parameters: Parameters,
    z: Float[np.ndarray, " free"],
    covariance: Float[np.ndarray, "free free"],
) -> dict[str, Spread]:
    """Return the standard deviations of each number by a normal of its coordinates."""
    # 40 Gauss-Hermite nodes reach 11 sd: the standard deviation of a lognormal number
    # is exact to rounding up to an sd of 3 in ln
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    weights = weights / weights.sum()
    sds = np.sqrt(np.diag(covariance))
    at = parameters.values_of_each(jnp.asarray(z + nodes[:, None] * sds))
    found = {}
    for name in parameters.names:
        x, log_sd = np.asarray(at[name]), math.nan
        if parameter_named(name).positive:
            # a normal prior reaches below zero at the outer nodes
            some = x > 0
            log_sd = _sd(np.log(x[some]), weights[some] / weights[some].sum())
        found[name] = Spread(_sd(x, weights), log_sd)
    return found


def _sd(x, weights) -> float:
    with np.errstate(over="ignore", invalid="ignore"):  # e.g. a mass nothing bounds
        return float(np.sqrt(weights @ np.square(x - weights @ x)))


def spread_left(
    posterior: Posterior,
    z: Float[np.ndarray, " free"],
    matrix: Float[np.ndarray, "free free"],
    target: int,
    *,
    known: int | None = None,
    unbelieved: int | None = None,
) -> Spread:
    """Return the standard deviations of a number by given information.

    Args:
        posterior: Posterior with names and priors of the numbers.
        z: Fitted coordinates.
        matrix: Information, priors included.
        target: Index of the number.
        known: Index of another number that is fixed.
        unbelieved: Index of another number whose prior is omitted.
    """
    n = len(z)
    has_prior = np.array(posterior.parameters.has_prior())
    if unbelieved is not None:
        matrix = matrix - np.diag(has_prior * (np.arange(n) == unbelieved))
        has_prior[unbelieved] = 0.0
    kept = [i for i in range(n) if i != known]
    part, unknown = map(
        np.asarray,
        known_covariance(
            jnp.asarray(matrix[np.ix_(kept, kept)]),
            jnp.asarray(has_prior[kept]),
            typical_step(posterior)[np.array(kept)],
        ),
    )
    if unknown[kept.index(target)] or not np.isfinite(part).all():
        return Spread()
    covariance = np.zeros((n, n))
    covariance[np.ix_(kept, kept)] = part
    found = spreads(posterior.parameters, z, covariance)
    return found[posterior.parameters.names[target]]


def worst(posterior: Posterior, z: Float[np.ndarray, " free"]) -> int:
    """Return the index of the least certain mass; without one, of any number.

    Numbers are compared by their sd relative to a typical step.
    """
    names, scale = posterior.parameters.names, typical_step(posterior)
    known = information(posterior, jnp.asarray(z))
    found = known_covariance(known, posterior.parameters.has_prior(), scale)
    covariance, unknown = map(np.asarray, found)
    sd = np.sqrt(np.diag(covariance)) / np.asarray(scale)
    sd = np.where(unknown, np.inf, sd)
    masses = np.array([name.partition(".")[0] == "charge_mass_kg" for name in names])
    return int(np.argmax(np.where(masses | ~masses.any(), sd, -1.0)))
