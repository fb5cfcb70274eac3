"""The edges of walks, and of the normal approximation they stand in for, measured."""

from jblast.study.stability.edge import Edge, measures
from jblast.study.stability.ridges import bent_edge, endless_edge, null_edge
from jblast.study.stability.two_modes import found_edge, mirror_edge, weighed_edge


@measures("walks")
def walks() -> list[Edge]:
    """Measure them all."""
    return [
        found_edge(),
        weighed_edge(),
        mirror_edge(),
        null_edge(),
        endless_edge(),
        bent_edge(),
    ]
