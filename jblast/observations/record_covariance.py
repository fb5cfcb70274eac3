"""How the errors of what was read off one pressure record go together."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jblast.errors import shown

SYMMETRIC = 1e-9
"""Entries on both sides of the diagonal agree to this share of the variances."""


@dataclass(frozen=True)
class RecordCovariance:
    """The covariance of the errors of one record's quantities.

    A record's noise moves its peak, duration and impulse together. Rows of a log whose
    `record` is this one's and whose quantity is here share these errors.

    Attributes:
        record: Name of the record, as in the log.
        quantities: What was read off it, keys of `QUANTITIES`.
        matrix: Covariance in error units: seconds (or radians) for `ADDITIVE`, else of
            ln, so relative.
    """

    record: str
    quantities: tuple[str, ...]
    matrix: Float[np.ndarray, "quantity quantity"]

    def __post_init__(self):
        count = len(self.quantities)
        where = f"the covariance of record {shown(self.record)}"
        if len(set(self.quantities)) < count:
            raise ValueError(f"{where}: expected each quantity once")
        if self.matrix.shape != (count, count):
            raise ValueError(
                f"{where}: expected shape ({count}, {count}), got {self.matrix.shape}"
            )
        if not np.isfinite(self.matrix).all() or (np.diag(self.matrix) <= 0).any():
            raise ValueError(
                f"{where}: expected finite numbers and positive variances, got "
                f"variances {np.diag(self.matrix)}"
            )
        skew = np.abs(self.correlation - self.correlation.T)
        if (skew > SYMMETRIC).any():
            raise ValueError(f"{where}: expected a symmetric matrix")
        if (least := self.own_share) <= 0:
            raise ValueError(
                f"{where}: expected it positive definite, got a correlation matrix "
                f"whose smallest eigenvalue is {least:.3g}"
            )

    @property
    def sd(self) -> Float[np.ndarray, " quantity"]:
        """Return the standard deviation of each error."""
        return np.sqrt(np.diag(self.matrix))

    @property
    def correlation(self) -> Float[np.ndarray, "quantity quantity"]:
        """Return the covariance of errors in standard deviations."""
        return self.matrix / self.sd[:, None] / self.sd[None, :]

    @property
    def own_share(self) -> float:
        """Return the share of each variance that no other quantity need share."""
        return float(np.linalg.eigvalsh(self.correlation)[0])

    def only(self, quantities: tuple[str, ...]) -> "RecordCovariance":
        """Return the covariance of some of the quantities, in the order given."""
        at = [self.quantities.index(quantity) for quantity in quantities]
        return RecordCovariance(self.record, quantities, self.matrix[np.ix_(at, at)])
