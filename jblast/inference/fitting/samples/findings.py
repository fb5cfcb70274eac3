"""What is to be told of a fit of samples."""

from dataclasses import dataclass

from jblast.inference.posterior.finding import Finding


@dataclass(frozen=True)
class SamplesRoughlyCounted(Finding):
    """The density of samples is known badly between the places it was computed at.

    Attributes:
        known: To how much in ln, root mean square.
        wanted: To how much it should be.
    """

    known: float
    wanted: float
