r"""Fisher information of a layout, without the values of its readings.

$F = J^T (\mathrm{diag}(s^2/k) + L L^T)^{-1} J$ with $J$ the slopes of the predictions,
plus one for each number that has a prior; $k$ is 1 for normal errors and 5/7 for
Student-t. The dependence of the size of the errors on the parameters also
carries information. It is left out: it is small, and no layout is planned for it.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.inference.noise import information_of_row
from jblast.inference.posterior.parameters import Parameters
from jblast.inference.posterior.posterior import Misfit, Posterior
from jblast.kept_programs import kept
from jblast.sensors import Layout
from jblast.sensors.simulated_readings import Noise

NULL = 1e-10
"""An eigenvalue of the unit-diagonal information below this is a null direction: a
standard deviation 100,000 times that of the numbers one by one. Rounding gives 1e-15.
Candidates are confirmed by draws (`identify`)."""
TAKES_PART = 1e-5
"""A smaller component of a null direction is rounding: the root of `NULL`."""


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
    silent = silent_posterior(parameters, layout, sigma, laws, noise)
    return information_with_each(silent, *linearised(silent, z), len(sigma))[0]


def silent_posterior(
    parameters: Parameters,
    layout: Layout,
    sigma: Float[Array, " row"],
    laws: Mapping[str, str],
    noise: Noise,
) -> Posterior:
    """Return a posterior with readings of zero: information does not depend on them."""
    names = tuple(sorted(laws.items()))
    return Posterior(parameters, layout, jnp.zeros_like(sigma), sigma, names, noise)


@kept
def linearised(
    posterior: Posterior, z: Float[Array, " free"]
) -> tuple[Misfit, Float[Array, "row free"]]:
    """Return the misfit of the data, and the slopes of the predictions."""
    slopes = -jax.jacfwd(lambda z: posterior.misfit(z).residual)(z)
    return posterior.misfit(z), slopes


def information_with_each(
    posterior: Posterior, misfit: Misfit, slopes: Any, first: int
) -> Any:
    r"""Return the information of the first rows, then that with each further row added.

    Shared effects are unknowns with an expected value of zero. Projecting them out of
    the rows $X/s$ leaves $w$ with $w^T w = X^T C^{-1} X$, $C = \mathrm{diag}(s^2) + L
    L^T$, without a matrix of rows by rows. A further row adds what its slopes differ
    from those expected by the effects, over its variance given the first rows.

    Args:
        posterior: Posterior with priors and noise.
        misfit: Misfit of all rows.
        slopes: Slopes of their predictions.
        first: Number of the first rows.
    """
    xp = np if isinstance(slopes, np.ndarray) else jnp
    sd = misfit.sd / math.sqrt(information_of_row(posterior.noise))
    rows, shared = slopes / sd[:, None], misfit.loading / sd[:, None]
    count, free = shared.shape[1], slopes.shape[1]
    # The unit rows below the loadings are the standard normal priors of the effects, so
    # the columns are independent and QR never meets a singular matrix.
    basis, root = xp.linalg.qr(xp.concatenate([shared[:first], xp.eye(count)]))
    data = xp.concatenate([rows[:first], xp.zeros((count, free))])
    along = basis.T @ data
    left = data - basis @ along
    priors = xp.diag(xp.asarray(posterior.parameters.has_prior()))
    known = (left.T @ left + priors)[None]
    effect = xp.linalg.solve(root.T, shared[first:].T)
    new = rows[first:] - effect.T @ along
    gained = new[:, :, None] * new[:, None] / (1 + (effect**2).sum(0))[:, None, None]
    return xp.concatenate([known, known + gained])


def unit_diagonal(matrix: np.ndarray, scale: np.ndarray) -> tuple[Any, Any, Any]:
    """Return the eigendecomposition of information scaled to a unit diagonal.

    Args:
        matrix: Information; may be batched.
        scale: Typical step of each coordinate. A coordinate whose typical step changes
            no datum by a standard deviation is scaled by that step: without any
            information its eigenvalue is then 0, not 1.

    Returns:
        The size of each coordinate, the eigenvalues, and the eigenvectors as columns.
    """
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    size = np.sqrt(np.maximum(diagonal, 1 / np.square(scale)))
    values, vectors = np.linalg.eigh(matrix / size[..., :, None] / size[..., None, :])
    return size, values, vectors


class Inverse(NamedTuple):
    """Inverse of information that may have null directions; may be batched.

    Attributes:
        covariance: Covariance of the coordinates, without null directions; NaN for
            information that is not finite.
        null: Null directions as columns, in units of `size`; other columns are 0.
        size: Size of each coordinate.
    """

    covariance: Float[np.ndarray, "*batch free free"]
    null: Float[np.ndarray, "*batch free free"]
    size: Float[np.ndarray, "*batch free"]

    @property
    def is_open(self) -> Bool[np.ndarray, "*batch free"]:
        """True for coordinates without a variance."""
        variance = np.diagonal(self.covariance, axis1=-2, axis2=-1)
        part_of_null = (np.abs(self.null) > TAKES_PART).any(axis=-1)
        return part_of_null | ~np.isfinite(variance)


def inverted(
    known: Float[np.ndarray, "*batch free free"],
    has_prior: Float[np.ndarray, "*#batch free"],
    scale: Float[np.ndarray, " free"],
) -> Inverse:
    """Return the inverse of information outside of its null directions.

    Args:
        known: Information of data and priors.
        has_prior: 1 for numbers with a prior. Their prior counts at least as much as
            the data when null directions are judged, so a weak prior identifies them.
        scale: Typical step of each coordinate, see `unit_diagonal`.
    """
    finite = np.isfinite(known).all(axis=(-2, -1), keepdims=True)
    known, eye = np.where(finite, known, 0.0), np.eye(known.shape[-1])
    size, values, vectors = unit_diagonal(
        known * (1 + eye * has_prior[..., None]), scale
    )
    is_null = (values < NULL)[..., None, :]
    basis = np.where(is_null, 0.0, vectors / size[..., None])
    across = np.swapaxes(basis, -2, -1)
    # null columns are zero: a unit diagonal there, so that the inverse exists
    inner = np.linalg.inv(across @ known @ basis + eye * is_null)
    return Inverse(
        np.where(finite, basis @ inner @ across, np.nan),
        np.where(finite & is_null, vectors, 0.0),
        size,
    )
