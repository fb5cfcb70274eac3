"""Readings, sensors and clocks that a fit calls wrong."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from jblast.inference.posterior.parameters import Estimate

Kind = Literal["clock", "sensor", "exchange"]


@dataclass(frozen=True)
class SuspectedOutlier:
    """A reading with a residual too large for the stated errors.

    Attributes:
        sensor: Name of the sensor.
        quantity: Quantity of the reading.
        sds: Residual in standard deviations.
    """

    sensor: str
    quantity: str
    sds: float


@dataclass(frozen=True)
class WrongSensor:
    """A sensor without which a log fits.

    Attributes:
        kind: Kind of the explanation.
        name: Name of the sensor.
        chi2: Chi squared of the other rows.
        dof: Degrees of freedom of the other rows.
        p_value: Chance of a larger chi squared.
        law_valid_rows: Number of other rows within their laws.
        estimates: Estimates from the other rows, by parameter.
    """

    kind: Kind = field(default="sensor", init=False)
    name: str
    chi2: float
    dof: int
    p_value: float
    law_valid_rows: int
    estimates: Mapping[str, Estimate]


@dataclass(frozen=True)
class WrongClock(WrongSensor):
    """A clock without whose times a log fits; further fields as in `WrongSensor`.

    Attributes:
        offset_s: Estimated offset, positive if it is ahead [s].
        offset_sd: Standard deviation of the offset [s].
        parameter: Parameter to free; None for the common clock.
    """

    kind: Kind = field(default="clock", init=False)
    offset_s: float
    offset_sd: float
    parameter: str | None


@dataclass(frozen=True)
class ExchangedSensors(WrongSensor):
    """Two sensors with whose positions exchanged the whole log fits.

    Attributes:
        other: Name of the second sensor.
    """

    kind: Kind = field(default="exchange", init=False)
    other: str
