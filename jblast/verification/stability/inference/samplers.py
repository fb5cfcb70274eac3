"""The edges of walks, and of the normal approximation they stand in for, measured."""

from jblast.verification.stability.failure import Edge, measures
from jblast.verification.stability.inference.ridges import (
    bent_edge,
    endless_edge,
    null_edge,
)
from jblast.verification.stability.inference.two_modes import (
    found_edge,
    mirror_edge,
    weighed_edge,
)


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
