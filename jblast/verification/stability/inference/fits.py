"""The edges of fits, measured."""

from jblast.verification.stability.failure import Edge, measures
from jblast.verification.stability.inference.outliers import outlier_edge
from jblast.verification.stability.inference.poor_starts import poor_start_edges
from jblast.verification.stability.inference.unidentifiable import (
    collinear_edge,
    null_direction_edge,
    one_place_edge,
)


@measures("fits")
def fits() -> list[Edge]:
    """Measure them all."""
    return [
        *poor_start_edges(),
        collinear_edge(),
        one_place_edge(),
        outlier_edge(),
        null_direction_edge(),
    ]
