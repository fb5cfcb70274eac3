"""How walks fail, and the normal approximation they stand in for, measured."""

from jblast.verification.stability.failure import FailureMode, measures
from jblast.verification.stability.inference.ridges import (
    bent_failure,
    endless_failure,
    null_failure,
)
from jblast.verification.stability.inference.two_modes import (
    found_failure,
    mirror_failure,
    weighed_failure,
)


@measures("walks")
def walks() -> list[FailureMode]:
    """Measure them all."""
    return [
        found_failure(),
        weighed_failure(),
        mirror_failure(),
        null_failure(),
        endless_failure(),
        bent_failure(),
    ]
