r"""Errors that the quantities of one record share, as effects and what is left.

The errors of what was read off one record have the covariance
$C = S R S$, $S$ the diagonal of the sigmas. With $\kappa$ the smallest eigenvalue of
the correlations $R$ it is $C = \kappa S^2 + S (R - \kappa I) S$: each row keeps an
error of its own of variance $\kappa \sigma^2$, and what is left, of one rank less, is
the sum of normal effects that the rows share. Of all ways to leave each row the same
share this leaves it the most, and a row alone keeps all.
"""

import numpy as np
from jaxtyping import Float

from jblast.observations import Observations
from jblast.observations.covariances import rows_with_covariance

ROUNDING = 1e-12
"""An eigenvalue of correlations no further above the smallest loads nothing."""


def own_and_shared_errors(
    observations: Observations,
) -> tuple[Float[np.ndarray, " row"], Float[np.ndarray, "row effect"]]:
    """Take the errors of instruments apart.

    Args:
        observations: A log; see `Observations.covariances`.

    Returns:
        The standard deviation of each row's own error (0 where the log gives none), and
        what one standard deviation of each shared error adds to each row; in seconds
        for times, else in ln.

    Raises:
        InputError: A sigma disagrees with its covariance, or a quantity of a record
            stands in two rows.
    """
    sigma = np.nan_to_num(observations.error_scale())
    own, columns = sigma.copy(), []
    for rows, covariance in rows_with_covariance(observations):
        values, vectors = np.linalg.eigh(covariance.correlation)
        if len(rows) < 2:
            continue
        own[rows] *= np.sqrt(values[0])
        for value, vector in zip(values[1:], vectors.T[1:], strict=True):
            if value - values[0] <= ROUNDING:
                continue
            column = np.zeros(len(sigma))
            column[rows] = sigma[rows] * np.sqrt(value - values[0]) * vector
            columns.append(column)
    return own, np.stack(columns, axis=1) if columns else np.zeros((len(sigma), 0))
