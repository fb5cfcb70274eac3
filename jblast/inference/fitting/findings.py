"""Findings of a fit about readings, sensors, clocks, laws, priors and itself."""

from collections.abc import Mapping
from dataclasses import dataclass

from jblast.inference.posterior.parameters import Estimate, Finding


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
class WrongSensor(Finding):
    """A sensor without which a log fits.

    Attributes:
        name: Name of the sensor.
        chi2: Chi squared of the other rows.
        dof: Degrees of freedom of the other rows.
        p_value: Chance of a larger chi squared.
        law_valid_rows: Number of other rows within their laws.
        estimates: Estimates from the other rows, by parameter.
    """

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

    offset_s: float
    offset_sd: float
    parameter: str | None


@dataclass(frozen=True)
class ExchangedSensors(WrongSensor):
    """Two sensors with whose positions exchanged the whole log fits.

    Attributes:
        other: Name of the second sensor.
    """

    other: str


@dataclass(frozen=True)
class SeveralExplanations(Finding):
    """Several sensors that explain a poor fit equally well.

    Attributes:
        suspected: Sensor of the largest outlier.
        others: Sensors without which the log fits as well as without it.
    """

    suspected: str
    others: tuple[str, ...]


@dataclass(frozen=True)
class DrawsWeighted(Finding):
    """Draws of a mixture, weighted by the posterior.

    Attributes:
        k_hat: Shape of the tail of the weights.
        effective: Effective sample size.
    """

    k_hat: float
    effective: float


@dataclass(frozen=True)
class Walked(Finding):
    """Draws of walkers, as requested by the user."""


@dataclass(frozen=True)
class ModeFoundOnce(Finding):
    """Fewer than two climbs ended at the best mode: there may be a better one."""


@dataclass(frozen=True)
class WeightsUnreliable(DrawsWeighted):
    """Too few draws have most of the weight: intervals are rough."""


@dataclass(frozen=True)
class PoorFit(Finding):
    """The log disagrees with its laws by more than its errors allow.

    Attributes:
        chi2: Chi squared.
        dof: Degrees of freedom.
        p_value: Probability of a larger chi squared.
        log: Name of the log if no scene was given, since one might help; else "".
    """

    chi2: float
    dof: int
    p_value: float
    log: str = ""


@dataclass(frozen=True)
class SlowerThanSound(Finding):
    """Air arrivals imply a speed below that of sound, by more than scatter explains.

    Attributes:
        sensors: Sensors with arrivals slower than sound, the slowest first.
        speed_m_s: Apparent speed of the slowest from the charge [m/s].
        sound_m_s: Speed of sound there, the wind along the path included [m/s].
    """

    sensors: tuple[str, ...]
    speed_m_s: float
    sound_m_s: float


@dataclass(frozen=True)
class PriorConflict(Finding):
    """The log fits well without priors, at values that a prior excludes.

    Attributes:
        values: These values of the numbers that contradict their priors.
    """

    values: Mapping[str, float]


@dataclass(frozen=True)
class LawOutOfRange(Finding):
    """Rows are outside the range of their laws.

    Attributes:
        rows: Number of rows outside.
        of: Number of all rows.
        quantities: Quantities of the rows outside.
        ranges: Each law and its range.
        is_deeper: True if only the deepest burial of the 90 % interval is outside.
    """

    rows: int
    of: int
    quantities: tuple[str, ...]
    ranges: tuple[tuple[str, str], ...]
    is_deeper: bool


@dataclass(frozen=True)
class LawsUnsettled(Finding):
    """The automatic choice at the answer differs from the laws of the fit.

    Attributes:
        laws: The choices at the answer, as QUANTITY=LAW.
    """

    laws: tuple[str, ...] = ()


@dataclass(frozen=True)
class BurstsUnsettled(Finding):
    """The curve sets by height at the answer differ from those of the fit."""


@dataclass(frozen=True)
class NoScene(Finding):
    """No scene was given, so the default scene was used.

    Attributes:
        freed: Parameters besides the mass that are free for this log.
        altitude_m: Altitude of the sensors for the standard atmosphere [m].
    """

    freed: tuple[str, ...] = ()
    altitude_m: float = 0.0


@dataclass(frozen=True)
class NothingLearned(Finding):
    """The log adds nothing to the priors of some numbers.

    Attributes:
        parameters: Names of these numbers.
    """

    parameters: tuple[str, ...]


@dataclass(frozen=True)
class FarFromItsLaw(Finding):
    """A whole shot or path departs from its law by more than its scatter.

    Attributes:
        times: Departure in standard deviations of the scatter.
    """

    times: float


@dataclass(frozen=True)
class HeightOfBurst(Finding):
    """The curves used for a charge above the ground, and their limitations.

    Attributes:
        note: Text of `law_choice.height_notes`.
    """

    note: str


@dataclass(frozen=True)
class DeepCharge(Finding):
    """The charge was buried; the laws account for the longer path only.

    Attributes:
        charge: Name of the charge, or "".
        scaled_depth: Scaled depth of burial [m/kg^(1/3)].
    """

    charge: str
    scaled_depth: float


@dataclass(frozen=True)
class NoPointSource(Finding):
    """The law of a point source was used for a chemical charge.

    Attributes:
        laws: Names of the laws.
        explosive: Explosive of the charge.
    """

    laws: tuple[str, ...]
    explosive: str


@dataclass(frozen=True)
class MoreToFree(Finding):
    """The default scene does not fit the log, but one with more free numbers does.

    Attributes:
        parameters: Parameters to free.
        p_value: Probability of a larger chi squared with them free.
        estimates: Estimates with them free, by parameter.
        clock: The only wrong clock among them, or "".
    """

    parameters: tuple[str, ...]
    p_value: float
    estimates: Mapping[str, Estimate]
    clock: str = ""


@dataclass(frozen=True)
class FlatGround(Finding):
    """The curvature of the Earth is not negligible.

    Attributes:
        sensor: Sensor of the reading with the largest error.
        quantity: Quantity of the reading.
        range_m: Distance from the charge [m].
        error_m: Error of this distance [m].
        sigmas: Error in sigmas of the reading.
    """

    sensor: str
    quantity: str
    range_m: float
    error_m: float
    sigmas: float


@dataclass(frozen=True)
class PathsTakenAsIndependent(Finding):
    """The scatter of too many neighbouring paths was taken as independent.

    Attributes:
        paths: Number of paths.
        limit: Largest number of paths with correlated scatter.
        beyond_array: True if a fitted position is farther from the middle of the
            sensors than their extent.
    """

    paths: int
    limit: int
    beyond_array: bool


@dataclass(frozen=True)
class ClocksTakenToAgree(Finding):
    """Clocks without a fitted or given offset, which were assumed to agree.

    Attributes:
        clocks: Names of the clocks. The reference clock is the first, unless it is the
            common clock, which has no name.
        parameters: Offsets that could be fitted instead.
        resting: Numbers that are identified by this assumption alone.
    """

    clocks: tuple[str, ...]
    parameters: tuple[str, ...]
    resting: tuple[str, ...] = ()


@dataclass(frozen=True)
class FlashesSetAside(Finding):
    """Flash times on clocks without other readings, which were not used.

    Attributes:
        clocks: Names of the clocks.
    """

    clocks: tuple[str, ...]
