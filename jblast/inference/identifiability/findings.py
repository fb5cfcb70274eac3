"""What data leave open, what would end that, and what they identify all the same."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Where = Literal["sensor", "place", "aside", "range", "later"]


@dataclass(frozen=True)
class ResolvingDatum:
    """A datum that would tell what a log cannot.

    Attributes:
        quantity: What to record.
        where: "sensor" (at one of the log), "place" (a new one), "aside" (a new place
            off the sensors' line), "range" (a new one) or "later" (at a later time).
        on_right_clock: Whether by a clock that is right.
        is_bang: Whether it is heard after a flash that the log holds: then it ranges.
    """

    quantity: str
    where: Where
    on_right_clock: bool = False
    is_bang: bool = False


@dataclass(frozen=True)
class Cure:
    """What would end a null direction: any one of these.

    Attributes:
        parameters: A prior on one of them, or a measurement.
        data: Rows that could be added.
    """

    parameters: tuple[str, ...]
    data: tuple[ResolvingDatum, ...]


@dataclass(frozen=True)
class NullDirection:
    """A direction in which parameters change together and no datum moves.

    Attributes:
        parameters: By how much each takes part; its coordinate is ln where it is
            positive.
        space: "ln", "linear" or "mixed": what the coordinates are.
        cure: What would end it.
    """

    parameters: Mapping[str, float]
    space: str
    cure: Cure


@dataclass(frozen=True)
class OtherMode:
    """Another optimum that the data cannot rule out.

    Attributes:
        parameters: Every number there.
        differ: Names of the numbers in which it is another.
        delta_chi2: By how much chi squared differs.
        cure: What would tell the two apart best.
    """

    parameters: Mapping[str, float]
    differ: tuple[str, ...]
    delta_chi2: float
    cure: ResolvingDatum


@dataclass(frozen=True)
class EstimableCombination:
    """A combination of unidentified numbers that the data do identify.

    Attributes:
        combination: Its formula.
        value: What it is.
        sd: Standard deviation of that.
        is_local: Whether it holds near the answer only, the invariance being curved.
    """

    combination: str
    value: float
    sd: float
    is_local: bool = False
