r"""Covariances from Fisher information: the Cramer-Rao bound and its parts.

The bound is $B (B^T F B)^{-1} B^T$, with $F$ the information of layout and priors (see
`fisher_information`) and $B$ a basis of the identified directions. It is local: where
$F$ vanishes by symmetry along an identified direction, the width is measured on the
density instead. The same inverse with a number fixed, or without a prior, gives the
sensitivity of a width.
"""

from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.mode.laplace import FALLS, Laplace, half_width, marginals
from jblast.inference.mode.starts import typical_step
from jblast.inference.posterior.fisher_information import (
    NULL,
    information,
    known_covariance,
)
from jblast.inference.posterior.parameters import Parameters, Spread
from jblast.inference.posterior.posterior import Posterior
from jblast.kept_programs import kept
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
    posterior: Posterior,
    z: Float[np.ndarray, " free"],
    basis: Float[np.ndarray, "free basis"],
    known: Float[np.ndarray, "free free"],
) -> Laplace:
    """Invert the information along the identified directions.

    Along a direction whose slopes vanish by symmetry alone (the height of a charge
    among sensors at its own height) the information is zero. There the width is
    measured on the density.

    Args:
        posterior: Posterior of a log without errors.
        z: Fitted coordinates.
        basis: Basis of the identified directions, one column each.
        known: Information.
    """
    values, vectors = np.linalg.eigh(basis.T @ known @ basis)
    axes = basis @ vectors / np.sqrt(np.maximum(values, NULL))
    top = float(posterior.log_density(jnp.asarray(z)))
    for value, axis in zip(values, axes.T, strict=True):
        ends = [
            float(posterior.log_density(jnp.asarray(z + s * axis))) for s in (-1, 1)
        ]
        # measured only where the density contradicts the information: elsewhere the
        # bound is the inverse of the information by definition
        if value < NULL and not FALLS[0] < top - max(ends) < FALLS[1]:
            axis *= half_width(posterior, z, axis, top)
    return Laplace(z, axes @ axes.T, 0.0, True)


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
    marginal = marginals(posterior.parameters, Laplace(z, covariance, 0.0, True))
    return marginal[posterior.parameters.names[target]].spread


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
