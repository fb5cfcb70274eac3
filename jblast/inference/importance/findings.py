"""What importance sampling shows of a normal approximation."""

from dataclasses import dataclass

from jblast.inference.posterior.finding import Finding


@dataclass(frozen=True)
class IntervalsOff(Finding):
    """The 90 % intervals are those of a normal approximation, and off or in doubt.

    Attributes:
        parameter: Of which number an end is surely off by most.
        off: By how many of its standard deviations; NaN if none surely is.
        k_hat: Shape of the weights' tail where importance sampling cannot tell; else
            NaN.
    """

    parameter: str
    off: float
    k_hat: float


@dataclass(frozen=True)
class ImportanceCannotTell(Finding):
    """The weights of importance sampling need not settle.

    Attributes:
        k_hat: Shape of their tail.
    """

    k_hat: float


@dataclass(frozen=True)
class FewEffectiveDraws(Finding):
    """Importance sampling is left with few draws.

    Attributes:
        effective: So many draws' worth.
        wanted: What intervals take.
    """

    effective: float
    wanted: int


@dataclass(frozen=True)
class NormalIntervals(Finding):
    """The 90 % intervals are those of a normal approximation, for want of draws.

    Attributes:
        because: What importance sampling was left with.
    """

    because: FewEffectiveDraws


@dataclass(frozen=True)
class RangeFollowed(Finding):
    """Intervals are of draws that follow the range of a charge beside a small array.

    Attributes:
        ranges: Ranges at which the posterior was integrated over all other numbers.
    """

    ranges: int


@dataclass(frozen=True)
class DrawsWeighted(Finding):
    """Draws of the normal approximation were weighted by the posterior.

    Attributes:
        k_hat: Shape of the weights' tail.
        effective: So many draws' worth.
    """

    k_hat: float
    effective: float


@dataclass(frozen=True)
class NormalJudged(Finding):
    """The normal approximation was judged, whether it does or walkers are needed.

    Attributes:
        holds: Whether it does.
        k_hat: Shape of the weights' tail.
        log_sd: Largest standard deviation of any ln.
        off: By how many standard deviations the worst end of an interval is off.
        most_k_hat: Limit of the first.
        most_log_sd: Of the second.
        most_off: Of the third.
    """

    holds: bool
    k_hat: float
    log_sd: float
    off: float
    most_k_hat: float
    most_log_sd: float
    most_off: float
