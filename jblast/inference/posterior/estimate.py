"""What is known of one number: its most probable value, its sd, its 90 % interval."""

import math
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Spread:
    """How far a number may be off; NaN where nothing is known of it.

    Attributes:
        sd: Standard deviation, in the number's unit.
        log_sd: Standard deviation of its ln; NaN for one that may be negative.
    """

    sd: float = math.nan
    log_sd: float = math.nan

    @property
    def is_known(self) -> bool:
        """Whether anything is known of it."""
        return not (math.isnan(self.sd) and math.isnan(self.log_sd))

    @property
    def width(self) -> float:
        """The sd in ln, or without one the sd; infinite where nothing is known."""
        if not math.isnan(self.log_sd):
            return self.log_sd
        return math.inf if math.isnan(self.sd) else self.sd


@dataclass(frozen=True)
class Estimate:
    """Estimate of one number, in its unit.

    A number that is not identified has no value and no standard deviation; the ends of
    its 90 % interval are finite where they are known all the same.

    Attributes:
        value: The most probable value; NaN where it is not identified.
        sd: Standard deviation.
        log_sd: Standard deviation of its ln; NaN for one that may be negative.
        q05: 5 % quantile: lower end of the 90 % interval.
        q50: Median.
        q95: 95 % quantile: upper end of the 90 % interval.
        identified: Whether there is a value.
    """

    value: float = math.nan
    sd: float = math.nan
    log_sd: float = math.nan
    q05: float = math.nan
    q50: float = math.nan
    q95: float = math.nan
    identified: bool = field(init=False)

    def __post_init__(self) -> None:
        """Set `identified` from the value."""
        object.__setattr__(self, "identified", math.isfinite(self.value))

    def interval_alone(self) -> "Estimate":
        """Return the 90 % interval without a value: an unidentified number."""
        return Estimate(q05=self.q05, q95=self.q95)

    @property
    def spread(self) -> Spread:
        """Its standard deviations alone."""
        return Spread(self.sd, self.log_sd)

    def times(self, factor: float) -> "Estimate":
        """Return what is known of so many times the number; its sd in ln stays."""
        return Estimate(
            self.value * factor,
            self.sd * factor,
            self.log_sd,
            self.q05 * factor,
            self.q50 * factor,
            self.q95 * factor,
        )
