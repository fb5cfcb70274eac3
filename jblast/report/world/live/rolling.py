"""The last of what came in, in buffers of fixed size."""

import numpy as np
from jaxtyping import Float

from jblast.sensors.signal.ring import Ring


class Rolling:
    """Columns of a plot that moves on: when a new one does not fit, the oldest goes.

    Attributes:
        capacity: How many columns are kept.
    """

    def __init__(self, capacity: int):
        """Make an empty one.

        Raises:
            ValueError: It would keep nothing.
        """
        self._rows = tuple(Ring(capacity) for _ in range(3))
        self.capacity = capacity

    def write(
        self,
        time_s: Float[np.ndarray, " column"],
        least: Float[np.ndarray, " column"],
        greatest: Float[np.ndarray, " column"],
    ) -> None:
        """Append columns: when, the smallest value of each and the largest."""
        count = min(time_s.size, self.capacity)
        for ring, values in zip(self._rows, (time_s, least, greatest), strict=True):
            ring.read(max(ring.waiting + count - self.capacity, 0))
            ring.write(values[values.size - count :])

    def shown(self) -> tuple[Float[np.ndarray, " column"], ...]:
        """Return time, least and greatest of the columns that are kept."""
        return tuple(ring.peek(ring.waiting) for ring in self._rows)
