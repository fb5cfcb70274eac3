"""A doubt about a log: what a fit would take, and a reader should look at."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Doubt:
    """Something odd that stops no fit.

    Doubts are typed where they are found and worded in `report.check`.

    Attributes:
        kind: What is odd, a key of `report.check.SENTENCES`.
        rows: Which rows of the log it is about, the one to look at first.
        numbers: What it was told by, in SI units, by name.
        names: Words it was told by: a sensor, a clock, a unit.
    """

    kind: str
    rows: tuple[int, ...]
    numbers: dict[str, float] = field(default_factory=dict)
    names: tuple[str, ...] = ()
