"""What is known of one number: its most probable value, its sd, its 90 % interval."""

import math
from dataclasses import dataclass


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
    """What is known of one number, in its unit; all NaN where it is not identified.

    Attributes:
        value: The most probable.
        sd: Standard deviation.
        log_sd: Standard deviation of its ln; NaN for one that may be negative.
        q05: 5 % quantile: where the 90 % interval begins.
        q50: Median.
        q95: 95 % quantile: where the 90 % interval ends.
    """

    value: float = math.nan
    sd: float = math.nan
    log_sd: float = math.nan
    q05: float = math.nan
    q50: float = math.nan
    q95: float = math.nan

    @property
    def is_identified(self) -> bool:
        """Whether there is a value."""
        return math.isfinite(self.value)

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
