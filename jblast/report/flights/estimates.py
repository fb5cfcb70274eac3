"""What blasts do to what a vehicle takes for its state, in words."""

from collections.abc import Callable

from numpy.typing import ArrayLike

from jblast.report.tables import aligned
from jblast.study.flights.records import Flights
from jblast.study.flights.statistics import hold_words

PARTS = {"position": "place", "velocity": "moves", "attitude": "turn"}
UNITS = {"place": "_m", "moves": "_m_s", "turn": "_rad"}


def estimate_lines(
    flights: Flights, number: Callable[[str, ArrayLike], str]
) -> list[str]:
    """Return lines on the estimates of flights; none where they flew by the truth.

    Args:
        flights: What was flown.
        number: Words a number by the name of its unit.
    """
    rows = []
    for hold, flown in flights.holds.items():
        if flown.thrown is None:
            continue
        found = flown.thrown._asdict()
        for n, name in enumerate(flights.blasts):
            cells = []
            for part in PARTS.values():
                unit = UNITS[part]
                before = number(f"{part}{unit}", found[f"{part}_before{unit}"][..., n])
                after = number(f"{part}{unit}", found[f"{part}{unit}"][..., n])
                cells.append(f"{before} -> {after}")
            rows.append((f"{name or 'the charge'}, {hold_words(hold)}", *cells))
    if not rows:
        return []
    head = ("error of the estimate", *PARTS)
    return [
        "",
        *aligned([head, *rows]),
        "Root mean square in the second before each blast -> greatest until the next,",
        "10 s at most.",
    ]
