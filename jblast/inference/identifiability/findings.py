"""What data leave open, and what they identify all the same."""

from collections.abc import Mapping
from dataclasses import dataclass


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
    cure: str


@dataclass(frozen=True)
class OtherMode:
    """Another optimum that the data cannot rule out.

    Attributes:
        parameters: Every number there.
        reason: Why it is one.
        cure: What would tell the two apart.
    """

    parameters: Mapping[str, float]
    reason: str
    cure: str


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
