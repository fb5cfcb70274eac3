"""Findings of a fit about readings, sensors, clocks, laws, priors and itself."""

from collections.abc import Mapping
from dataclasses import dataclass

from jblast.inference.posterior.parameters import Estimate, Finding


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
class WrongSensor(Finding):
    """A sensor without which a log fits.

    Attributes:
        name: Its name.
        chi2: Of the others.
        dof: Degrees of freedom of the others.
        p_value: Chance of a larger chi squared.
        law_valid_rows: Rows of the others within their laws.
        estimates: Estimates from the others, by parameter.
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


@dataclass(frozen=True)
class ExchangedSensors(WrongSensor):
    """Two sensors with whose places exchanged a log fits, all rows together.

    Attributes:
        other: Name of the second sensor.
    """

    other: str


@dataclass(frozen=True)
class SeveralExplanations(Finding):
    """Other sensors without which a log fits as well as without a suspected one.

    Attributes:
        suspected: Sensor of the largest outlier.
        others: The other sensors.
    """

    suspected: str
    others: tuple[str, ...]


@dataclass(frozen=True)
class AsAsked(Finding):
    """A method was used because it was named."""


@dataclass(frozen=True)
class DirectionUnidentified(Finding):
    """The normal approximation is all there is where a direction is not identified."""


@dataclass(frozen=True)
class NotAtOptimum(Finding):
    """The search did not arrive at an optimum: the answer is where it ended."""


@dataclass(frozen=True)
class PoorFit(Finding):
    """The log disagrees with its laws by more than its errors allow.

    Attributes:
        chi2: Chi squared.
        dof: Its degrees of freedom.
        p_value: Chance of a larger one.
        log: Name of the log if no scene was given: one might help; else "".
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
    """Without priors the log fits well, where a prior rules it out.

    Attributes:
        values: The numbers there that contradict their priors.
    """

    values: Mapping[str, float]


@dataclass(frozen=True)
class LawOutOfRange(Finding):
    """Rows lie where their laws do not hold.

    Attributes:
        rows: How many.
        of: Among so many.
        quantities: Of what.
        ranges: Each law, and where it holds.
        is_deeper: Whether it is by the depth that the 90 % interval reaches.
    """

    rows: int
    of: int
    quantities: tuple[str, ...]
    ranges: tuple[tuple[str, str], ...]
    is_deeper: bool


@dataclass(frozen=True)
class LawsUnsettled(Finding):
    """At the answer other laws would be chosen than it was fitted with."""


@dataclass(frozen=True)
class BurstsUnsettled(Finding):
    """At the answer the height leaves other curve sets than it was fitted with."""


@dataclass(frozen=True)
class NoScene(Finding):
    """No scene was given, so the default one was taken.

    Attributes:
        freed: What the log left free in it beside the mass.
        altitude_m: Of the sensors, whose standard atmosphere was taken [m].
    """

    freed: tuple[str, ...] = ()
    altitude_m: float = 0.0


@dataclass(frozen=True)
class NothingLearned(Finding):
    """The log adds nothing to the priors of some numbers.

    Attributes:
        parameters: Which.
    """

    parameters: tuple[str, ...]


@dataclass(frozen=True)
class FarFromItsLaw(Finding):
    """The whole shot, or a path, departs from its law by more than expected.

    Attributes:
        times: So many times the scatter expected of it.
    """

    times: float


@dataclass(frozen=True)
class HeightOfBurst(Finding):
    """By which curves a charge above the ground was taken, and what they miss.

    Attributes:
        note: In the words of the sensors that read the curves.
    """

    note: str


@dataclass(frozen=True)
class DeepCharge(Finding):
    """The charge lay deep; of that the laws include the longer path alone.

    Attributes:
        charge: Its name, or "".
        scaled_depth: How deep [m/kg^(1/3)].
    """

    charge: str
    scaled_depth: float


@dataclass(frozen=True)
class NoPointSource(Finding):
    """The law of a point source read a chemical charge.

    Attributes:
        laws: Which.
        explosive: What the charge is of.
    """

    laws: tuple[str, ...]
    explosive: str


@dataclass(frozen=True)
class MoreToFree(Finding):
    """No default scene fits the log, but one with more numbers free does.

    Attributes:
        parameters: Which.
        p_value: Chance of a larger chi squared with them free.
        estimates: Estimates from the log then, by parameter.
        clock: The clock among them that is wrong, "" if none alone is.
    """

    parameters: tuple[str, ...]
    p_value: float
    estimates: Mapping[str, Estimate]
    clock: str = ""


@dataclass(frozen=True)
class FlatGround(Finding):
    """The Earth is round enough to matter.

    Attributes:
        sensor: Whose reading is furthest off by it.
        quantity: Of what.
        range_m: How far from the charge [m].
        error_m: How far off that distance is [m].
        sigmas: That in sigmas of the reading.
    """

    sensor: str
    quantity: str
    range_m: float
    error_m: float
    sigmas: float


@dataclass(frozen=True)
class PathsTakenAsIndependent(Finding):
    """The scatter of neighbouring paths was taken as independent: they are too many.

    Attributes:
        paths: How many there are.
        limit: Largest number whose correlation is taken into account.
        beyond_array: Whether a fitted place lies farther from the middle of the sensors
            than these are apart.
    """

    paths: int
    limit: int
    beyond_array: bool


@dataclass(frozen=True)
class ClocksTakenToAgree(Finding):
    """Clocks of a log that are neither fitted nor given, and were taken to agree.

    Attributes:
        clocks: Their names; the clock by which all are set stands first, unless it is
            the common clock, which has none.
        parameters: The offsets that could be fitted instead.
        resting: Numbers that are identified by this assumption alone.
    """

    clocks: tuple[str, ...]
    parameters: tuple[str, ...]
    resting: tuple[str, ...] = ()


@dataclass(frozen=True)
class FlashesSetAside(Finding):
    """Flash times on clocks that read nothing else, which were not used.

    Attributes:
        clocks: Their names.
    """

    clocks: tuple[str, ...]
