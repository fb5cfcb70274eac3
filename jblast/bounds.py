"""Where a number may lie, and how a message says so."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, overload

if TYPE_CHECKING:  # options of the command line are bounded too, and wait for no NumPy
    import numpy as np


@dataclass(frozen=True)
class Bounds:
    """Where a number may lie. A bound that is not there refuses nothing, not even NaN.

    Attributes:
        above: It is larger than this.
        at_least: It is at least this.
        at_most: It is at most this.
    """

    above: float = -math.inf
    at_least: float = -math.inf
    at_most: float = math.inf

    @overload
    def allows(self, value: float) -> bool: ...

    @overload
    def allows(self, value: "np.ndarray") -> "np.ndarray": ...

    def allows(self, value):
        """Return whether a number lies within the bounds; of an array, where."""
        return (
            ((value > self.above) | (self.above == -math.inf))
            & ((value >= self.at_least) | (self.at_least == -math.inf))
            & ((value <= self.at_most) | (self.at_most == math.inf))
        )

    def words(self) -> str:
        """Return the bounds in words: what a number that keeps them is."""
        if math.isfinite(self.at_most):
            return f"between {self.at_least:g} and {self.at_most:g}"
        if self.above == 0:
            return "positive"
        if math.isfinite(self.above):
            return f"above {self.above:g}"
        return "not negative" if self.at_least == 0 else f"at least {self.at_least:g}"


POSITIVE = Bounds(above=0.0)
UNBOUNDED = Bounds()
