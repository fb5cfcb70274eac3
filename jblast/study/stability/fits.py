"""The edges of fits, measured."""

from jblast.study.stability.edge import Edge, measures
from jblast.study.stability.outliers import outlier_edge
from jblast.study.stability.poor_starts import poor_start_edges
from jblast.study.stability.untold import (
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
