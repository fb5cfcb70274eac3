r"""Fisher information of a layout, without the values of its readings.

$F = J^T (\mathrm{diag}(s^2/k) + L L^T)^{-1} J$ with $J$ the slopes of the predictions,
plus one for each number that has a prior; $k$ is 1 for normal errors and 5/7 for
Student-t. The dependence of the size of the errors on the parameters also
carries information. It is left out: it is small, and no layout is planned for it.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.inference.noise import information_of_row
from jblast.inference.posterior.posterior import Misfit, Posterior
from jblast.kept_programs import kept

NULL = 1e-10
"""An eigenvalue of the unit-diagonal information below this is a null direction: a
standard deviation 100,000 times that of the numbers one by one. Rounding gives 1e-15.
Candidates are confirmed by a finite step (`identifiability`)."""
TAKES_PART = 1e-5
"""A smaller component of a null direction is rounding: the root of `NULL`."""


def whitened_rows(
    posterior: Posterior, misfit: Misfit, columns: Float[Array, "row column"]
) -> Float[Array, "datum column"]:
    r"""Return columns in standard deviations, with the shared effects projected out.

    Shared effects are unknowns with an expected value of zero. Projecting them out of
    the rows $X/s$ leaves $w$ with $w^T w = X^T C^{-1} X$, $C = \mathrm{diag}(s^2) + L
    L^T$, without a matrix of rows by rows.
    """
    sd = misfit.sd / math.sqrt(information_of_row(posterior.noise))
    rows = columns / sd[:, None]
    count = misfit.loading.shape[1]
    if count == 0:
        return rows
    data = jnp.concatenate([rows, jnp.zeros((count, columns.shape[1]))])
    shared = jnp.concatenate([misfit.loading / sd[:, None], jnp.eye(count)])
    # The unit rows below the loadings are the standard normal priors of the effects, so
    # the columns are independent and QR never meets a singular matrix.
    basis, _ = jnp.linalg.qr(shared)
    return data - basis @ (basis.T @ data)


def whitened_jacobian(
    posterior: Posterior, z: Float[Array, " free"]
) -> Float[Array, "datum free"]:
    """Return the sensitivity of the data in standard deviations.

    The rows of the log come first (see `whitened_rows`), then one row for each
    parameter: 1 if it has a prior, else 0.
    """
    jacobian = -jax.jacfwd(lambda z: posterior.misfit(z).residual)(z)
    rows = whitened_rows(posterior, posterior.misfit(z), jacobian)
    return jnp.concatenate([rows, jnp.diag(posterior.parameters.has_prior())])


@kept
def information(
    posterior: Posterior, z: Float[Array, " free"]
) -> Float[Array, "free free"]:
    """Return the Fisher information of the data and the priors."""
    jacobian = whitened_jacobian(posterior, z)
    return jacobian.T @ jacobian


def unit_diagonal(matrix: Any, scale: Any) -> tuple[Any, Any, Any]:
    """Return the eigendecomposition of information scaled to a unit diagonal.

    Args:
        matrix: Information.
        scale: Typical step of each coordinate. A coordinate whose typical step changes
            no datum by a standard deviation is scaled by that step: without any
            information its eigenvalue is then 0, not 1.

    Returns:
        The size of each coordinate, the eigenvalues, and the eigenvectors as columns.
    """
    xp = np if isinstance(matrix, np.ndarray) else jnp
    size = xp.sqrt(xp.maximum(xp.diagonal(matrix), 1 / xp.square(scale)))
    values, vectors = xp.linalg.eigh(matrix / size[:, None] / size[None, :])
    return size, values, vectors


@jax.jit
def known_covariance(
    matrix: Float[Array, "free free"],
    has_prior: Float[Array, " free"],
    scale: Float[Array, " free"],
) -> tuple[Float[Array, "free free"], Bool[Array, " free"]]:
    """Return the inverse of information, and the numbers that are not identified.

    Null directions are judged locally, not by finite steps as in `identifiability`, so
    the function may be batched.

    Args:
        matrix: Information.
        has_prior: 1 for numbers with a prior. Their prior counts at least as much as
            the data when null directions are judged, so a weak prior identifies them.
        scale: Typical step of each coordinate, see `unit_diagonal`.

    Returns:
        The covariance without null directions, and a flag for each coordinate with a
        component in one.
    """
    judged = matrix + jnp.diag(has_prior * jnp.diagonal(matrix))
    size, values, vectors = unit_diagonal(judged, scale)
    is_null = values < NULL
    basis = jnp.where(is_null[None, :], 0.0, vectors / size[:, None])
    # batched code cannot select columns: null ones become zero, with a unit diagonal so
    # that the inverse exists
    informed = basis.T @ matrix @ basis + jnp.diag(jnp.where(is_null, 1.0, 0.0))
    part = jnp.where(is_null[None, :], jnp.abs(vectors), 0.0)
    unknown = jnp.any(part > TAKES_PART, axis=1)
    return basis @ jnp.linalg.inv(informed) @ basis.T, unknown
