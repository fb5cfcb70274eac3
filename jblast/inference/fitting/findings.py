"""What a fit found fault with: readings, and whole sensors or clocks."""

from collections.abc import Mapping
from dataclasses import dataclass

from jblast.inference.posterior.estimate import Estimate


@dataclass(frozen=True)
class SuspectedOutlier:
    """A reading too far off for errors as stated.

    Attributes:
        sensor: Whose.
        quantity: Of what.
        sds: By how many standard deviations.
    """

    sensor: str
    quantity: str
    sds: float


@dataclass(frozen=True)
class WrongSensor:
    """A sensor without which a log fits.

    Attributes:
        name: Its name.
        chi2: Of the others.
        dof: Degrees of freedom of the others.
        p_value: Chance of a larger chi squared.
        law_valid_rows: Rows of the others within their laws.
        estimates: What the others say, by parameter.
    """

    name: str
    chi2: float
    dof: int
    p_value: float
    law_valid_rows: int
    estimates: Mapping[str, Estimate]


@dataclass(frozen=True)
class WrongClock(WrongSensor):
    """A clock without whose times a log fits; its other fields are a sensor's.

    Attributes:
        offset_s: By how much it is ahead [s].
        offset_sd: Standard deviation of that [s].
        parameter: The number that would be free; None for the common clock.
    """

    offset_s: float
    offset_sd: float
    parameter: str | None
