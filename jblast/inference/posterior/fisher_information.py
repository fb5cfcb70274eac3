r"""Fisher information of a layout, without the values of its readings.

$F = J^T (\mathrm{diag}(s^2/k) + L L^T)^{-1} J$ with $J$ the slopes of the predictions,
plus one for each number that has a prior; $k$ is 1 for normal errors and 5/7 for
Student-t. For a lower bound it is the information of the answer, yes or no, whether a
reading passes it. The dependence of the size of the errors on the parameters also
carries information. It is left out: it is small, and no layout is planned for it.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.inference.posterior.likelihood import (
    information_of_row,
    survival_information,
)
from jblast.inference.posterior.posterior import Misfit, Posterior
from jblast.kept_programs import kept

NULL = 1e-10
"""An eigenvalue of the unit-diagonal information below this is a null direction."""
TAKES_PART = 1e-5
"""A smaller part of a null direction, in standard deviations, is rounding."""


def whitened_rows(
    posterior: Posterior, misfit: Misfit, columns: Float[Array, "row column"]
) -> Float[Array, "datum column"]:
    r"""Measure columns in standard deviations, what shared effects hide left out.

    Shared effects are unknowns that were expected at zero. Projecting them out of the
    rows $X/s$ leaves $w$ with $w^T w = X^T C^{-1} X$, $C = \mathrm{diag}(s^2) + L L^T$,
    without a matrix of rows by rows.
    """
    sd = misfit.sd / jnp.sqrt(information_of_rows(posterior, misfit))
    rows = columns / sd[:, None]
    count = misfit.loading.shape[1]
    if count == 0:
        return rows
    data = jnp.concatenate([rows, jnp.zeros((count, columns.shape[1]))])
    shared = jnp.concatenate([misfit.loading / sd[:, None], jnp.eye(count)])
    basis, _ = jnp.linalg.qr(shared)
    return data - basis @ (basis.T @ data)


def whitened_jacobian(
    posterior: Posterior, z: Float[Array, " free"]
) -> Float[Array, "datum free"]:
    """Return the sensitivity of the data in standard deviations.

    The rows of the log come first (see `whitened_rows`); then one row for each
    parameter, which counts where it has a prior.
    """
    jacobian = -jax.jacfwd(lambda z: posterior.misfit(z).residual)(z)
    rows = whitened_rows(posterior, posterior.misfit(z), jacobian)
    return jnp.concatenate([rows, jnp.diag(posterior.parameters.has_prior())])


def information_of_rows(
    posterior: Posterior, misfit: Misfit
) -> float | Float[Array, " row"]:
    """Return the information of each row's own error about its mean.

    One number where all rows are alike: where no reading is a lower bound.
    """
    of_reading = information_of_row(posterior.noise)
    if posterior.lower_bound is None:
        return of_reading
    _, effects = posterior.likelihood(misfit)
    u = (misfit.residual - misfit.loading @ effects) / misfit.sd
    of_bound = survival_information(u, posterior.noise)
    return jnp.where(posterior.lower_bound, of_bound, of_reading)


@kept
def information(
    posterior: Posterior, z: Float[Array, " free"]
) -> Float[Array, "free free"]:
    """Return the Fisher information of the data and the priors."""
    jacobian = whitened_jacobian(posterior, z)
    return jacobian.T @ jacobian


@kept
def by_kernel(
    posterior: Posterior, z: Float[Array, " free"]
) -> tuple[
    Float[Array, " kernel"],
    Float[Array, "kernel free"],
    Float[Array, "kernel free free"],
]:
    """Return ln of the density by each correlation function, slopes and information."""
    density = posterior.log_densities(z)
    slope = jax.jacfwd(posterior.log_densities)(z)
    if len(density) == 1:
        return density, slope, information(posterior, z)[None]
    known = jax.vmap(
        lambda weights: information(replace(posterior, kernels=weights), z)
    )
    return density, slope, known(jnp.eye(len(density)))


@jax.jit
def unit_diagonal(
    matrix: Float[Array, "free free"], scale: Float[Array, " free"]
) -> tuple[Float[Array, " free"], Float[Array, " free"], Float[Array, "free free"]]:
    """Scale information to a unit diagonal and take it apart.

    Args:
        matrix: Information.
        scale: A typical step of each coordinate. One of which a typical step moves no
            datum by a standard deviation is scaled by that step instead, so that
            nothing known of it gives an eigenvalue of zero and not of one.

    Returns:
        The size of each coordinate, the eigenvalues, and the eigenvectors as columns.
    """
    size = jnp.sqrt(jnp.maximum(jnp.diagonal(matrix), 1 / jnp.square(scale)))
    values, vectors = jnp.linalg.eigh(matrix / size[:, None] / size[None, :])
    return size, values, vectors


@jax.jit
def known_covariance(
    matrix: Float[Array, "free free"],
    has_prior: Float[Array, " free"],
    scale: Float[Array, " free"],
) -> tuple[Float[Array, "free free"], Bool[Array, " free"]]:
    """Return the covariance by information, and which numbers are not identified.

    Null directions are judged at the place alone, without following them (as
    `identifiability` does), so that this may be batched.

    Args:
        matrix: Information.
        has_prior: 1 where a number has a prior; its information counts as no less
            than the data's, so that a weak one is not taken for nothing.
        scale: A typical step of each coordinate, see `unit_diagonal`.

    Returns:
        The covariance without null directions, and whether each coordinate takes part
        in one.
    """
    judged = matrix + jnp.diag(has_prior * jnp.diagonal(matrix))
    size, values, vectors = unit_diagonal(judged, scale)
    is_null = values < NULL
    basis = jnp.where(is_null[None, :], 0.0, vectors / size[:, None])
    informed = basis.T @ matrix @ basis + jnp.diag(jnp.where(is_null, 1.0, 0.0))
    part = jnp.where(is_null[None, :], jnp.abs(vectors), 0.0)
    unknown = jnp.any(part > TAKES_PART, axis=1)
    return basis @ jnp.linalg.inv(informed) @ basis.T, unknown
