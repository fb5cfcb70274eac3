"""One edge of a method: where it breaks, what it does there, what jblast does."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

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

    @property
    def cases(self) -> int:
        """Of how many cases the boundary is a count; 0 if it is none."""
        of, _, number = self.unit.partition(" ")
        return int(number) if of == "of" and number.isdigit() else 0


EDGES: dict[str, Callable[[], list[Edge]]] = {}
"""What measures the edges of each area, by its name."""


def measures(area: str) -> Callable[[Callable[[], list[Edge]]], Callable]:
    """Enter a function into the table: it measures the edges of an area."""

    def enter(measure: Callable[[], list[Edge]]) -> Callable[[], list[Edge]]:
        EDGES[area] = measure
        return measure

    return enter


def witnessed(deed: Deed, seen: bool | np.bool_, what: str) -> Deed:
    """Return a deed, once it was seen to be done: a table claims no other.

    Args:
        deed: What jblast is said to do.
        seen: Whether it did, just now.
        what: Where, for the message.

    Raises:
        RuntimeError: It did not.
    """
    if not seen:
        raise RuntimeError(f"{what}: jblast was seen not to do what it should: {deed}")
    return deed
