"""One edge of a method: where it breaks, what it does there, what jblast does."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

Deed = Literal["marks", "refuses", "falls back", "holds"]
"""What jblast does past an edge; "holds" where the trap is avoided altogether."""


@dataclass(frozen=True)
class Edge:
    """One edge of one method, as measured.

    Attributes:
        area: Where it belongs: "laws", "wave forms", "solver", "clocks", "fits",
            "walks" and so on.
        method: The method, or the law and its quantity.
        edge: What goes wrong, in a few words.
        boundary: Where it begins, in the unit; a share of cases has the unit "of N".
        unit: Unit of the boundary; "" for a pure number.
        beyond: What the method alone does past it, with the figure measured.
        deed: What jblast does there.
        said: How: the mark, the message, or what takes over.
    """

    area: str
    method: str
    edge: str
    boundary: float
    unit: str
    beyond: str
    deed: Deed
    said: str


EDGES: dict[str, Callable[[], list[Edge]]] = {}
"""What measures the edges of each area, by its name."""


def measures(area: str) -> Callable[[Callable[[], list[Edge]]], Callable]:
    """Enter a function into the table: it measures the edges of an area."""

    def enter(measure: Callable[[], list[Edge]]) -> Callable[[], list[Edge]]:
        EDGES[area] = measure
        return measure

    return enter
