"""How fits fail, measured."""

from jblast.verification.stability.failure import FailureMode, measures
from jblast.verification.stability.inference.outliers import outlier_failure
from jblast.verification.stability.inference.poor_starts import poor_start_failures
from jblast.verification.stability.inference.unidentifiable import (
    collinear_failure,
    null_direction_failure,
    one_place_failure,
)


@measures("fits")
def fits() -> list[FailureMode]:
    """Measure them all."""
    return [
        *poor_start_failures(),
        collinear_failure(),
        one_place_failure(),
        outlier_failure(),
        null_direction_failure(),
    ]
